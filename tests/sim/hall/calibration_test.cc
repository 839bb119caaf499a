// Sensors are calibrated from poses of an independent plant. Numbers lie within their standard
// deviations, and sensors that cannot be calibrated are reported.
#include "sim/hall/diagnosis/calibration.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "tests/sim/hall/planted_rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

constexpr double kAmplitude_T = 0.08;

HallCampaign Read(const test::PlantedCampaign& planted) {
  HallCampaign campaign;
  for (const auto& pose : planted.poses) {
    campaign.poses.push_back(
        {pose.alpha_deg * kRadPerDeg, pose.beta_deg * kRadPerDeg, pose.gamma_deg * kRadPerDeg});
    campaign.rows.push_back({pose.volts});
  }
  return campaign;
}

test::PlantedCampaign Plant(const test::CampaignPlan& plan, const test::Planted& first) {
  const auto law = test::OfSurface(kAmplitude_T, 21);
  return test::MakeCampaign(plan, law, law, first);
}

std::vector<SensorFit> Calibrated(const HallCampaign& campaign) {
  return CalibrateSensors(campaign, {}, *MakeField(SurfaceParameters{.amplitude_T = kAmplitude_T}));
}

// The planted numbers lie within the reported standard deviations, and these are no larger than
// needed.
TEST(HallCalibration, NumbersLieWithinTheirDeviations) {
  double squares = 0, count = 0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const auto campaign = Plant(
        {.rows = 120, .also = {{"sensor_offset", -0.04, 2}}, .seed = test::TestSeed(100 + seed)},
        {"sensor_gain", 0.05, 5});
    const auto fits = Calibrated(Read(campaign));
    for (std::size_t s = 0; s < fits.size(); ++s) {
      ASSERT_EQ(fits[s].status, CalibrationStatus::kOk) << s;
      const double gain = s == 5 ? 1.05 : 1, offset_V = s == 2 ? -0.04 : 0;
      for (const double pull : {(fits[s].sensor.gain - gain) / fits[s].sd_gain,
                                (fits[s].sensor.offset_V - offset_V) / fits[s].sd_offset_V,
                                fits[s].shift.east_rad / fits[s].sd_east_rad,
                                fits[s].shift.north_rad / fits[s].sd_north_rad}) {
        EXPECT_LT(std::abs(pull), 5) << s;
        squares += pull * pull;
        count += 1;
      }
    }
  }
  EXPECT_NEAR(std::sqrt(squares / count), 1, 0.12);
}

TEST(HallCalibration, FindsAPlaceAndLeavesTheRestAlone) {
  const auto fits = Calibrated(
      Read(Plant({.noise_T = 1e-4, .seed = test::TestSeed(8)}, {"sensor_position", 2, 3})));
  for (std::size_t s = 0; s < fits.size(); ++s) {
    const double moved_deg =
        std::hypot(fits[s].shift.east_rad, fits[s].shift.north_rad) / kRadPerDeg;
    EXPECT_NEAR(moved_deg, s == 3 ? 2 : 0, 0.25) << s;
    EXPECT_NEAR(fits[s].rms_after_V, 2.5e-3, 4e-4);
    EXPECT_LT(fits[s].rms_held_out_V, 1.15 * fits[s].rms_after_V);
  }
  EXPECT_GT(fits[3].rms_before_V, 4 * fits[3].rms_after_V);
}

TEST(HallCalibration, LeavesOutReadingsThatAreAccidents) {
  const auto campaign =
      Plant({.dirty = true, .seed = test::TestSeed(9)}, {"sensor_gain", -0.03, 0});
  const auto fits = Calibrated(Read(campaign));
  std::size_t far_off = 0, missing = 0;
  for (std::size_t s = 0; s < fits.size(); ++s) {
    ASSERT_EQ(fits[s].status, CalibrationStatus::kOk) << s;
    EXPECT_NEAR(fits[s].sensor.gain, s == 0 ? 0.97 : 1, 5 * fits[s].sd_gain) << s;
    far_off += fits[s].far_off;
    missing += fits[s].missing;
  }
  EXPECT_GE(far_off, 5u);
  EXPECT_GE(missing, 3u);
}

TEST(HallCalibration, SaysWhoCannotBeCalibrated) {
  HallCampaign campaign = Read(Plant({.seed = test::TestSeed(10)}, {}));
  for (std::size_t row = 0; row < campaign.rows.size(); ++row) {
    std::vector<double>& volts = campaign.rows[row].voltages_V;
    volts[0] = std::nan("");
    volts[2] = 3.1 + (row % 2 == 0 ? 1e-3 : -1e-3);
    volts[7] = std::clamp(volts[7] + 0.5 * (volts[3] - 2.5) * (volts[5] - 2.5), 0.1, 4.9);
    if (row >= 8) volts[6] = 5;  // the end of the range
  }
  const auto fits = Calibrated(campaign);
  EXPECT_EQ(fits[0].status, CalibrationStatus::kMissing);
  EXPECT_EQ(fits[2].status, CalibrationStatus::kStuck);
  EXPECT_EQ(fits[7].status, CalibrationStatus::kContradicts);
  EXPECT_EQ(fits[6].status, CalibrationStatus::kFew);
  EXPECT_EQ(fits[6].saturated, campaign.rows.size() - 8);
  for (const std::size_t healthy : {1u, 3u, 4u, 5u})
    EXPECT_EQ(fits[healthy].status, CalibrationStatus::kOk) << healthy;
  EXPECT_EQ(fits[7].sensor.gain, 1) << "as it was given";
}

TEST(HallCalibration, ExchangedSensorsAreFoundInEachOthersPlaces) {
  HallCampaign campaign = Read(Plant({.noise_T = 1e-4, .seed = test::TestSeed(12)}, {}));
  for (VoltageRow& row : campaign.rows) std::swap(row.voltages_V[4], row.voltages_V[7]);
  const auto fits = Calibrated(campaign);
  const HallRig rig;
  for (const auto& [one, other] : {std::pair{4u, 7u}, {7u, 4u}}) {
    ASSERT_EQ(fits[one].status, CalibrationStatus::kOk);
    const Vector3 apart = fits[one].sensor.direction - rig.sensors[other].direction;
    EXPECT_LT(Length(apart), 0.2 * kRadPerDeg);
  }
}

TEST(HallCalibration, PosesThatDoNotTiltTellNoPlaces) {
  const auto fits = Calibrated(Read(Plant({.tilt_deg = 0, .seed = test::TestSeed(11)}, {})));
  for (const SensorFit& fit : fits) EXPECT_EQ(fit.status, CalibrationStatus::kUndetermined);
}

}  // namespace
}  // namespace focalfleet::sim
