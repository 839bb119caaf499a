#include "fleet/coordinate/requests.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

TEST(Requests, RunsBeginWithNumbersApart) {
  constexpr int kNumbers = 254, kApartLeast = 99;
  constexpr std::uint32_t kBlocks = 65536 / limits::kMovesReserved;
  const auto at = [](std::uint32_t run) {
    const auto move = static_cast<std::uint16_t>(1 + run % kBlocks * limits::kMovesReserved);
    return static_cast<int>(SequenceBeforeRun(MoveId{move}));
  };
  for (std::uint32_t run = 0; run < kBlocks; ++run) {  // the last is followed by the first again
    EXPECT_LT(at(run), kNumbers);
    const int ahead = (at(run + 1) - at(run) + kNumbers) % kNumbers;
    EXPECT_GE(ahead, kApartLeast) << run;
    EXPECT_GE(kNumbers - ahead, kApartLeast) << run;
  }
}

}  // namespace
}  // namespace focalfleet
