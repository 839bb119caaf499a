// The way onto the wire: how long an upload takes on the simulated bit clock, beside the bits that
// it needs, and what the coordinator says of it before and after.

#include <gtest/gtest.h>

#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/upload_measure.h"

namespace focalfleet::testing {
namespace {

TEST(Upload, FillsItsBusUpToAFewHundredths) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    InProcessFleet fleet({.count = 100, .units_per_bus = 100, .seed = seed});
    fleet.Run(Milliseconds(2500));  // everybody has been read
    std::vector<sim::WireFrame> wire;
    fleet.ApplyRandom(seed);
    fleet.wire = &wire;
    ASSERT_TRUE(fleet.RunUntil(
        [&] {
          return fleet.coordinator().configuration().state == ConfigurationState::kMoving;
        },
        Seconds(60)));
    const auto uploads = MeasureUpload(wire);
    ASSERT_EQ(uploads.size(), 1u);
    const UploadOnWire& upload = uploads.begin()->second;
    std::printf("seed %d: %u units, %u segments, %u frames, needed %llu bits, other %llu, elapsed %llu, ratio %.4f\n",
      static_cast<int>(seed), upload.units, upload.segments, upload.frames, static_cast<unsigned long long>(upload.needed_bits),
      static_cast<unsigned long long>(upload.other_bits), static_cast<unsigned long long>(upload.elapsed_bits), upload.ratio());
    EXPECT_LE(upload.ratio(), 1.05);
  }
}

}  // namespace
}  // namespace focalfleet::testing
