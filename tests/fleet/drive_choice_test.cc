#include "fleet/drive_choice.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

using Chosen = std::vector<std::size_t>;

AxisCost Tuned(double move_s, double move_J) {
  return {.tuned = true, .move_s = move_s, .move_J = move_J};
}

constexpr RailId kRails[] = {{0}, {0}, {1}};

TEST(DriveChoice, ARailHasTheVoltageOfTheLeastSumAndAUnitItsOwnBestSettingThere) {
  // At 1.8 V two settings; at 3 V one. Units 0 and 1 share a rail.
  const std::vector<DriveCandidate> candidates = {
      {1.8, {Tuned(2, 1), Tuned(2, 1), Tuned(2, 9), Tuned(2, 9), Tuned(2, 4), Tuned(2, 4)}},
      {1.8, {Tuned(3, 2), Tuned(3, 2), Tuned(3, 3), Tuned(3, 3), Tuned(3, 5), Tuned(3, 5)}},
      {3.0, {Tuned(1, 6), Tuned(1, 6), Tuned(1, 1), Tuned(1, 1), Tuned(1, 1), Tuned(1, 1)}}};
  // Rail 0: 2 J + 6 J at 1.8 V, 12 J + 2 J at 3 V. Rail 1: 8 J, 2 J.
  EXPECT_EQ(ChooseDrives(kRails, candidates, Minimise::kEnergy), (Chosen{0, 1, 2}));
  EXPECT_EQ(ChooseDrives(kRails, candidates, Minimise::kTime), (Chosen{2, 2, 2}));
}

TEST(DriveChoice, FewerRefusedAxesComeBeforeAnyCost) {
  const std::vector<DriveCandidate> candidates = {
      {1.8, {{}, Tuned(1, 1), Tuned(1, 1), Tuned(1, 1), Tuned(1, 1), Tuned(1, 1)}},
      {3.0, {Tuned(9, 9), Tuned(9, 9), Tuned(9, 9), Tuned(9, 9), Tuned(9, 9), Tuned(9, 9)}}};
  EXPECT_EQ(ChooseDrives(kRails, candidates, Minimise::kEnergy), (Chosen{1, 1, 0}));
}

TEST(DriveChoice, TimeIsThatOfTheSlowerAxis) {
  const std::vector<DriveCandidate> candidates = {{1.8, {Tuned(1, 0), Tuned(5, 0)}},
                                                  {1.8, {Tuned(4, 0), Tuned(4, 0)}}};
  EXPECT_EQ(ChooseDrives(std::vector<RailId>{{0}}, candidates, Minimise::kTime), (Chosen{1}));
}

TEST(DriveChoice, TheFirstOfEqualCandidatesAndTheLowerOfEqualVoltagesIsChosen) {
  const std::vector<DriveCandidate> candidates = {{3.0, {Tuned(1, 1), Tuned(1, 1)}},
                                                  {1.8, {Tuned(1, 1), Tuned(1, 1)}},
                                                  {1.8, {Tuned(1, 1), Tuned(1, 1)}}};
  EXPECT_EQ(ChooseDrives(std::vector<RailId>{{0}}, candidates, Minimise::kEnergy), (Chosen{1}));
}

TEST(DriveChoice, NoUnitsHaveNoChoice) {
  const std::vector<DriveCandidate> candidates = {{1.8, {}}};
  EXPECT_TRUE(ChooseDrives({}, candidates, Minimise::kTime).empty());
}

}  // namespace
}  // namespace focalfleet
