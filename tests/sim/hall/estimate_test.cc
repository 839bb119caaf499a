// Faulty sensors are found and named, or the estimate says that they cannot be distinguished. Noise
// and covariance are those of the data.
#include "sim/hall/estimate.h"

#include <gmock/gmock.h>

#include "tests/sim/hall/planted_rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using ::testing::HasSubstr;

constexpr double kNoise_T = 5e-4;

struct Table {
  std::vector<VoltageRow> rows;
  std::vector<test::PlantedPose> truth;
};
Table Drawn(std::size_t rows, double noise_T = kNoise_T) {
  const std::uint64_t seed = test::TestSeed(23);
  const auto law = test::OfSurface(0.08, 21);
  Table table;
  table.truth =
      test::MakeCampaign({.rows = rows, .noise_T = noise_T, .seed = seed}, law, law, {}).poses;
  for (const auto& pose : table.truth) table.rows.push_back({pose.volts});
  return table;
}

Estimates Of(const std::vector<VoltageRow>& rows, bool magnitudes = false) {
  return EstimateOrientations({}, MakeField(SurfaceParameters{.amplitude_T = 0.08}), rows,
                              {.magnitudes = magnitudes});
}

double Rms_deg(const Estimates& estimates, const Table& table) {
  double squares = 0;
  for (std::size_t k = 0; k < table.truth.size(); ++k) {
    const Orientation& found = estimates.rows[k].orientation;
    squares += std::pow(found.alpha_rad / kRadPerDeg - table.truth[k].alpha_deg, 2) +
               std::pow(found.beta_rad / kRadPerDeg - table.truth[k].beta_deg, 2);
  }
  return std::sqrt(squares / (2 * static_cast<double>(table.truth.size())));
}

TEST(Estimate, SaysOkWithTheDatasNoise) {
  const Table table = Drawn(100);
  const Estimates estimates = Of(table.rows);
  EXPECT_TRUE(estimates.verdicts.empty());
  EXPECT_TRUE(estimates.noise_from_residuals);
  EXPECT_NEAR(estimates.noise_T, kNoise_T, 0.2 * kNoise_T);
  double chi2 = 0;
  for (std::size_t k = 0; k < table.truth.size(); ++k) {
    EXPECT_EQ(estimates.rows[k].status, "ok") << k;
    const double miss =
        estimates.rows[k].orientation.alpha_rad - table.truth[k].alpha_deg * kRadPerDeg;
    chi2 += std::pow(miss / estimates.rows[k].sd_rad[0], 2);
  }
  EXPECT_NEAR(chi2 / 100, 1, 0.45);
}

TEST(Estimate, AStuckSensorIsNamedAndLeftOut) {
  Table table = Drawn(60);
  const double good_deg = Rms_deg(Of(table.rows), table);
  for (VoltageRow& row : table.rows) row.voltages_V[2] = 3.1;
  const Estimates estimates = Of(table.rows);
  ASSERT_EQ(estimates.verdicts.size(), 1u);
  EXPECT_EQ(estimates.verdicts[0].fault, SensorFault::kStuck);
  EXPECT_THAT(estimates.verdicts[0].sensors, ::testing::ElementsAre(2u));
  EXPECT_THAT(estimates.rows[0].status, HasSubstr("stuck v3"));
  EXPECT_LT(Rms_deg(estimates, table), 3 * good_deg);
}

TEST(Estimate, AStuckSensorWithNoiseIsNamedToo) {
  Table table = Drawn(60);
  Rng rng(9);
  for (VoltageRow& row : table.rows) row.voltages_V[6] = 2.2 + 0.0125 * rng.Normal();
  const Estimates estimates = Of(table.rows);
  ASSERT_EQ(estimates.verdicts.size(), 1u);
  EXPECT_EQ(estimates.verdicts[0].fault, SensorFault::kStuck);
  EXPECT_THAT(estimates.verdicts[0].sensors, ::testing::ElementsAre(6u));
}

