// The frames that a unit sends because of one frame or at one instant.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "protocol/base/check.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet::sim {

/// The queue holds at most an answer to each entry of a group, and the end of a motion.
class TransmitQueue {
 public:
  void Add(const CanFrame& frame) {
    FOCALFLEET_CHECK(count_ < frames_.size());
    frames_[count_++] = frame;
  }
  [[nodiscard]] std::span<const CanFrame> frames() const { return {frames_.data(), count_}; }

 private:
  std::array<CanFrame, kGroupEntriesMax + 1> frames_{};
  std::size_t count_ = 0;
};

}  // namespace focalfleet::sim
