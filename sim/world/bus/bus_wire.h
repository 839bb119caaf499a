// The wire of one bus: idle, taken by a frame, stuck, or dead. The wire keeps account of its time
// to the bit. Its frame holds it for an exact number of bits, 131..160 us for eight bytes at
// 1 Mbit/s.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/instants.h"
#include "sim/world/bus/arbitration_queue.h"
#include "sim/world/bus/bus_counters.h"
#include "sim/world/bus/bus_options.h"
#include "sim/world/bus/frame_course.h"

namespace focalfleet::sim {

struct FrameOnWire {
  QueuedFrame entry;
  bool babbling = false;  // its sender is a babbling node
  FrameCourse course = {};
  std::uint32_t refusing = kNoNode;  // the receiver that refuses this frame
  bool abandoned = false;            // its sender is gone

  /// Its sender tries again when it did not get through.
  [[nodiscard]] bool is_repeated() const { return !babbling && !abandoned; }
};

/// A wire that is dominant, whatever the nodes drive. The nodes count errors in steps.
struct StuckWire {
  HostInstant since;
  HostInstant step_at = kNever;    // of the next count; kNever: no node can lose any more
  std::uint32_t sender = kNoNode;  // sent the frame that the wire destroyed
  std::uint32_t steps = 0;         // that were counted
};

class BusWire {
 public:
  explicit BusWire(const BusOptions& options) : options_(options), idle_at_(options.start) {}

  [[nodiscard]] bool sending() const { return frame_.has_value(); }
  [[nodiscard]] bool dead() const { return dead_; }
  /// None: the wire is not stuck.
  [[nodiscard]] const std::optional<StuckWire>& stuck() const { return stuck_; }
  /// The end of the frame on the wire, or of the last one.
  [[nodiscard]] HostInstant idle_at() const { return idle_at_; }
  [[nodiscard]] const WireUse& use() const { return use_; }

  /// `frame` holds the wire from `now` to idle_at(). Pre: the wire is idle.
  void Begin(const FrameOnWire& frame, HostInstant now);
  /// Returns the frame that ends at idle_at(). Pre: sending().
  FrameOnWire End();
  /// The frame on the wire, if it is the node's own, ends here and is not sent again. Returns that
  /// frame where no node has received it.
  std::optional<QueuedFrame> CutOff(std::uint32_t node, HostInstant now);

  /// A wire that is dead, or stuck already, or has no bit clock, cannot stick.
  [[nodiscard]] bool can_stick() const { return !dead_ && !stuck_ && options_.bit_clock; }
  /// The wire is dominant. Returns the frame that this destroys and that its sender repeats. Pre:
  /// can_stick().
  std::optional<QueuedFrame> Stick(HostInstant now);
  /// The nodes counted the step that was due. `last`: no node can lose any more. Pre: stuck().
  void StickOn(bool last);
  /// The wire is idle behind the error frame that all nodes see. Pre: stuck().
  void Release(HostInstant now);

  /// The frame on the wire is lost. Pre: the wire is neither dead nor stuck.
  void Kill(HostInstant now);
  /// Pre: the wire is dead.
  void Revive(HostInstant now);

 private:
  /// The bits of the frame on the wire that are over at `now`. Pre: `now` is within the frame.
  [[nodiscard]] std::uint32_t BitsOver(HostInstant now) const;

  BusOptions options_;
  WireUse use_;
  std::optional<FrameOnWire> frame_;
  HostInstant began_at_{0};
  HostInstant idle_at_;
  std::optional<StuckWire> stuck_;
  HostInstant dead_at_{0};
  bool dead_ = false;
};

}  // namespace focalfleet::sim
