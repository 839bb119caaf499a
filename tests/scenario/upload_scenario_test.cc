// These tests compare an upload's duration on the simulated bit clock with the bits that it needs.
// They also check the coordinator's figures before and after.

#include <gtest/gtest.h>

#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/upload_on_wire.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::InProcessFleet;
using test::MeasureUpload;
using test::TestSeed;
using test::UploadOnWire;

/// The frames of the first upload of a random configuration, until the units move.
std::vector<sim::WireFrame> UploadOf(InProcessFleet* fleet, std::uint64_t seed) {
  fleet->Run(Milliseconds(2500));  // all units have been read
  std::vector<sim::WireFrame> wire;
  fleet->wire = &wire;
  fleet->ApplyRandom(seed);
  EXPECT_TRUE(fleet->RunUntil(
      [&] { return fleet->coordinator().configuration().state == ConfigurationState::kMoving; },
      Seconds(60)));
  fleet->wire = nullptr;
  return wire;
}

TEST(Upload, TakesHardlyLongerThanItsBits) {
  constexpr int kRuns = 10;
  double sum = 0;
  for (std::uint64_t k = 0; k < kRuns; ++k) {
    const std::uint64_t seed = TestSeed(1) + k;
    SCOPED_TRACE(seed);
    InProcessFleet fleet({.count = 100, .units_per_bus = 100, .seed = seed});
    const auto uploads = MeasureUpload(UploadOf(&fleet, seed));
    ASSERT_EQ(uploads.size(), 1u);
    const UploadOnWire& upload = uploads.begin()->second;
    EXPECT_EQ(upload.units, 100u);
    EXPECT_LE(upload.ratio(), 1.05);
    sum += upload.ratio();
  }
  // A guess of the answers' lengths alone would cost 0.018.
  EXPECT_LE(sum / kRuns, 1.005);
}

// The simulated bus carries classic frames; the charged and reported bits are those of groups.
TEST(Upload, WithCanFdIsChargedAsGroups) {
  for (const std::uint32_t data_bps : {2'000'000u, 5'000'000u}) {
    const std::uint64_t seed = TestSeed(3);
    SCOPED_TRACE(seed);
    const BusRates rates{1'000'000, data_bps};
    InProcessFleet fleet({.count = 40,
                          .units_per_bus = 40,
                          .seed = seed,
                          .config = {.data_bit_rate_bps = data_bps}});
    const auto uploads = MeasureUpload(UploadOf(&fleet, seed));
    ASSERT_EQ(uploads.size(), 1u);
    const auto& [bus, upload] = *uploads.begin();
    const auto needed = static_cast<double>(upload.needed_bits_with(rates));
    EXPECT_LT(needed, 0.85 * static_cast<double>(upload.needed_bits));
    const UploadView& said = fleet.coordinator().bus(bus).upload;
    // The order of the units, which is the plan's, decides which frames share a group.
    EXPECT_NEAR(static_cast<double>(said.bits_predicted), needed, 0.01 * needed);
    // Where the queue runs empty a group is not full: 5 % with so few units.
    EXPECT_NEAR(static_cast<double>(said.bits), needed, 0.10 * needed);
  }
}

TEST(Upload, IsPredictedToTheBit) {
  for (std::uint64_t k = 0; k < 5; ++k) {
    const std::uint64_t seed = TestSeed(1) + k;
    SCOPED_TRACE(seed);
    InProcessFleet fleet({.count = 91, .units_per_bus = 25, .seed = seed});
    const auto uploads = MeasureUpload(UploadOf(&fleet, seed));
    const ConfigurationView& said = fleet.coordinator().configuration();
    std::uint64_t bits = 0;
    double longest_s = 0;
    for (const auto& [bus, upload] : uploads) {
      const UploadView& of_bus = fleet.coordinator().bus(bus).upload;
      EXPECT_EQ(of_bus.bits_predicted, upload.needed_bits) << "bus " << bus.value;
      EXPECT_EQ(of_bus.bits, upload.needed_bits) << "bus " << bus.value;
      // The host hears of the last answer a turn of its loop later, and sends the first frame as
      // soon as it is decided.
      const double elapsed_s = static_cast<double>(upload.elapsed_bits) * 1e-6;
      EXPECT_GE(of_bus.measured_s, elapsed_s);
      EXPECT_LE(of_bus.measured_s, elapsed_s + 0.001);
      bits += upload.needed_bits;
      longest_s = std::max(longest_s, static_cast<double>(upload.needed_bits) * 1e-6);
    }
    EXPECT_EQ(said.upload.bits_predicted, bits);
    EXPECT_EQ(said.upload.bits, bits);
    EXPECT_NEAR(said.upload.predicted_s, longest_s, 1e-9);
    EXPECT_GE(said.upload.measured_s, longest_s);
  }
}

TEST(Upload, SaysWhatRepeatsCost) {
  const std::uint64_t seed = TestSeed(1);
  InProcessFleet fleet({.count = 40, .units_per_bus = 40, .seed = seed});
  fleet.Run(Milliseconds(2500));
  fleet.world().disturb().faults(fleet.layout().buses()[0])->drop = 0.02;
  fleet.ApplyRandom(seed);
  ASSERT_TRUE(fleet.RunUntil(
      [&] { return fleet.coordinator().configuration().state == ConfigurationState::kMoving; },
      Seconds(60)));
  const UploadView& upload = fleet.coordinator().configuration().upload;
  EXPECT_GT(upload.bits, upload.bits_predicted);
  EXPECT_GT(upload.measured_s, upload.predicted_s);
}

}  // namespace
}  // namespace focalfleet
