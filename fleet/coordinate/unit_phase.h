// The phases of the coordinator's work with a unit, as a table: a transition that is not in it is a
// bug.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "fleet/coordinate/unit_view.h"

namespace focalfleet {

constexpr std::uint32_t Bit(UnitPhase phase) { return 1u << static_cast<unsigned>(phase); }
constexpr std::uint32_t Bits(std::initializer_list<UnitPhase> phases) {
  std::uint32_t bits = 0;
  for (const UnitPhase phase : phases) bits |= Bit(phase);
  return bits;
}

namespace phase_table {
using enum UnitPhase;
/// A unit in any phase but kAbsent can fall silent, or prove to have restarted.
inline constexpr std::uint32_t kLost = Bits({kSilent, kIdentifying});

struct PhaseRow {
  UnitPhase from;
  std::uint32_t to;
};
inline constexpr PhaseRow kAllowed[kUnitPhaseCount] = {
    {kAbsent, Bits({kIdentifying})},
    {kIdentifying, Bits({kAbsent, kForeign, kReady, kSettling, kFault}) | kLost},
    {kForeign, kLost},
    {kReady, Bits({kStaging, kHoming, kFault}) | kLost},
    {kStaging, Bits({kConfirming, kReady, kFault}) | kLost},
    {kConfirming, Bits({kStaging, kArming, kReady, kFault}) | kLost},
    {kArming, Bits({kArmed, kReady, kFault}) | kLost},
    {kArmed, Bits({kMoving, kReady, kFault}) | kLost},
    {kMoving, Bits({kReady, kSettling, kFault}) | kLost},
    {kHoming, Bits({kReady, kSettling, kFault}) | kLost},
    {kSettling, Bits({kReady, kMoving, kHoming, kFault}) | kLost},
    {kFault, kLost},
    {kSilent, Bits({kIdentifying})},
};
}  // namespace phase_table

constexpr bool IsAllowed(UnitPhase from, UnitPhase to) {
  return (phase_table::kAllowed[static_cast<unsigned>(from)].to & Bit(to)) != 0;
}

/// The axes may be turning, or about to.
constexpr bool IsUnderWay(UnitPhase phase) {
  using enum UnitPhase;
  return (Bits({kMoving, kHoming, kSettling}) & Bit(phase)) != 0;
}

/// The unit holds (part of) a move that was not started.
constexpr bool IsLoaded(UnitPhase phase) {
  using enum UnitPhase;
  return (Bits({kStaging, kConfirming, kArming, kArmed}) & Bit(phase)) != 0;
}

/// A parameter may wait in this phase to be written: the unit rests, or is just being read.
constexpr bool MayWriteLater(UnitPhase phase) {
  using enum UnitPhase;
  return (Bits({kIdentifying, kReady, kFault}) & Bit(phase)) != 0;
}

}  // namespace focalfleet
