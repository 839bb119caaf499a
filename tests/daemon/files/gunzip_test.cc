#include "daemon/files/gunzip.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <string>

#include "tests/support/gzip.h"

namespace focalfleet {
namespace {

using test::Gzipped;
using ::testing::HasSubstr;

std::string ErrorOf(const std::string& bytes, std::size_t bytes_max = 1 << 20) {
  const auto text = Gunzip(bytes, "x.csv.gz", bytes_max);
  return text ? "" : text.error().text;
}

TEST(Gunzip, UnpacksOneMemberOrSeveral) {
  EXPECT_EQ(*Gunzip(Gzipped("unit_id\n"), "x", 100), "unit_id\n");
  EXPECT_EQ(*Gunzip(Gzipped("unit_id\n") + Gzipped("") + Gzipped("1\n"), "x", 100), "unit_id\n1\n");
  EXPECT_EQ(*Gunzip(Gzipped("a") + std::string(512, '\0'), "x", 100), "a") << "padding";
  const std::string large(5'000'000, 'y');
  EXPECT_EQ(*Gunzip(Gzipped(large), "x", large.size()), large);
}

TEST(Gunzip, RefusesWhatIsCutOrDamaged) {
  const std::string good = Gzipped("unit_id,x_mm,y_mm\n1,2.5,3.5\n");
  EXPECT_EQ(ErrorOf(good), "");
  for (std::size_t size = 2; size < good.size(); ++size)
    EXPECT_EQ(ErrorOf(good.substr(0, size)), "x.csv.gz: its gzip stream is cut short") << size;
  std::string other_sum = good;
  other_sum[other_sum.size() - 6] ^= 1;
  EXPECT_EQ(ErrorOf(other_sum), "x.csv.gz: its gzip stream is damaged");
  EXPECT_EQ(ErrorOf("unit_id\n"), "x.csv.gz: its gzip stream is damaged");
  EXPECT_EQ(ErrorOf(good + good.substr(0, 9)), "x.csv.gz: its gzip stream is cut short");
}

TEST(Gunzip, StopsAtItsLimitHoweverMuchThereWere) {
  std::string bomb = Gzipped(std::string(20'000'000, '\0'));
  EXPECT_LT(bomb.size(), 100'000u);
  EXPECT_EQ(ErrorOf(bomb), "x.csv.gz: unpacked it is too large");
  std::string many;
  for (int k = 0; k < 100; ++k) many += Gzipped(std::string(20'000, 'x'));
  EXPECT_EQ(ErrorOf(many), "x.csv.gz: unpacked it is too large");
}

}  // namespace
}  // namespace focalfleet
