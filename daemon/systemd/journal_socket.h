// The journal's socket, by which a program hands over an event with fields beside its sentence. An
// event is one datagram of NAME=VALUE lines; journalctl finds events by them. Source: Native
// Journal Protocol, https://systemd.io/JOURNAL_NATIVE_PROTOCOL, as of systemd 252.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "daemon/systemd/notify_socket.h"

namespace focalfleet {

/// Standard error of this process is a stream of the journal, as JOURNAL_STREAM says by device and
/// inode.
bool StandardErrorIsJournal(const Environment& environment);

struct JournalField {
  std::string_view name;  // capital letters, digits, underscores
  std::string_view value;
};

class JournalSocket {
 public:
  static constexpr const char* kPath = "/run/systemd/journal/socket";
  /// Bytes of a value; the rest of a longer one is cut off. A datagram must fit into the socket's
  /// send buffer, 208 kB by default (net.core.wmem_default).
  static constexpr std::size_t kValueBytesMax = std::size_t{48} << 10;

  explicit JournalSocket(std::string path);
  JournalSocket(const JournalSocket&) = delete;
  JournalSocket& operator=(const JournalSocket&) = delete;
  ~JournalSocket();

  /// The journal has the event. Never waits. False: the journal does not run, or its queue is full.
  [[nodiscard]] bool Send(std::span<const JournalField> fields) const;

 private:
  int fd_ = -1;
  std::string path_;
};

}  // namespace focalfleet
