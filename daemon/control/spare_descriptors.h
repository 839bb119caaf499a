// Descriptors that are held back, so that a connection can be accepted when the process has none
// left.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstddef>
#include <vector>

namespace focalfleet {

class SpareDescriptors {
 public:
  SpareDescriptors() = default;
  SpareDescriptors(const SpareDescriptors&) = delete;
  SpareDescriptors& operator=(const SpareDescriptors&) = delete;
  ~SpareDescriptors() {
    while (Release()) {
    }
  }

  /// At least `count` are held, as far as the process has descriptors left.
  void Keep(std::size_t count) {
    while (held_.size() < count) {
      const int fd = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
      if (fd < 0) return;
      held_.push_back(fd);
    }
  }
  /// A held descriptor is free for other use. False: none was held.
  bool Release() {
    if (held_.empty()) return false;
    ::close(held_.back());
    held_.pop_back();
    return true;
  }

 private:
  std::vector<int> held_;
};

}  // namespace focalfleet
