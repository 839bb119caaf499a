#include <gtest/gtest.h>

#include <set>
#include <string>

#include "protocol/link/frame_port.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/messages.h"

namespace focalfleet {
namespace {

// Names go into files, rows and answers. Each enumerator therefore has its own, in lower case with
// underscores.
template <class Enumeration>
void ExpectGoodNames(std::uint32_t count) {
  std::set<std::string> seen;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::string name = Name(static_cast<Enumeration>(i));
    EXPECT_FALSE(name.empty());
    EXPECT_EQ(name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_"), std::string::npos)
        << name;
    EXPECT_TRUE(seen.insert(name).second) << name << " twice";
  }
}

TEST(Names, AreDistinctAndPlain) {
  ExpectGoodNames<UnitState>(kUnitStateCount);
  ExpectGoodNames<FaultCode>(kFaultCodeCount);
  ExpectGoodNames<Outcome>(kOutcomeCount);
  ExpectGoodNames<Answer>(kAnswerCount);
  ExpectGoodNames<Parameter>(kParameterCount);
  ExpectGoodNames<Malformed>(7);
  ExpectGoodNames<Function>(kFunctionCount);
  ExpectGoodNames<WaveMode>(3);
  ExpectGoodNames<Axis>(2);
  ExpectGoodNames<LinkState>(4);
}

TEST(Names, StandForTheirEnumerators) {
  EXPECT_STREQ(Name(UnitState::kHostLost), "host_lost");
  EXPECT_STREQ(Name(FaultCode::kUnderVoltage), "under_voltage");
  EXPECT_STREQ(Name(Outcome::kHomed), "homed");
  EXPECT_STREQ(Name(Answer::kBegunBefore), "begun_before");
  EXPECT_STREQ(Name(Parameter::kHostTimeoutMs), "host_timeout_ms");
  EXPECT_STREQ(Name(Malformed::kReserved), "reserved");
  EXPECT_STREQ(Name(WaveMode::kSevenSegment), "seven_segment");
}

TEST(NamesDeathTest, AnEnumeratorWithoutANameIsABug) {
  EXPECT_DEATH(Name(static_cast<UnitState>(7)), "check failed");
}

}  // namespace
}  // namespace focalfleet
