// Five kinds of integer identify the parts of a fleet. Each is a type of its own, so that two of
// them cannot be swapped silently. A unit is one positioner with two axes. `unit_id` is the
// operators' number for a place on the plate, and (bus, node) is the address at which the unit
// answers. The serial number identifies the hardware at that place; vectors and tuned parameters
// belong to it.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>

namespace focalfleet {

/// An integer that identifies: comparable and hashable, without arithmetic.
template <class Tag, class Rep>
struct StrongId {
  Rep value{};
  constexpr auto operator<=>(const StrongId&) const = default;
};

using UnitId = StrongId<struct UnitIdTag, std::uint32_t>;               // the operators' number
using PositionerIndex = StrongId<struct PositionerTag, std::uint32_t>;  // row in the layout, 0..n-1
using BusId = StrongId<struct BusIdTag, std::uint32_t>;
using RailId = StrongId<struct RailIdTag, std::uint32_t>;
using NodeId = StrongId<struct NodeIdTag, std::uint8_t>;
using SerialNumber = StrongId<struct SerialTag, std::uint32_t>;
using MoveId = StrongId<struct MoveIdTag, std::uint16_t>;  // one round of motion; 0 is "none yet"

/// The broadcast address reaches every node of a bus; no unit has it.
inline constexpr NodeId kBroadcastNode{255};

enum class Axis : std::uint8_t { kTheta = 0, kPhi = 1 };
inline constexpr Axis kAxes[] = {Axis::kTheta, Axis::kPhi};
inline constexpr std::size_t kAxisCount = 2;
constexpr std::size_t Index(Axis axis) { return static_cast<std::size_t>(axis); }
constexpr const char* Name(Axis axis) { return axis == Axis::kTheta ? "theta" : "phi"; }

/// The way in which SVPWM forms its pulses. The mode decides the switching loss. Source: paper 1,
/// section "Wave generation mode".
enum class WaveMode : std::uint8_t { kAsymmetric = 0, kFiveSegment = 1, kSevenSegment = 2 };
constexpr const char* Name(WaveMode mode) {
  constexpr const char* kNames[] = {"asymmetric", "five_segment", "seven_segment"};
  return kNames[static_cast<std::size_t>(mode)];
}

}  // namespace focalfleet

template <class Tag, class Rep>
struct std::hash<focalfleet::StrongId<Tag, Rep>> {
  std::size_t operator()(focalfleet::StrongId<Tag, Rep> id) const noexcept {
    return std::hash<Rep>{}(id.value);
  }
};
