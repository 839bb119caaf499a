#include "daemon/process/slow_end.h"

#include <condition_variable>
#include <mutex>
#include <string>
#include <utility>

namespace focalfleet {

SlowEnd::SlowEnd(const NotifySocket* socket, Options options)
    : socket_(socket), options_(std::move(options)) {
  if (socket_->present())
    thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void SlowEnd::Run(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any ended;
  std::unique_lock lock(mutex);
  std::uint64_t seen = options_.progress();
  for (;;) {
    ended.wait_for(lock, stop, options_.period, [] { return false; });
    if (stop.stop_requested()) return;
    if (std::exchange(seen, options_.progress()) == seen) continue;
    const auto microseconds = std::chrono::microseconds(options_.more).count();
    [[maybe_unused]] const bool sent =
        socket_->Send("EXTEND_TIMEOUT_USEC=" + std::to_string(microseconds) +
                      "\nWATCHDOG=1\nSTATUS=ending: rows wait for the disk, stored through batch " +
                      std::to_string(seen));
  }
}

}  // namespace focalfleet
