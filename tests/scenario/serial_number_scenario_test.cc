// Units with a serial number that is foreign, missing, doubled or exchanged, on the in-process
// fleet.
#include <gtest/gtest.h>

#include <string>

#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"

namespace focalfleet {
namespace {

using test::CountOutcome;
using test::HasAlarm;
using test::InProcessFleet;
using test::Small;

TEST(Configuration, ForeignHardwareIsNotMovedUntilAdopted) {
  InProcessFleet fleet(Small(26));
  fleet.ApplyRandom(26);
  ASSERT_TRUE(fleet.RunUntilIdle());
  fleet.world().disturb().faults(fleet.id(2))->foreign_serial = SerialNumber{99'999};
  fleet.Restart();
  fleet.ApplyRandom(27);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({2}).phase, UnitPhase::kForeign);
  EXPECT_EQ(fleet.coordinator().unit({2}).outcome, TargetOutcome::kFailed);
  EXPECT_EQ(fleet.coordinator().unit({2}).knowledge[0].witness, Witness::kUnknown);
  EXPECT_EQ(fleet.world().Truth(std::size_t{2}).moves_begun, 1u);
  fleet.Send({901, AdoptCommand{{2}}});
  fleet.Run(Seconds(2));
  EXPECT_EQ(fleet.coordinator().unit({2}).phase, UnitPhase::kReady);
  fleet.ApplyRandom(27);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), 37u);
}

TEST(Configuration, AUnitWithoutASerialNumberHoldsUpNobody) {
  for (const bool from_the_start : {true, false}) {
    InProcessFleet fleet(Small(44));
    if (!from_the_start) fleet.Run(Seconds(3));
    fleet.world().disturb().faults(fleet.id(5))->foreign_serial = SerialNumber{0};
    fleet.Restart();
    fleet.ApplyRandom(44);
    ASSERT_TRUE(fleet.RunUntilIdle()) << "a batch that the store refuses holds up all others";
    EXPECT_GE(CountOutcome(fleet, TargetOutcome::kArrived), 37u - 7u);
    EXPECT_EQ(fleet.coordinator().unit({5}).outcome, TargetOutcome::kFailed);
    EXPECT_NE(fleet.coordinator().unit({5}).outcome_reason.find("serial number 0"),
              std::string::npos);
    EXPECT_EQ(fleet.world().Truth(std::size_t{5}).moves_begun, 0u);
    EXPECT_TRUE(HasAlarm(fleet, "unit 6 answers with serial number 0"));
    // Programmed again, the unit is like the others.
    fleet.world().disturb().faults(fleet.id(5))->foreign_serial.reset();
    fleet.Run(Seconds(5));
    EXPECT_EQ(fleet.coordinator().unit({5}).phase, UnitPhase::kReady);
  }
}

TEST(Configuration, ASerialNumberThatAnswersElsewhereIsNotAdopted) {
  InProcessFleet fleet(Small(50));
  fleet.Run(Seconds(3));
  const SerialNumber eight = fleet.coordinator().unit({8}).serial;
  fleet.world().disturb().faults(fleet.id(7))->foreign_serial = eight;
  fleet.Restart();
  fleet.Run(Seconds(3));
  fleet.Send({900, AdoptCommand{{7}}});
  fleet.Run(Seconds(2));
  ASSERT_TRUE(fleet.LastReply(900));
  ASSERT_TRUE(fleet.LastReply(900)->error);
  EXPECT_NE(fleet.LastReply(900)->error->text.find("answers with serial number"),
            std::string::npos);
  EXPECT_EQ(fleet.coordinator().unit({8}).bound_serial, eight);
}

TEST(Configuration, ExchangedCablesAreNamed) {
  InProcessFleet fleet(Small(47));
  fleet.ApplyRandom(47);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const SerialNumber seven = fleet.coordinator().unit({7}).serial;
  const SerialNumber eight = fleet.coordinator().unit({8}).serial;
  fleet.world().disturb().faults(fleet.id(7))->foreign_serial = eight;
  fleet.world().disturb().faults(fleet.id(8))->foreign_serial = seven;
  fleet.Restart();
  fleet.Run(Seconds(3));
  EXPECT_TRUE(HasAlarm(fleet, "which belongs to unit 9"));
  EXPECT_TRUE(HasAlarm(fleet, "are exchanged"));
  fleet.Send({900, AdoptCommand{{7}}});
  fleet.Send({901, AdoptCommand{{8}}});
  fleet.Run(Seconds(2));
  EXPECT_EQ(fleet.coordinator().unit({7}).bound_serial, eight);
  EXPECT_EQ(fleet.coordinator().unit({8}).bound_serial, seven);
}

}  // namespace
}  // namespace focalfleet
