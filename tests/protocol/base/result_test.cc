#include "protocol/base/result.h"

#include <gtest/gtest.h>

#include <memory>

#include "protocol/base/check.h"

namespace focalfleet {
namespace {

Result<int> Positive(int value) {
  if (value <= 0) return Fail(ErrorCode::kInvalid, "not positive");
  return value;
}
Status Even(int value) {
  if (value % 2 != 0) return Fail(ErrorCode::kRefused, "odd");
  return {};
}
Result<int> HalfOfSum(int a, int b) {
  FOCALFLEET_TRY_ASSIGN(const int first, Positive(a));
  FOCALFLEET_TRY_ASSIGN(const int second, Positive(b));
  FOCALFLEET_TRY(Even(first + second));
  return (first + second) / 2;
}
Result<std::unique_ptr<int>> Owned() { return std::make_unique<int>(5); }
Result<int> Moved() {
  FOCALFLEET_TRY_ASSIGN(auto owned, Owned());
  return *owned;
}

TEST(Result, TryReturnsTheFirstError) {
  EXPECT_EQ(HalfOfSum(2, 4).value(), 3);
  EXPECT_EQ(HalfOfSum(0, 4).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(HalfOfSum(2, 3).error().code, ErrorCode::kRefused);
  EXPECT_EQ(HalfOfSum(2, 3).error().text, "odd");
}

TEST(Result, TryMovesTheValueOut) { EXPECT_EQ(Moved().value(), 5); }

TEST(CheckDeathTest, PrintsWhatWasBelievedAndAborts) {
  EXPECT_DEATH(FOCALFLEET_CHECK(1 + 1 == 3), "result_test.cc:.*check failed: 1 \\+ 1 == 3");
}

}  // namespace
}  // namespace focalfleet
