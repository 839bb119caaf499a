#include "protocol/base/rng.h"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <vector>

namespace focalfleet {
namespace {

// A second implementation of xoshiro256** and splitmix64, after their authors' C programs. This
// implementation is checked against their published outputs, and the class under test against it.
struct Xoshiro {
  std::array<std::uint64_t, 4> s;
  std::uint64_t Next() {
    const auto rotate = [](std::uint64_t x, int k) { return x << k | x >> (64 - k); };
    const std::uint64_t result = rotate(s[1] * 5, 7) * 9;
    const std::uint64_t t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotate(s[3], 45);
    return result;
  }
};
struct SplitMix {
  std::uint64_t x;
  std::uint64_t Next() {
    std::uint64_t z = x += 0x9e3779b97f4a7c15;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return z ^ z >> 31;
  }
};

TEST(Rng, TheOraclesGiveThePublishedNumbers) {
  Xoshiro xoshiro{{1, 2, 3, 4}};
  for (const std::uint64_t expected :
       {11520ull, 0ull, 1509978240ull, 1215971899390074240ull, 1216172134540287360ull,
        607988272756665600ull, 16172922978634559625ull, 8476171486693032832ull})
    EXPECT_EQ(xoshiro.Next(), expected);
  SplitMix split{1234567};
  for (const std::uint64_t expected : {6457827717110365317ull, 3203168211198807973ull,
                                       9817491932198370423ull, 4593380528125082431ull})
    EXPECT_EQ(split.Next(), expected);
}

TEST(Rng, IsXoshiroSeededBySplitMix) {
  for (const std::uint64_t seed : {0ull, 1ull, 4711ull, ~0ull}) {
    SplitMix split{seed};
    Xoshiro oracle{};
    for (auto& word : oracle.s) word = split.Next();
    Rng rng(seed);
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(rng.Bits(), oracle.Next());
  }
}

// These stored numbers must never change: a stored configuration, a scenario's seed and a bug
// report all rest on them. They came from gcc 12 and clang 14 alike.
TEST(Rng, StreamsGiveTheStoredNumbers) {
  Rng rng = Rng::Stream(1, "targets", 0);
  EXPECT_EQ(rng.Bits(), 16874408451438560316ull);
  Rng other = Rng::Stream(7, "faults", 4999);
  EXPECT_EQ(other.Bits(), 613602609385287071ull);
}

TEST(Rng, StreamsOfDifferentKeysDiffer) {
  std::set<std::uint64_t> first;
  for (std::uint64_t seed = 0; seed < 20; ++seed)
    for (const char* purpose : {"", "a", "b", "ab"})
      for (std::uint64_t index = 0; index < 20; ++index)
        first.insert(Rng::Stream(seed, purpose, index).Bits());
  EXPECT_EQ(first.size(), 20u * 4 * 20);
}

TEST(Rng, BelowHasNoModuloBias) {
  // For n = 3 * 2^62, a plain remainder of 64 bits would give the lowest third half of all draws.
  Rng rng(3);
  const std::uint64_t third = 1ull << 62;
  std::array<int, 3> count{};
  for (int i = 0; i < 30'000; ++i) ++count[rng.Below(3 * third) / third];
  // The expected count is 10000 +- 82 (one sigma); the bounds are six sigma.
  for (const int c : count) EXPECT_NEAR(c, 10'000, 500);
}

TEST(Rng, BelowCoversSmallRangesEvenly) {
  Rng rng(4);
  for (std::uint64_t n = 1; n <= 17; ++n) {
    std::vector<int> count(n);
    for (std::uint64_t i = 0; i < 1000 * n; ++i) ++count[rng.Below(n)];
    for (const int c : count) EXPECT_NEAR(c, 1000, 200);  // more than six sigma
  }
}

TEST(Rng, UniformLiesInItsRangeWithTheRightMoments) {
  Rng rng(5);
  double sum = 0;
  double squares = 0;
  const int n = 100'000;
  for (int i = 0; i < n; ++i) {
    const double u = rng.Uniform();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    sum += u;
    squares += u * u;
    const double v = rng.Uniform(-3, 5);
    ASSERT_GE(v, -3.0);
    ASSERT_LT(v, 5.0);
  }
  EXPECT_NEAR(sum / n, 0.5, 6 * 0.2887 / 316);
  EXPECT_NEAR(squares / n, 1.0 / 3, 0.006);
}

TEST(Rng, NormalHasTheRightMoments) {
  Rng rng(6);
  double sum = 0;
  double squares = 0;
  double fourth = 0;
  const int n = 100'000;
  for (int i = 0; i < n; ++i) {
    const double x = rng.Normal();
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
  }
  EXPECT_NEAR(sum / n, 0, 0.02);
  EXPECT_NEAR(squares / n, 1, 0.03);
  EXPECT_NEAR(fourth / n, 3, 0.2);
}

}  // namespace
}  // namespace focalfleet