TEST(Estimate, SwappedSensorsAreNamedAndExchanged) {
  for (const auto& [one, two] : {std::pair(0, 5), std::pair(1, 2), std::pair(4, 6)}) {
    Table table = Drawn(40);
    const double good_deg = Rms_deg(Of(table.rows), table);
    for (VoltageRow& row : table.rows)
      std::swap(row.voltages_V[static_cast<std::size_t>(one)],
                row.voltages_V[static_cast<std::size_t>(two)]);
    const Estimates estimates = Of(table.rows);
    ASSERT_EQ(estimates.verdicts.size(), 1u) << one << " " << two;
    EXPECT_EQ(estimates.verdicts[0].fault, SensorFault::kSwapped);
    EXPECT_THAT(
        estimates.verdicts[0].sensors,
        ::testing::ElementsAre(static_cast<std::size_t>(one), static_cast<std::size_t>(two)));
    EXPECT_NEAR(Rms_deg(estimates, table), good_deg, 1e-6);
  }
}

// The mirror image of 3 and 4 exchanged is 5 and 6 exchanged; another pair's is 1 and 2.
TEST(Estimate, SwapsThatAMirrorCannotTellAreSaidToBeSo) {
  Table table = Drawn(40);
  for (VoltageRow& row : table.rows) std::swap(row.voltages_V[2], row.voltages_V[3]);
  const Estimates estimates = Of(table.rows);
  ASSERT_EQ(estimates.verdicts.size(), 1u);
  EXPECT_EQ(estimates.verdicts[0].fault, SensorFault::kSwapped);
  std::vector<std::size_t> all = estimates.verdicts[0].sensors;
  all.insert(all.end(), estimates.verdicts[0].or_else.begin(), estimates.verdicts[0].or_else.end());
  EXPECT_THAT(all, ::testing::IsSupersetOf({2u, 3u, 4u, 5u}));
  EXPECT_THAT(estimates.rows[0].status, HasSubstr(" or v"));
}

TEST(Estimate, MissingAndSaturatedVoltagesAreSaidRowByRow) {
  Table table = Drawn(30);
  table.rows[3].voltages_V[1] = std::numeric_limits<double>::quiet_NaN();
  table.rows[4].voltages_V[7] = 5;
  table.rows[5].voltages_V.assign(8, std::numeric_limits<double>::quiet_NaN());
  for (VoltageRow& row : table.rows) row.voltages_V[4] = std::numeric_limits<double>::quiet_NaN();
  const Estimates estimates = Of(table.rows);
  EXPECT_THAT(estimates.rows[3].status, HasSubstr("missing v2 v5"));
  EXPECT_TRUE(estimates.rows[3].solved);
  EXPECT_THAT(estimates.rows[4].status, HasSubstr("saturated v8"));
  EXPECT_THAT(estimates.rows[5].status, HasSubstr("too few sensors"));
  EXPECT_FALSE(estimates.rows[5].solved);
  ASSERT_EQ(estimates.verdicts.size(), 1u);
  EXPECT_EQ(estimates.verdicts[0].fault, SensorFault::kMissing);
}

TEST(Estimate, OneBadVoltageOfOneRowIsNamedOrSaidToBeUnclear) {
  Table table = Drawn(60);
  table.rows[7].voltages_V[5] += 0.6;
  const Estimates estimates = Of(table.rows);
  EXPECT_TRUE(estimates.rows[7].status.find("bad v6") != std::string::npos ||
              estimates.rows[7].status == "cannot tell")
      << estimates.rows[7].status;
  EXPECT_EQ(estimates.rows[8].status, "ok");
}

TEST(Estimate, VoltagesBeyondTheSupplyAreNotClipped) {
  Table table = Drawn(30);
  for (VoltageRow& row : table.rows)
    for (double& voltage_V : row.voltages_V) voltage_V = 2.5 + 1.6 * (voltage_V - 2.5);
  const Estimates estimates =
      EstimateOrientations({}, MakeField(SurfaceParameters{.amplitude_T = 0.128}), table.rows, {});
  EXPECT_TRUE(estimates.beyond_supply);
  for (const RowEstimate& row : estimates.rows) EXPECT_EQ(row.status, "ok");
}

TEST(Estimate, LostSignsAreAmbiguous) {
  Table table = Drawn(25);
  for (VoltageRow& row : table.rows)
    for (double& voltage_V : row.voltages_V) voltage_V = std::abs(voltage_V - 2.5);
  const Estimates estimates = Of(table.rows, true);
  std::size_t ambiguous = 0;
  for (const RowEstimate& row : estimates.rows) ambiguous += row.branches > 1 ? 1u : 0u;
  EXPECT_GE(ambiguous, 22u);
}

}  // namespace
}  // namespace focalfleet::sim
