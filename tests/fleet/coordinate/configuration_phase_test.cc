#include "fleet/coordinate/configuration_phase.h"

#include <gtest/gtest.h>

#include <vector>

namespace focalfleet {
namespace {

using enum ConfigurationPhase;
using configuration_phase_table::kAllowed;

std::vector<ConfigurationPhase> AllPhases() {
  std::vector<ConfigurationPhase> phases;
  for (std::uint8_t n = 0; n < kConfigurationPhaseCount; ++n)
    phases.push_back(static_cast<ConfigurationPhase>(n));
  return phases;
}

/// The phases that are reached from `first` by any number of transitions, without those in `cut`.
std::uint32_t ReachedFrom(ConfigurationPhase first, std::uint32_t cut = 0) {
  std::uint32_t reached = Bit(first);
  for (int pass = 0; pass < kConfigurationPhaseCount; ++pass)
    for (const ConfigurationPhase from : AllPhases())
      if ((reached & Bit(from)) != 0) reached |= kAllowed[static_cast<unsigned>(from)].to & ~cut;
  return reached;
}

constexpr std::uint32_t kEvery = (1u << kConfigurationPhaseCount) - 1;

TEST(ConfigurationPhase, RowsStandInTheOrderOfTheEnumeration) {
  for (const ConfigurationPhase phase : AllPhases())
    EXPECT_EQ(kAllowed[static_cast<unsigned>(phase)].from, phase);
}

TEST(ConfigurationPhase, EveryPhaseIsReachedFromIdleAndLeadsBackToIt) {
  EXPECT_EQ(ReachedFrom(kIdle), kEvery);
  for (const ConfigurationPhase phase : AllPhases())
    EXPECT_NE(ReachedFrom(phase) & Bit(kIdle), 0u) << static_cast<int>(phase);
}

TEST(ConfigurationPhase, BeginsByGatheringAndEndsByReportingAlone) {
  for (const ConfigurationPhase phase : AllPhases()) {
    EXPECT_EQ(IsAllowed(kIdle, phase), phase == kGathering) << static_cast<int>(phase);
    EXPECT_EQ(IsAllowed(phase, kIdle), phase == kReporting) << static_cast<int>(phase);
    EXPECT_EQ(IsAllowed(kReporting, phase), phase == kIdle) << static_cast<int>(phase);
  }
}

TEST(ConfigurationPhase, NothingMovesWithoutADurableIntent) {
  for (const ConfigurationPhase phase : AllPhases()) {
    EXPECT_EQ(IsAllowed(phase, kMoving), phase == kCommitting) << static_cast<int>(phase);
    EXPECT_EQ(IsAllowed(phase, kHoming), phase == kHomeCommitting) << static_cast<int>(phase);
    EXPECT_EQ(IsAllowed(phase, kCommitting), phase == kUploading) << static_cast<int>(phase);
    EXPECT_EQ(IsAllowed(phase, kUploading), phase == kPlanning) << static_cast<int>(phase);
  }
}

TEST(ConfigurationPhase, AfterAFailureBeforeTheStartMovesAreGivenBackBeforeAnyPlan) {
  EXPECT_EQ(kAllowed[static_cast<unsigned>(kUploading)].to & ReachedFrom(kUploading),
            Bits({kCommitting, kDisarming}));
  EXPECT_EQ(ReachedFrom(kUploading, Bits({kMoving, kDisarming})), Bits({kUploading, kCommitting}));
}

TEST(ConfigurationPhase, OnlyPlanningFollowsItself) {
  for (const ConfigurationPhase phase : AllPhases())
    EXPECT_EQ(IsAllowed(phase, phase), phase == kPlanning) << static_cast<int>(phase);
}

}  // namespace
}  // namespace focalfleet
