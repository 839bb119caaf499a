// Configurations that a camera looks at: what it finds is what the coordinator goes by.
#include <gtest/gtest.h>

#include <cmath>

#include "fleet/kinematics.h"
#include "tests/scenario/in_process_fleet.h"

namespace focalfleet::testing {
namespace {

double TrueErrorUm(const InProcessFleet& fleet, const UnitView& view, std::uint32_t n) {
  const PointFp wanted = FibreAt(fleet.layout().units()[n], UnitDrive{}, *view.target);
  const sim::UnitTruth truth = const_cast<InProcessFleet&>(fleet).world().Truth(n);
  return 1e3 * std::hypot(truth.x_mm - wanted.x_mm, truth.y_mm - wanted.y_mm);
}

TEST(Measured, CorrectionsBringUnitsWithRealGearsToTheirTargets) {
  InProcessFleet fleet(
      {.count = 150, .seed = 3, .config = {.has_camera = true}, .spread = sim::Spread::kReal});
  fleet.ApplyRandomMeasured(1, {.corrections = 2, .tolerance_um = 10});
  ASSERT_TRUE(fleet.RunUntilIdle());
  const ConfigurationView& view = fleet.coordinator().configuration();
  ASSERT_EQ(view.measured.size(), 3u);
  // Blind, nobody is there; the rest at the end has gears or motors that no correction mends.
  EXPECT_EQ(view.measured[0].within_tolerance, 0u);
  EXPECT_GE(view.measured[2].within_tolerance, 138u);
  EXPECT_LT(view.measured[2].median_um, 6);
  for (std::uint32_t n = 0; n < fleet.layout().size(); ++n) {
    const UnitView& unit = fleet.coordinator().unit({n});
    if (unit.outcome == TargetOutcome::kArrived) {
      EXPECT_LT(TrueErrorUm(fleet, unit, n), 10 + 4 * 2 * std::sqrt(2.0)) << n;
    } else {
      EXPECT_FALSE(unit.outcome_reason.empty()) << n;
    }
  }
}

}  // namespace
}  // namespace focalfleet::testing
