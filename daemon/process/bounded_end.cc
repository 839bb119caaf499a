#include "daemon/process/bounded_end.h"

#include <utility>

namespace focalfleet {

BoundedEnd::BoundedEnd(std::vector<Part> parts) {
  for (const Part& part : parts) left_.insert(part.name);
  for (Part& part : parts)
    threads_.emplace_back([this, part = std::move(part)] {
      part.end();
      const std::lock_guard lock(mutex_);
      left_.erase(part.name);
      ended_.notify_all();
    });
}

std::vector<std::string> BoundedEnd::Wait(std::chrono::milliseconds limit) {
  std::unique_lock lock(mutex_);
  ended_.wait_until(lock, begun_ + limit, [this] { return left_.empty(); });
  return {left_.begin(), left_.end()};
}

}  // namespace focalfleet
