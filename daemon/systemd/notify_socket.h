// The notify socket, by which a service tells its manager how it stands: ready, reloading, ending,
// alive, and a line for people. Each message is one datagram of KEY=VALUE lines. Source:
// sd_notify(3) and sd_watchdog_enabled(3) of systemd 252.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "protocol/base/instants.h"

namespace focalfleet {

/// The value of an environment variable; null where it is not set.
using Environment = std::function<const char*(const char* name)>;

class NotifySocket {
 public:
  /// The socket that NOTIFY_SOCKET names: a path, or an abstract name after '@'. Without the
  /// variable, or where it names no such address, there is none.
  static NotifySocket FromEnvironment(const Environment& environment);

  /// A socket of no manager: Send does nothing.
  NotifySocket() = default;
  NotifySocket(NotifySocket&& other) noexcept;
  NotifySocket& operator=(NotifySocket&& other) noexcept;
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;
  ~NotifySocket();

  [[nodiscard]] bool present() const { return fd_ >= 0; }
  /// The manager has the lines. Never waits. False: there is no manager, or its queue is full.
  [[nodiscard]] bool Send(std::string_view lines) const;

 private:
  NotifySocket(int fd, std::string address) : fd_(fd), address_(std::move(address)) {}

  int fd_ = -1;
  std::string address_;  // as sun_path holds it: an abstract one begins with a zero byte
};

/// Real time within which the manager expects a sign of life each (WATCHDOG_USEC). None: it
/// expects none, or expects them from another process (WATCHDOG_PID).
std::optional<DurationNs> WatchdogInterval(const Environment& environment);

}  // namespace focalfleet
