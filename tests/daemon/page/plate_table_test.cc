#include "daemon/page/plate_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "daemon/page/plate_layout.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

class PlateTableTest : public ::testing::Test {
 protected:
  PlateTableTest() {
    status_.unit = layout_.unit({4}).id;
    status_.witness = {Witness::kMeasured, Witness::kMeasured};
    status_.low_deg = status_.high_deg = {30, 80};
    status_.target_deg = {30, 80};
    status_.phase = UnitPhase::kReady;
    status_.outcome = TargetOutcome::kArrived;
  }
  PlateUnit Taken() {
    StatusBatch batch;
    batch.units.push_back(status_);
    table_.Take(batch);
    return table_.units()[4];
  }

  Layout layout_ = Layout::Create(MakeHexLayout({.count = 40}), {}).value();
  PlateTable table_{&layout_};
  UnitStatusValue status_;
};

TEST_F(PlateTableTest, AUnitIsDrawnWhereItsFibreIs) {
  status_.low_deg = status_.high_deg = {200, 45};
  const PlateUnit code = Taken();
  const Unit& unit = layout_.unit({4});
  const double theta = code.theta * 2 * M_PI / kTurnSteps;
  const double both = theta + code.phi * 2 * M_PI / kTurnSteps;
  const double x_mm = unit.base_fp.x_mm + unit.theta().arm_mm * std::cos(theta) +
                      unit.phi().arm_mm * std::cos(both);
  const double y_mm = unit.base_fp.y_mm + unit.theta().arm_mm * std::sin(theta) +
                      unit.phi().arm_mm * std::sin(both);
  const PointFp fibre = FibreAt(unit, AxisAngles{200, 45});
  EXPECT_NEAR(x_mm, fibre.x_mm, 0.002);
  EXPECT_NEAR(y_mm, fibre.y_mm, 0.002);
}

TEST_F(PlateTableTest, TheErrorIsTheDistanceFromTheTarget) {
  EXPECT_EQ(Taken().error, 0u);
  status_.low_deg = status_.high_deg = {30.1, 80};
  const Unit& unit = layout_.unit({4});
  const PointFp stands = FibreAt(unit, AxisAngles{30.1, 80});
  const PointFp wanted = FibreAt(unit, AxisAngles{30, 80});
  const double um = 1000 * std::hypot(stands.x_mm - wanted.x_mm, stands.y_mm - wanted.y_mm);
  EXPECT_NEAR(Taken().error / 2.0, um, 0.26);
  status_.witness[1] = Witness::kPredicted;
  EXPECT_EQ(Taken().error, kNoCode) << "it moves";
  status_.witness[1] = Witness::kMeasured;
  status_.target_deg = {kNoNumber, kNoNumber};
  EXPECT_EQ(Taken().error, kNoCode) << "it has no target";
  EXPECT_EQ(Taken().target_theta, kNoCode);
}

TEST_F(PlateTableTest, AMeasuredErrorGoesBeforeThatOfThePlace) {
  status_.low_deg = status_.high_deg = {30.1, 80};
  status_.measured_error_um = 8.9;
  EXPECT_NEAR(Taken().error / 2.0, 8.9, 0.26);
}

TEST_F(PlateTableTest, TheLesserWitnessCounts) {
  status_.witness = {Witness::kMeasured, Witness::kInterval};
  status_.low_deg = {30, 40};
  status_.high_deg = {30, 80};
  const PlateUnit code = Taken();
  EXPECT_EQ(code.witness, static_cast<std::uint8_t>(Witness::kInterval));
  EXPECT_EQ(code.phi, AngleCode(60 + layout_.unit({4}).phi().zero_deg)) << "its middle";
  status_.low_deg = status_.high_deg = {kNoNumber, kNoNumber};
  EXPECT_EQ(Taken().theta, kNoCode);
}

TEST_F(PlateTableTest, FlagsHaveFaultAndWhetherItIsEnabled) {
  EXPECT_EQ(Taken().flags, 1u);
  status_.enabled = false;
  status_.fault = FaultCode::kDriver;
  EXPECT_EQ(Taken().flags, static_cast<int>(FaultCode::kDriver) << 1);
}

TEST_F(PlateTableTest, UnitsOfOtherPlatesChangeNothing) {
  status_.unit = UnitId{999'999};
  const auto before = table_.units();
  Taken();
  EXPECT_EQ(table_.units(), before);
}

TEST_F(PlateTableTest, FactsAreJsonWhateverTheFleetSays) {
  StatusBatch batch;
  batch.fleet = FleetStatusValue{.at = {1}, .version = "0.1\xff\"", .units = 40, .busy = true};
  batch.configuration = ConfigurationProgressValue{};
  batch.configuration->view.source = "night\n\"1\".csv\xfe";
  batch.configuration->view.makespan_predicted_s = std::numeric_limits<double>::infinity();
  batch.makespan_s = 1.5;
  batch.buses.push_back({.bus = layout_.buses()[0]});
  batch.buses.back().view.load = 0.25;
  table_.Take(batch);
  const auto facts = nlohmann::json::parse(table_.Facts());
  EXPECT_EQ(facts["units"], 40);
  EXPECT_EQ(facts["busy"], true);
  EXPECT_TRUE(facts["configuration"]["makespan_predicted_s"].is_null());
  EXPECT_EQ(facts["configuration"]["makespan_s"], 1.5);
  EXPECT_EQ(facts["buses"][0]["load"], 0.25);
  EXPECT_EQ(table_.at(), WallTime{1});
}

TEST(PlateLayout, HasEachUnitInTheOrderOfFrames) {
  const Layout layout = Layout::Create(MakeHexLayout({.count = 40}), {}).value();
  const auto json = nlohmann::json::parse(LayoutJson(layout));
  EXPECT_EQ(json["count"], 40);
  ASSERT_EQ(json["units"]["id"].size(), 40u);
  EXPECT_EQ(json["units"]["id"][7], layout.unit({7}).id.value);
  EXPECT_NEAR(json["units"]["x_mm"][7].get<double>(), layout.unit({7}).base_fp.x_mm, 1e-4);
  EXPECT_EQ(json["units"]["arm_phi_mm"], layout.unit({0}).phi().arm_mm) << "equal: one number";
}

}  // namespace
}  // namespace focalfleet
