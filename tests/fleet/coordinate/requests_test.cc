#include "fleet/coordinate/requests.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

TEST(Requests, RunsBeginWithNumbersApart) {
  constexpr int kNumbers = 254, kApartLeast = 100;
  for (std::uint32_t run = 0; run + 1 < 65536 / limits::kMovesReserved; ++run) {
    const auto at = [](std::uint32_t n) {
      const auto move = static_cast<std::uint16_t>(1 + n * limits::kMovesReserved);
      return static_cast<int>(SequenceBeforeRun(MoveId{move}));
    };
    EXPECT_LT(at(run), kNumbers);
    const int ahead = (at(run + 1) - at(run) + kNumbers) % kNumbers;
    EXPECT_GE(ahead, kApartLeast) << run;
    EXPECT_GE(kNumbers - ahead, kApartLeast) << run;
  }
}

}  // namespace
}  // namespace focalfleet
