// Every reader is total. Good files with bytes changed, cut, doubled and swapped, and plain noise,
// give a value or an Error that names the file. A value that a reader accepts is written by its
// writer and read again.
#include <gtest/gtest.h>

#include <functional>

#include "fleet/files/fiducials_file.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/obstacles_file.h"
#include "fleet/files/plan_file.h"
#include "fleet/files/spots_file.h"
#include "fleet/files/state_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/hex_layout.h"
#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

std::string Mutated(std::string text, Rng& rng) {
  using namespace std::string_view_literals;
  constexpr std::string_view kSpice = ",\"\n\r#.-+e0123456789 nan\t\0\xff;inf"sv;
  for (std::uint64_t k = 1 + rng.Below(4); k > 0 && !text.empty(); --k) {
    const std::size_t at = rng.Below(text.size());
    const std::size_t length = std::min<std::size_t>(rng.Below(12), text.size() - at);
    switch (rng.Below(6)) {
      case 0:
        text[at] = static_cast<char>(rng.Below(256));
        break;
      case 1:
        text[at] = kSpice[rng.Below(kSpice.size())];
        break;
      case 2:
        text.erase(at, length);
        break;
      case 3:
        text.insert(at, text.substr(at, length));
        break;
      case 4:
        text.resize(at);
        break;
      default:
        std::swap(text[at], text[rng.Below(text.size())]);
        break;
    }
  }
  return text;
}

std::string Noise(Rng& rng) {
  std::string text(rng.Below(200), '\0');
  for (char& c : text) c = static_cast<char>(rng.Below(256));
  return text;
}

// Reads a text. Returns the error's text, empty where there was none.
using Reader = std::function<std::string(const std::string&)>;

template <class T>
std::string ErrorText(const Result<T>& result) {
  return result ? std::string() : result.error().text;
}

void ExpectTotal(const std::string& good, std::uint64_t seed, const Reader& read) {
  FOCALFLEET_TRACE_SEED(seed);
  ASSERT_EQ(read(good), "");
  Rng rng(seed);
  for (int k = 0; k < 4000; ++k) {
    const std::string text = k % 10 == 0 ? Noise(rng) : Mutated(good, rng);
    const std::string error = read(text);
    EXPECT_TRUE(error.empty() || error.starts_with("file.csv:")) << error << "\n" << text;
  }
}

TEST(CsvMutation, UnitsReaderIsTotal) {
  auto units = MakeHexLayout({.count = 7});
  units[1].enabled = false;
  units[2].rail_slot = 3;
  ExpectTotal(WriteUnits(units), test::TestSeed(1), [](const std::string& text) {
    if (const auto file = ReadUnits(text, "file.csv")) {
      const auto again = ReadUnits(WriteUnits(file->units), "again");
      EXPECT_TRUE(again) << again.error().text << "\n" << text;
    }
    return ErrorText(ReadLayout(text, "file.csv", {}));
  });
}

TEST(CsvMutation, TargetsReaderIsTotalAndSoIsResolving) {
  const auto layout = Layout::Create(MakeHexLayout({.count = 7}), {});
  const std::vector<UnitDrive> drives(7);
  ExpectTotal(
      "# night 1\nunit_id,x_mm,y_mm,theta_deg,phi_deg,target_id\n1,3.25,-2,,,\"a, b\"\n"
      "3,,,10.5,77,c\n",
      test::TestSeed(2), [&](const std::string& text) {
        const auto targets = ReadTargets(text, "file.csv");
        if (!targets) return targets.error().text;
        const auto again = ReadTargets(WriteTargets(*targets), "again");
        EXPECT_TRUE(again) << again.error().text << "\n" << text;
        return ErrorText(ResolveTargets(*targets, *layout, drives, {}));
      });
}

TEST(CsvMutation, StateReaderIsTotal) {
  const auto layout = Layout::Create(MakeHexLayout({.count = 7}), {});
  const std::vector<UnitDrive> drives(7);
  ExpectTotal("unit_id,theta_deg,phi_deg\n1,-12.5,170\n7,100,90\n", test::TestSeed(3),
              [&](const std::string& text) {
                return ErrorText(ReadState(text, "file.csv", *layout, drives));
              });
}

TEST(CsvMutation, ObstaclesReaderIsTotal) {
  ExpectTotal("obstacle_id,x_mm,y_mm,radius_mm\n1,-12.5,170,3\n7,100,90,0.5\n", test::TestSeed(4),
              [](const std::string& text) { return ErrorText(ReadObstacles(text, "file.csv")); });
}

TEST(CsvMutation, PlanReaderIsTotal) {
  ExpectTotal(
      "unit_id,axis,t0_s,t1_s,from_deg,to_deg,mode,power_W\n"
      "1,theta,0,1,0,5,asymmetric,0.1\n1,theta,1.5,2,5,4,seven_segment,0.1\n",
      test::TestSeed(5), [](const std::string& text) {
        const auto rows = ReadPlan(text, "file.csv");
        if (rows) {
          EXPECT_TRUE(ReadPlan(WritePlan(*rows), "again")) << text;
        }
        return ErrorText(rows);
      });
}

TEST(CsvMutation, SpotsReaderIsTotal) {
  ExpectTotal(
      "# exposure_id: a 1\n# taken_utc: 2026-11-22T03:04:05.678Z\n"
      "spot_id,x_px,y_px,flux,fwhm_px\n1,10.5,20,1.5,2.2\n9,1,2,3,\n",
      test::TestSeed(7), [](const std::string& text) {
        const SensorLimits sensor{100, 100};
        const auto exposure = ReadSpots(text, "file.csv", sensor);
        if (!exposure) return exposure.error().text;
        const auto again = ReadSpots(WriteSpots(*exposure), "again", sensor);
        EXPECT_TRUE(again) << again.error().text << "\n" << text;
        return std::string();
      });
}

TEST(CsvMutation, FiducialsReaderIsTotal) {
  ExpectTotal("fiducial_id,x_mm,y_mm\n1,0,0\n2,-5.25,0\n3,1e2,7\n", test::TestSeed(8),
              [](const std::string& text) {
                const auto fiducials = ReadFiducials(text, "file.csv");
                if (!fiducials) return fiducials.error().text;
                const auto again = ReadFiducials(WriteFiducials(*fiducials), "again");
                EXPECT_TRUE(again) << again.error().text << "\n" << text;
                return std::string();
              });
}

}  // namespace
}  // namespace focalfleet
