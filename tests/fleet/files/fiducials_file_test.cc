#include "fleet/files/fiducials_file.h"

#include <gtest/gtest.h>

#include <cmath>

#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

std::string ErrorOf(const std::string& rows) {
  const auto fiducials = ReadFiducials("fiducial_id,x_mm,y_mm\n1,0,0\n2,5,0\n" + rows, "f.csv");
  return fiducials ? "" : fiducials.error().text;
}

TEST(FiducialsFile, ReadsBackWhatItWrites) {
  const std::vector<Fiducial> fiducials = MakeHexPlate({.count = 500, .fiducials = 20}).fiducials;
  const auto again = ReadFiducials(WriteFiducials(fiducials), "f.csv");
  ASSERT_TRUE(again) << again.error().text;
  ASSERT_EQ(again->size(), 20u);
  for (std::size_t k = 0; k < 20; ++k) {
    EXPECT_EQ((*again)[k].id, fiducials[k].id);
    EXPECT_EQ((*again)[k].at_fp.x_mm, fiducials[k].at_fp.x_mm);
    EXPECT_EQ((*again)[k].at_fp.y_mm, fiducials[k].at_fp.y_mm);
  }
}

TEST(FiducialsFile, SaysWhereAndWhy) {
  EXPECT_EQ(ErrorOf(""), "f.csv: 2 fiducials are not 3 to 4096");
  EXPECT_EQ(ErrorOf("2,7,7\n"), "f.csv:4: fiducial 2: is there twice, first in line 3");
  EXPECT_EQ(ErrorOf("3,5,0\n"), "f.csv:4: fiducial 3: is where another one is, first in line 3");
  EXPECT_EQ(ErrorOf("3,5,\n").substr(0, 8), "f.csv:4:");
  EXPECT_EQ(ErrorOf("3,1e6,0\n"), "f.csv:4: column x_mm: 1e6 is not on any plate");
}

// ---- made fiducials

TEST(HexPlate, WithoutFiducialsIsTheHexLayout) {
  const auto plate = MakeHexPlate({.count = 300});
  EXPECT_TRUE(plate.fiducials.empty());
  EXPECT_EQ(plate.units.size(), 300u);
}

double NearestArm(const HexPlate& plate, const Layout& layout) {
  double nearest_mm = 1e9;
  for (const Fiducial& f : plate.fiducials)
    for (const Unit& unit : layout.units())
      nearest_mm = std::min(nearest_mm, std::hypot(f.at_fp.x_mm - unit.base_fp.x_mm,
                                                   f.at_fp.y_mm - unit.base_fp.y_mm) -
                                            unit.reach_mm());
  return nearest_mm;
}

TEST(HexPlate, NoArmReachesAFiducial) {
  for (const auto& options : {HexLayoutOptions{.count = 5000, .fiducials = 120},
                              HexLayoutOptions{.count = 61, .fiducials = 12}}) {
    const HexPlate plate = MakeHexPlate(options);
    const auto layout = Layout::Create(plate.units, {});
    ASSERT_TRUE(layout);
    EXPECT_EQ(layout->size(), options.count);
    EXPECT_EQ(plate.fiducials.size(), options.fiducials);
    EXPECT_GT(NearestArm(plate, *layout), 1 + layout->clearance_mm());
  }
  HexLayoutOptions dense = SdssLike(500);
  dense.fiducials = 30;
  const HexPlate plate = MakeHexPlate(dense);
  const auto layout = Layout::Create(plate.units, {});
  ASSERT_TRUE(layout);
  EXPECT_EQ(layout->size(), 500u);
  EXPECT_GT(NearestArm(plate, *layout), 1 + layout->clearance_mm());
}

TEST(HexPlate, NoTurnOrReflectionBringsTheFiducialsOntoThemselves) {
  const auto fiducials = MakeHexPlate({.count = 5000, .fiducials = 120}).fiducials;
  for (const bool mirrored : {false, true}) {
    for (int sixth = mirrored ? 0 : 1; sixth < 6; ++sixth) {
      const double turn = sixth * std::acos(-1.0) / 3;
      int met = 0;
      for (const Fiducial& f : fiducials) {
        const double y = mirrored ? -f.at_fp.y_mm : f.at_fp.y_mm;
        const double tx = f.at_fp.x_mm * std::cos(turn) - y * std::sin(turn);
        const double ty = f.at_fp.x_mm * std::sin(turn) + y * std::cos(turn);
        for (const Fiducial& g : fiducials)
          if (std::hypot(g.at_fp.x_mm - tx, g.at_fp.y_mm - ty) < 2) ++met;
      }
      EXPECT_LT(met, 30) << sixth << mirrored;
    }
  }
}

}  // namespace
}  // namespace focalfleet
