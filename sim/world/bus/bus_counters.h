// The counters of one bus: its frames, its errors, and how its time was spent. Each part of the bus
// counts for itself.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/base/instants.h"
#include "sim/world/bus/frame_course.h"

namespace focalfleet::sim {

/// The use of the wire. All time since the start is idle, busy or dead. The parts `destroyed` and
/// `stuck` of the busy time carried no frame through.
struct WireUse {
  std::uint64_t bits = 0;        // of frames that got through; exact, stuff bits included
  std::uint64_t error_bits = 0;  // of destroyed attempts with their error frames
  // Error frames by the error that the sender saw.
  std::array<std::uint64_t, kFrameErrorCount> errors{};
  DurationNs busy{0};
  DurationNs destroyed{0};
  DurationNs stuck{0};  // dominant without a frame
  DurationNs dead{0};
  DurationNs idle{0};  // until the last frame began

  [[nodiscard]] std::uint64_t error_frames() const {
    std::uint64_t sum = 0;
    for (const std::uint64_t count : errors) sum += count;
    return sum;
  }
  /// A frame, or a part of one, took the wire. `in_vain`: it did not get through.
  void Charge(DurationNs taken, bool in_vain) {
    busy = busy + taken;
    if (in_vain) destroyed = destroyed + taken;
  }
  /// The share of the time in which the wire was taken.
  [[nodiscard]] double Load(DurationNs elapsed) const {
    return elapsed.ns > 0 ? static_cast<double>(busy.ns) / static_cast<double>(elapsed.ns) : 0;
  }
};

struct MailboxCounters {
  // Frames that were lost by a planted fault, or because the bus or the sender went off or away.
  std::uint64_t dropped = 0;
  std::uint64_t refused = 0;      // no mailbox left
  std::uint32_t waiting_max = 0;  // the most frames that ever waited at once
};

/// Changes of controllers, each as often as it happened.
struct ConfinementCounters {
  std::uint64_t went_passive = 0;
  std::uint64_t went_off = 0;
  std::uint64_t recovered = 0;  // from off
};

struct BusCounters {
  std::uint64_t host_frames = 0;  // through the wire
  std::uint64_t unit_frames = 0;
  std::uint64_t repeats = 0;         // attempts that follow a destroyed one
  std::uint64_t received_twice = 0;  // accepted by receivers, and sent again all the same
  std::uint64_t babbled = 0;         // frames of a babbling node that got through
  WireUse wire;
  MailboxCounters mailboxes;
  ConfinementCounters controllers;
};

}  // namespace focalfleet::sim
