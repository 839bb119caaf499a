#include "protocol/base/instants.h"

#include <gtest/gtest.h>

#include <type_traits>

namespace focalfleet {
namespace {

template <class A, class B>
concept Addable = requires(A a, B b) {
  a + b;
};

TEST(Instants, DifferencesAreDurations) {
  const HostInstant t{1'000'000'000};
  EXPECT_EQ((t + Milliseconds(250)) - t, Milliseconds(250));
  EXPECT_EQ(t - Seconds(1.0), HostInstant{0});
  EXPECT_EQ(Milliseconds(3) * 4, Milliseconds(12));
  EXPECT_EQ(Milliseconds(3) - Microseconds(1), Microseconds(2999));
  EXPECT_DOUBLE_EQ(Milliseconds(1500).seconds(), 1.5);
}

TEST(Instants, TwoInstantsDoNotAdd) {
  static_assert(!Addable<HostInstant, HostInstant>);
  static_assert(!Addable<HostInstant, DeviceTicks>);
  static_assert(!std::is_convertible_v<std::int64_t, HostInstant>);
}

TEST(Instants, NeverIsLaterThanAnything) {
  EXPECT_GT(kNever, HostInstant{} + Seconds(9e9));
  EXPECT_EQ(kTick, Microseconds(100));
}

}  // namespace
}  // namespace focalfleet
