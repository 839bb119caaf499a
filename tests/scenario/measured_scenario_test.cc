// Configurations that a camera looks at: what it finds is what the coordinator goes by.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

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
  InProcessFleet fleet({.count = 150, .seed = 3, .spread = sim::Spread::kReal});
  fleet.ApplyRandomMeasured(1, {.corrections = 2, .tolerance_um = 10});
  ASSERT_TRUE(fleet.RunUntilIdle());
  const ConfigurationView& view = fleet.coordinator().configuration();
  ASSERT_EQ(view.measured.size(), 3u);
  for (const MeasuredRound& round : view.measured)
    std::printf("exposure %d: %u measured, rms %.1f um, worst %.1f um, %u within\n",
                static_cast<int>(round.exposure), round.measured, round.rms_um, round.worst_um,
                round.within_tolerance);
  for (std::uint32_t n = 0; n < fleet.layout().size(); ++n) {
    const UnitView& unit = fleet.coordinator().unit({n});
    if (unit.outcome == TargetOutcome::kArrived) {
      EXPECT_LT(TrueErrorUm(fleet, unit, n), 10 + 4 * 2 * std::sqrt(2.0)) << n;
    } else {
      std::printf("%.1f ", *unit.error_um);
    }
  }
}

}  // namespace
}  // namespace focalfleet::testing
