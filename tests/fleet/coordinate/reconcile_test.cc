// Every combination of a report of the unit and rows of the store is tried against the rule in
// plain words: no place that is not certain, and never less than is certain.
#include "fleet/coordinate/reconcile.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

constexpr MoveId kOurs{7};
constexpr MoveId kEarlier{6};
constexpr Pose kFrom{100, 200};
constexpr Pose kTo{-300, 900};
constexpr Pose kElsewhere{41, 42};

UnitSays Unit(bool interrupted, MoveId last, Pose position) {
  UnitSays says{.status = {.interrupted = interrupted, .move = last}, .position = position};
  says.subdivision = {96, 96};
  return says;
}

VectorRow Stored(UnitKnowledge knowledge) {
  return {.knowledge = knowledge, .subdivision = {96, 96}};
}

IntentRow Intent() {
  IntentRow row{.move = kOurs, .from = kFrom, .to = kTo};
  row.hull = {AxisKnowledge{Witness::kInterval, -300, 150},
              AxisKnowledge{Witness::kInterval, 200, 950}};
  return row;
}

TEST(Reconcile, EveryCombinationIsTruthful) {
  for (int bits = 0; bits < 16; ++bits) {
    const bool interrupted = (bits & 1) != 0, began = (bits & 2) != 0;
    const bool intent = (bits & 4) != 0, restarted = (bits & 8) != 0;
    for (const Pose position : {kFrom, kTo, kElsewhere}) {
      StoreSays store{.vector = Stored(Exactly(Witness::kReported, kFrom))};
      if (intent) store.intent = Intent();
      UnitSays unit = Unit(interrupted, began ? kOurs : kEarlier, position);
      unit.status.restarted = restarted;
      const Reconciled result = Reconcile(unit, store);
      const bool place = IsPlace(result.knowledge);
      if (interrupted) {
        EXPECT_FALSE(place);
        EXPECT_EQ(result.knowledge[0].witness == Witness::kInterval, intent && began);
      } else if (intent && began) {
        // A unit that restarted may have lost its mark, and its count, with the power. Only the end
        // of its move is surely one that it wrote.
        EXPECT_EQ(place, position == kTo || !restarted);
      } else {
        EXPECT_EQ(place, position == kFrom);
      }
      if (place) {
        EXPECT_EQ(PlaceOf(result.knowledge), position);
      } else {
        EXPECT_STRNE(result.reason, "");
      }
      EXPECT_EQ(result.intent_end.has_value(), intent);
    }
  }
}

TEST(Reconcile, IntentEndsAsWhatHappened) {
  const StoreSays store{.vector = Stored(Exactly(Witness::kReported, kFrom)), .intent = Intent()};
  EXPECT_EQ(Reconcile(Unit(false, kOurs, kTo), store).intent_end, IntentEnd::kArrived);
  EXPECT_EQ(Reconcile(Unit(false, kOurs, kElsewhere), store).intent_end, IntentEnd::kStopped);
  EXPECT_EQ(Reconcile(Unit(false, kEarlier, kFrom), store).intent_end, IntentEnd::kNeverBegan);
  EXPECT_EQ(Reconcile(Unit(true, kOurs, kFrom), store).intent_end, IntentEnd::kInterrupted);
}

TEST(Reconcile, HomingThatDidNotEndAtItsStopLeavesNoPlace) {
  const StoreSays store{
      .vector = Stored(Exactly(Witness::kReported, kFrom)), .intent = Intent(), .homes = true};
  EXPECT_EQ(Reconcile(Unit(false, kOurs, kTo), store).knowledge, Exactly(Witness::kReported, kTo));
  const Reconciled cut = Reconcile(Unit(false, kOurs, kElsewhere), store);
  EXPECT_FALSE(IsPlace(cut.knowledge));
  EXPECT_EQ(cut.intent_end, IntentEnd::kStopped);
}

TEST(Reconcile, IntervalIsTheHullAndHalfAnElectricalTurn) {
  const StoreSays store{.vector = Stored(Exactly(Witness::kReported, kFrom)), .intent = Intent()};
  const auto knowledge = Reconcile(Unit(true, kOurs, kFrom), store).knowledge;
  EXPECT_EQ(knowledge[0], (AxisKnowledge{Witness::kInterval, -348, 198}));
  EXPECT_EQ(knowledge[1], (AxisKnowledge{Witness::kInterval, 152, 998}));
}

TEST(Reconcile, IntervalStaysUntilHomedWhateverFlashSays) {
  UnitKnowledge interval{AxisKnowledge{Witness::kInterval, 0, 500},
                         AxisKnowledge{Witness::kInterval, 3, 4}};
  const StoreSays store{.vector = Stored(interval)};
  for (const bool interrupted : {false, true})
    EXPECT_EQ(Reconcile(Unit(interrupted, kOurs, kTo), store).knowledge, interval);
}

TEST(Reconcile, MeasuredStaysMeasuredWhileNothingMoved) {
  const StoreSays store{.vector = Stored(Exactly(Witness::kMeasured, kFrom))};
  EXPECT_EQ(Reconcile(Unit(false, kEarlier, kFrom), store).knowledge[0].witness,
            Witness::kMeasured);
}

TEST(Reconcile, FirstContactIsReportedUnlessInterrupted) {
  EXPECT_EQ(Reconcile(Unit(false, {}, kTo), {}).knowledge, Exactly(Witness::kReported, kTo));
  EXPECT_FALSE(IsPlace(Reconcile(Unit(true, {}, kTo), {}).knowledge));
}

TEST(Reconcile, OtherSubdivisionIsUnknown) {
  UnitSays says = Unit(false, kEarlier, kFrom);
  says.subdivision = {96, 48};
  EXPECT_FALSE(
      IsPlace(Reconcile(says, {.vector = Stored(Exactly(Witness::kReported, kFrom))}).knowledge));
  // With a move open, too: counts of another subdivision are no place on its way.
  UnitSays moved = Unit(false, kOurs, kTo);
  moved.subdivision = {96, 48};
  const Reconciled result = Reconcile(moved, {.vector = Stored(Intent().hull), .intent = Intent()});
  EXPECT_EQ(result.knowledge, UnitKnowledge{});
  EXPECT_EQ(result.intent_end, IntentEnd::kInterrupted);
}

}  // namespace
}  // namespace focalfleet
