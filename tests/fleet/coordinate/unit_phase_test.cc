#include "fleet/coordinate/unit_phase.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

using enum UnitPhase;

std::vector<UnitPhase> AllPhases() {
  std::vector<UnitPhase> phases;
  for (std::uint8_t n = 0; n < kUnitPhaseCount; ++n) phases.push_back(static_cast<UnitPhase>(n));
  return phases;
}

TEST(UnitPhase, RowsStandInTheOrderOfTheEnumeration) {
  for (const UnitPhase phase : AllPhases())
    EXPECT_EQ(phase_table::kAllowed[static_cast<unsigned>(phase)].from, phase);
}

TEST(UnitPhase, EveryPhaseIsReachedFromAbsent) {
  std::uint32_t reached = Bit(kAbsent);
  for (int pass = 0; pass < kUnitPhaseCount; ++pass)
    for (const UnitPhase from : AllPhases())
      if ((reached & Bit(from)) != 0)
        reached |= phase_table::kAllowed[static_cast<unsigned>(from)].to;
  EXPECT_EQ(reached, (1u << kUnitPhaseCount) - 1);
}

TEST(UnitPhase, MotionBeginsOnlyFromArmedOrReadyAndIsNeverSkipped) {
  for (const UnitPhase from : AllPhases()) {
    EXPECT_EQ(IsAllowed(from, kMoving), from == kArmed || from == kSettling) << Name(from);
    EXPECT_EQ(IsAllowed(from, kHoming), from == kReady || from == kSettling) << Name(from);
    EXPECT_EQ(IsAllowed(from, kArmed), from == kArming) << Name(from);
    EXPECT_EQ(IsAllowed(from, kArming), from == kConfirming) << Name(from);
  }
}

TEST(UnitPhase, SilentAndForeignUnitsAreReadAnewBeforeAnythingElse) {
  for (const UnitPhase to : AllPhases()) {
    EXPECT_EQ(IsAllowed(kSilent, to), to == kIdentifying) << Name(to);
    EXPECT_EQ(IsAllowed(kForeign, to), to == kIdentifying || to == kSilent) << Name(to);
  }
}

}  // namespace
}  // namespace focalfleet
