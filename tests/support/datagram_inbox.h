// The receiving end of UNIX datagrams, as a service manager or the journal has it.
#pragma once

#include <optional>
#include <string>

namespace focalfleet::test {

class DatagramInbox {
 public:
  /// Listens at `address`: a path, or an abstract name after '@'.
  explicit DatagramInbox(const std::string& address);
  DatagramInbox(const DatagramInbox&) = delete;
  DatagramInbox& operator=(const DatagramInbox&) = delete;
  ~DatagramInbox();

  /// The next datagram; none where none comes within `limit_ms`.
  std::optional<std::string> Next(int limit_ms = 30'000) const;
  /// Takes datagrams until one contains `text`, and returns it; none where none of those that come
  /// within `limit_ms` does.
  std::optional<std::string> NextWith(const std::string& text, int limit_ms = 60'000) const;

 private:
  int fd_ = -1;
};

}  // namespace focalfleet::test
