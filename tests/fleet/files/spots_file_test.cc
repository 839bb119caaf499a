#include "fleet/files/spots_file.h"

#include <gtest/gtest.h>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

constexpr SensorLimits kSensor{1000, 800};

const std::string kHead = "# exposure_id: 20261122-0041\n# taken_utc: 2026-11-22T03:04:05.678Z\n";

std::string ErrorOf(const std::string& text) {
  const auto exposure = ReadSpots(text, "s.csv", kSensor);
  return exposure ? "" : exposure.error().text;
}

TEST(SpotsFile, ReadsAnExposure) {
  const auto exposure = ReadSpots("# by hand\n" + kHead +
                                      "spot_id,x_px,y_px,flux,fwhm_px\n"
                                      "7,10.5,20,1.5,2.2\n# a remark\n9,1,2,3,\n",
                                  "s.csv", kSensor);
  ASSERT_TRUE(exposure) << exposure.error().text;
  EXPECT_EQ(exposure->id, "20261122-0041");
  EXPECT_EQ(exposure->taken_unix_ns, 1'795'316'645'678'000'000);
  ASSERT_EQ(exposure->spots.size(), 2u);
  EXPECT_EQ(exposure->spots[0].id, 7u);
  EXPECT_EQ(exposure->spots[0].fwhm_px, 2.2);
  EXPECT_EQ(exposure->spots[1].fwhm_px, 0);
}

TEST(SpotsFile, OfTooManyLinesIsNotRead) {
  EXPECT_EQ(ErrorOf(kHead + std::string(300'000, '\n')),
            "s.csv: 300002 lines are more than 262144");
}

TEST(SpotsFile, ReadsBackWhatItWrites) {
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (const bool widths : {true, false}) {
    Exposure exposure{"night 3, field 4", 1'795'316'645'678'901'234, {}};
    for (std::uint32_t k = 0; k < 500; ++k)
      exposure.spots.push_back({k * 3, rng.Uniform(0, 999), rng.Uniform(0, 799),
                                rng.Uniform(0.1, 9), widths ? rng.Uniform(1, 3) : 0});
    const auto again = ReadSpots(WriteSpots(exposure), "s.csv", kSensor);
    ASSERT_TRUE(again) << again.error().text;
    EXPECT_EQ(again->id, exposure.id);
    EXPECT_EQ(again->taken_unix_ns, exposure.taken_unix_ns);
    ASSERT_EQ(again->spots.size(), exposure.spots.size());
    EXPECT_EQ(ContentOf(*again), ContentOf(exposure));
    for (std::size_t k = 0; k < again->spots.size(); ++k) {
      EXPECT_EQ(again->spots[k].id, exposure.spots[k].id);
      EXPECT_EQ(again->spots[k].fwhm_px, exposure.spots[k].fwhm_px);
    }
  }
}

TEST(SpotsFile, SaysWhereAndWhy) {
  const std::string table = "spot_id,x_px,y_px,flux\n1,1,1,1\n";
  EXPECT_EQ(ErrorOf(table), "s.csv: no line `# exposure_id: ...` before the table");
  EXPECT_EQ(ErrorOf("# exposure_id: a\n" + table),
            "s.csv: no line `# taken_utc: ...` before the table");
  EXPECT_EQ(ErrorOf("# exposure_id:\n# taken_utc: 2026-11-22T03:04:05Z\n" + table),
            "s.csv:1: exposure_id: is empty");
  EXPECT_EQ(ErrorOf("# exposure_id: a\n" + kHead + table),
            "s.csv:2: exposure_id: is there twice, first in line 1");
  EXPECT_EQ(ErrorOf("# exposure_id: a\n# taken_utc: yesterday\n" + table),
            "s.csv:2: taken_utc: not a time like 2026-11-22T03:04:05.678Z");
  EXPECT_EQ(ErrorOf(kHead + table + "1,2,2,1\n"),
            "s.csv:5: spot 1: is there twice, first in line 4");
  EXPECT_EQ(ErrorOf(kHead + table + "2,1000,2,1\n"),
            "s.csv:5: column x_px: 1000 is off the sensor");
  EXPECT_EQ(ErrorOf(kHead + table + "2,1,-3,1\n"), "s.csv:5: column y_px: -3 is off the sensor");
  EXPECT_EQ(ErrorOf(kHead + table + "2,2,2,0\n"), "s.csv:5: column flux: 0 is not above 0");
  EXPECT_EQ(ErrorOf(kHead + table + "2,nan,2,1\n").substr(0, 8), "s.csv:5:");
  EXPECT_EQ(ErrorOf(kHead + table + "2,1,1,5\n"), "s.csv: spots 1 and 2 are at one place");
  EXPECT_EQ(ErrorOf(kHead + "spot_id,x_px,flux\n").substr(0, 6), "s.csv:");
}

TEST(Utc, ReadsTheCalendar) {
  EXPECT_EQ(UnixNsOf("1970-01-01T00:00:00Z"), 0);
  EXPECT_EQ(UnixNsOf("2000-02-29T12:00:00"), 951'825'600'000'000'000);
  EXPECT_EQ(UnixNsOf("2100-03-01T00:00:00Z"), 4'107'542'400'000'000'000);
  EXPECT_EQ(UnixNsOf("2026-11-22T03:04:05.000000001Z"), 1'795'316'645'000'000'001);
  for (const char* wrong :
       {"", "2026-11-22", "2026-11-22T03:04", "2026-13-01T00:00:00Z", "2026-02-29T00:00:00Z",
        "2026-11-22T24:00:00Z", "2026-11-22T03:60:00Z", "2026-11-22T03:04:60Z",
        "2026-11-22T03:04:05.Z", "2026-11-22T03:04:05.1234567890Z", "2026-11-22T03:04:05+01:00",
        "2026-11-22T03:04:05ZZ", "1969-12-31T23:59:59Z", "2262-01-01T00:00:00Z",
        "+026-11-22T03:04:05Z", "2026-11-22 03:04:05Z"})
    EXPECT_FALSE(UnixNsOf(wrong)) << wrong;
}

TEST(Utc, ReadsBackWhatItWrites) {
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  EXPECT_EQ(UtcOf(0), "1970-01-01T00:00:00.000Z");
  for (int k = 0; k < 5000; ++k) {
    const auto ns = static_cast<std::int64_t>(rng.Below(9'200'000'000'000'000'000u));
    EXPECT_EQ(UnixNsOf(UtcOf(ns)), ns) << UtcOf(ns);
  }
}

}  // namespace
}  // namespace focalfleet
