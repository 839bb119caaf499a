// Places of an axis that show the same vector: they differ by whole electrical turns.
#pragma once

#include <cstdint>

#include "protocol/base/ids.h"

namespace focalfleet::sim {

// The bits of Flash::lost_axes.
inline constexpr std::uint8_t kBothAxes = 3;
constexpr std::uint8_t Bit(Axis axis) { return static_cast<std::uint8_t>(1u << Index(axis)); }

constexpr std::int32_t FloorMod(std::int32_t a, std::int32_t n) { return (a % n + n) % n; }

/// The place nearest to `value` that shows the same vector as `like`.
constexpr std::int32_t NearestCongruent(std::int32_t value, std::int32_t like,
                                        std::int32_t subdivision) {
  const std::int32_t below = value - FloorMod(value - like, subdivision);
  return value - below <= subdivision / 2 ? below : below + subdivision;
}

}  // namespace focalfleet::sim
