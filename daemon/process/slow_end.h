// An end that takes long asks the service manager for more time, as long as it proceeds. Source:
// EXTEND_TIMEOUT_USEC of sd_notify(3). An end that hangs asks for nothing, and the manager's own
// limit ends it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <thread>

#include "daemon/systemd/notify_socket.h"

namespace focalfleet {

class SlowEnd {
 public:
  struct Options {
    /// Grows whenever the end has proceeded. Any thread.
    std::function<std::uint64_t()> progress;
    /// Time between two looks. The store flushes several times in one, even where a flush takes
    /// 0.2 s. An end of a second asks for nothing.
    std::chrono::milliseconds period{1000};
    /// Time asked for at each look that saw progress. With less than some periods a short pause
    /// would be taken for a hang; ten times as much would hide a hang for minutes.
    std::chrono::milliseconds more{10'000};
  };

  /// Looks on a thread of its own until the object goes; `socket` outlives it.
  SlowEnd(const NotifySocket* socket, Options options);

 private:
  void Run(const std::stop_token& stop);

  const NotifySocket* socket_;
  Options options_;
  std::jthread thread_;  // last: the thread uses all members above
};

}  // namespace focalfleet
