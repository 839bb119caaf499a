// UploadOnWire is a listener on the wire. The listener measures the duration of an upload on the
// simulated bit clock, and the bits that the upload needs.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "protocol/wire/codec.h"
#include "protocol/wire/frame_bits.h"
#include "protocol/wire/stage_group.h"
#include "sim/world/world.h"

namespace focalfleet::test {

/// The upload of one bus, all in bits of its own clock. The needed frames are those without which a
/// unit is not armed, counted once. They are stage_begin, stage_segment, confirm and its answer,
/// arm, progress and their answers. Repeats, clock frames, polls and idle time do not count.
struct UploadOnWire {
  std::uint64_t needed_bits = 0;
  std::uint64_t other_bits = 0;    // of all other frames between the first and the last needed one
  std::uint64_t elapsed_bits = 0;  // first stage_begin's start to last progress_reply's end
  std::uint32_t frames = 0;
  std::uint32_t units = 0;
  std::uint32_t segments = 0;
  std::uint64_t segment_bits = 0;
  std::vector<CanFrame> staged;  // stage_begin, stage_segment, confirm; unit by unit

  [[nodiscard]] double ratio() const {
    return static_cast<double>(elapsed_bits) / static_cast<double>(needed_bits);
  }
  [[nodiscard]] double bits_per_unit() const {
    return static_cast<double>(needed_bits) / static_cast<double>(units);
  }
  /// The needed bits if the staging frames were in groups, as full as can be.
  [[nodiscard]] std::uint64_t needed_bits_with(const BusRates& rates) const {
    return needed_bits - BitsOnWire(staged, {rates.nominal_bps}) + BitsOnWire(staged, rates);
  }
};

/// The upload of each bus.
/// Pre: `wire` holds one upload, as the wire carried it.
inline std::map<BusId, UploadOnWire> MeasureUpload(std::span<const sim::WireFrame> wire,
                                                   std::uint32_t bit_rate_bps = 1'000'000) {
  const auto is_needed = [](const CanFrame& frame) {
    switch (static_cast<Function>(frame.id >> 20 & 63)) {
      case Function::kStageBegin:
      case Function::kStageSegment:
      case Function::kConfirm:
      case Function::kArm:
      case Function::kProgress:
        return true;
      default:
        return false;
    }
  };
  struct Seen {
    HostInstant from = kNever;
    HostInstant until{INT64_MIN};
    std::vector<CanFrame> frames;  // needed ones, to find repeats
  };
  std::map<BusId, Seen> seen;
  for (const sim::WireFrame& w : wire) {
    if (!is_needed(w.frame)) continue;
    Seen& bus = seen[w.bus];
    bus.from = std::min(bus.from, w.at - BitTime(FrameBits(w.frame), bit_rate_bps));
    bus.until = std::max(bus.until, w.at);
  }
  std::map<BusId, UploadOnWire> out;
  for (auto& [bus, times] : seen)
    out[bus].elapsed_bits = static_cast<std::uint64_t>(
        static_cast<double>((times.until - times.from).ns) * 1e-9 * bit_rate_bps + 0.5);
  for (const sim::WireFrame& w : wire) {
    const auto it = seen.find(w.bus);
    if (it == seen.end() || w.at <= it->second.from || w.at > it->second.until) continue;
    UploadOnWire& upload = out[w.bus];
    const std::uint32_t bits = FrameBits(w.frame);
    auto& frames = it->second.frames;
    if (!is_needed(w.frame) || std::find(frames.begin(), frames.end(), w.frame) != frames.end()) {
      upload.other_bits += bits;
      continue;
    }
    frames.push_back(w.frame);
    upload.needed_bits += bits;
    ++upload.frames;
    const auto function = static_cast<Function>(w.frame.id >> 20 & 63);
    if (CanBeGrouped(w.frame)) upload.staged.push_back(w.frame);
    if (function == Function::kStageBegin) ++upload.units;
    if (function == Function::kStageSegment) {
      ++upload.segments;
      upload.segment_bits += bits;
    }
  }
  // The host sends the frames in this order; between the units' mailboxes lower identifiers
  // overtake.
  for (auto& [bus, upload] : out)
    std::ranges::stable_sort(upload.staged, {},
                             [](const CanFrame& frame) { return frame.id >> 11 & 255; });
  return out;
}

}  // namespace focalfleet::test
