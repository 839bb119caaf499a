#include "daemon/report/pack.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "tests/daemon/report/unpack.h"

namespace focalfleet::report {
namespace {

using test::UnpackBits;

std::string Encoded(const std::string& text) {
  return Base64(std::vector<std::uint8_t>(text.begin(), text.end()));
}

TEST(Base64, GivesTheVectorsOfItsStandard) {  // RFC 4648, section 10
  EXPECT_EQ(Encoded(""), "");
  EXPECT_EQ(Encoded("f"), "Zg==");
  EXPECT_EQ(Encoded("fo"), "Zm8=");
  EXPECT_EQ(Encoded("foo"), "Zm9v");
  EXPECT_EQ(Encoded("foob"), "Zm9vYg==");
  EXPECT_EQ(Encoded("fooba"), "Zm9vYmE=");
  EXPECT_EQ(Encoded("foobar"), "Zm9vYmFy");
  EXPECT_EQ(Encoded("\xFB\xFF\xBF"), "+/+/");
}

void ExpectBack(const std::vector<double>& column) {
  const auto bits = UnpackBits(PackColumn(column), column.size());
  ASSERT_EQ(bits.size(), column.size());
  for (std::size_t k = 0; k < column.size(); ++k) {
    ASSERT_EQ(bits[k], std::bit_cast<std::uint64_t>(column[k])) << k << " of " << column.size();
  }
}

TEST(PackColumn, GivesBackEveryBit) {
  using Limits = std::numeric_limits<double>;
  ExpectBack({0.1});
  ExpectBack({0.0, -0.0, Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(),
              Limits::denorm_min(), Limits::max(), 1.0 / 3});
}

TEST(PackColumn, GivesBackColumnsAroundEachFormsEnd) {
  for (const std::size_t distinct : {1u, 2u, 255u, 256u, 257u, 65'535u, 65'536u, 65'537u}) {
    for (const std::size_t repeats : {1u, 3u}) {
      std::vector<double> column;
      column.reserve(distinct * repeats);
      for (std::size_t k = 0; k < distinct * repeats; ++k) {
        column.push_back(0.1 * static_cast<double>(k % distinct));
      }
      ExpectBack(column);
    }
  }
  EXPECT_TRUE(UnpackBits(PackColumn({}), 0).empty());
}

TEST(PackColumn, StoresOnceWhatRepeats) {
  const auto constant = PackColumn(std::vector<double>(5000, 8.25));
  EXPECT_EQ(constant.dump().size(), std::string(R"({"values":"AAAAAACAIEA="})").size());
  std::vector<double> few;
  few.reserve(5000);
  for (int k = 0; k < 5000; ++k) few.push_back(k % 10);
  EXPECT_LT(PackColumn(few).dump().size(), 7000u) << "a byte each, in base64";
}

}  // namespace
}  // namespace focalfleet::report
