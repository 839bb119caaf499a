// These tests cover known problems of earlier fleets other than wrong answers
// (wrong_answers_test.cc). They are dead links, ends and restarts of the host, stops, disabled
// units, and checks before frames are sent. The page docs/peers.md names each problem beside its
// test.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fleet/kinematics.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/staged_move.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"
#include "tests/support/plan_checker.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::CheckedRow;
using test::CheckedUnit;
using test::CheckPlan;
using test::CheckReport;
using test::CountOutcome;
using test::ExpectOthersArrive;
using test::ExpectStoreTellsTheTruth;
using test::HasAlarm;
using test::InProcessFleet;
using test::StopDirectly;
using test::TruePoses;
using test::Unserved;

bool RunUntilUploading(InProcessFleet* fleet) {
  return fleet->RunUntil(
      [&] { return fleet->coordinator().configuration().state == ConfigurationState::kUploading; },
      Seconds(60));
}

// ---- links

// Writes to a link fail in the middle of an upload, whether its port reports that or not. Then the
// link comes back.
TEST(DeadLink, InMidUploadTakesItsUnitsAndNothingElseAndComesBack) {
  for (const bool reported : {false, true}) {
    InProcessFleet fleet({.count = 60, .units_per_bus = 20, .seed = 80});
    fleet.Run(Seconds(5));
    const BusId dead = fleet.layout().buses()[1];
    fleet.ApplyRandom(80);
    ASSERT_TRUE(RunUntilUploading(&fleet));
    fleet.Run(Milliseconds(2));
    fleet.world().disturb().KillBus(dead);
    if (reported) fleet.ReportLink({dead, LinkState::kDown, "write failed"});
    ASSERT_TRUE(fleet.RunUntilIdle());
    for (std::uint32_t n = 0; n < 60; ++n)
      if (fleet.layout().units()[n].bus == dead) {
        EXPECT_EQ(fleet.coordinator().unit({n}).outcome, TargetOutcome::kFailed) << n;
        EXPECT_EQ(fleet.world().Truth(n).moves_begun, 0u) << n;
      }
    EXPECT_GE(CountOutcome(fleet, TargetOutcome::kArrived), 25u) << Unserved(fleet);
    fleet.world().disturb().ReviveBus(dead);
    if (reported) fleet.ReportLink({dead, LinkState::kUp, ""});
    fleet.Run(Seconds(10));
    fleet.ApplyRandom(81);
    ASSERT_TRUE(fleet.RunUntilIdle());
    ExpectOthersArrive(&fleet, 0);
  }
}

TEST(UnitIds, BeyondElevenBitsAreUnitsLikeAllOthers) {
  for (const std::uint32_t first : {2040u, 4'294'967'000u}) {
    InProcessFleet fleet({.count = 37, .seed = 82, .first_id = first});
    fleet.ApplyRandom(82);
    ASSERT_TRUE(fleet.RunUntilIdle());
    ExpectOthersArrive(&fleet, 0);
    EXPECT_NE(fleet.store().Vector(fleet.coordinator().unit({36}).serial), nullptr);
  }
}

// ---- ends and restarts of the host

// SIGTERM ends the host, and no other follows. Moving units finish their proven ways, and no
// further motion begins.
TEST(HostGone, WhatMovesFinishesAndNothingElseBegins) {
  for (const int ms : {50, 100, 150, 200, 250, 300, 350, 400, 450, 600, 3000, 20'000}) {
    const std::string when = std::to_string(ms) + " ms";
    InProcessFleet fleet({.count = 37, .seed = 83});
    fleet.Run(Seconds(5));
    fleet.ApplyRandom(83);
    fleet.Run(Milliseconds(ms));
    const bool started = fleet.coordinator().configuration().state == ConfigurationState::kMoving;
    fleet.End();
    fleet.Freeze(Seconds(120), InProcessFleet::Heard::kLost);
    for (std::size_t n = 0; n < 37; ++n) {
      const sim::UnitTruth truth = fleet.world().Truth(n);
      EXPECT_EQ(truth.state, UnitState::kHostLost) << when << ", row " << n;
      EXPECT_EQ(truth.moves_begun, started ? 1u : 0u) << when << ", row " << n;
    }
    fleet.Restart();
    fleet.Run(Seconds(10));
    ExpectStoreTellsTheTruth(fleet, when);
    for (std::uint32_t n = 0; n < 37; ++n)
      EXPECT_EQ(fleet.coordinator().unit({n}).phase, UnitPhase::kReady) << when << ", row " << n;
    fleet.ApplyRandom(83);
    ASSERT_TRUE(fleet.RunUntilIdle());
    ExpectOthersArrive(&fleet, 0);
  }
}

// Sends the frames of another host; the unit cannot distinguish them.
void MoveByAnotherHost(InProcessFleet* fleet, std::uint32_t row, std::int32_t delta) {
  const Unit& unit = fleet->layout().units()[row];
  StagedMove move{.move = {60'000}, .mode = WaveMode::kAsymmetric, .path = {}};
  move.path[0].Append({0, delta, 108});
  const auto send = [&](const HostMessage& message, Address address) {
    fleet->world().Inject(unit.bus, Encode(message, address), fleet->now(), 1);
    fleet->Freeze(Milliseconds(5), InProcessFleet::Heard::kLost);
  };
  send(StatusRequest{.resume = true}, {unit.node, 255});
  send(StageBegin{move.move, {1, 0}, move.mode}, {unit.node, 0});
  send(StageSegment{Axis::kTheta, 0, move.path[0].segments()[0]}, {unit.node, 0});
  send(Arm{move.move, Digest(move)}, {unit.node, 255});
  send(Start{move.move, 0}, {kBroadcastNode, 0});
}

/// A move away from the end of the unit's range, so that the unit accepts it.
std::int32_t RoomyDelta(InProcessFleet* fleet, std::uint32_t row, std::int32_t size) {
  return TruePoses(*fleet)[row][0] > 0 ? -size : size;
}

TEST(HostGone, UnitThatWasMovedMeanwhileIsNotBelievedToStandWhereItStood) {
  InProcessFleet fleet({.count = 37, .seed = 84});
  fleet.ApplyRandom(84);
  ASSERT_TRUE(fleet.RunUntilIdle());
  fleet.Run(Seconds(1));
  MoveByAnotherHost(&fleet, 7, RoomyDelta(&fleet, 7, 2000));
  fleet.Freeze(Seconds(30), InProcessFleet::Heard::kLost);
  ASSERT_EQ(fleet.world().Truth(std::size_t{7}).moves_begun, 2u) << "or this tries nothing";
  fleet.Restart();
  fleet.Run(Seconds(5));
  EXPECT_EQ(fleet.coordinator().unit({7}).knowledge[0].witness, Witness::kUnknown);
  EXPECT_TRUE(HasAlarm(fleet, "its stored vectors differ from the coordinator's"));
  fleet.ApplyRandom(85);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({7}).outcome, TargetOutcome::kRefused);
  EXPECT_EQ(fleet.world().Truth(std::size_t{7}).moves_begun, 2u);
  ExpectStoreTellsTheTruth(fleet, "after it was moved by somebody else");
}

// The unit was armed by a run that was killed, and has not been heard since. The unit must not go
// with another run's start.
TEST(HostGone, WhatAnEarlierRunArmedNeverStarts) {
  for (const int ms : {100, 110, 120, 130, 140, 150}) {
    InProcessFleet fleet({.count = 37, .seed = 97, .commit_delay = Milliseconds(60)});
    fleet.Run(Seconds(5));
    fleet.ApplyRandom(97);
    ASSERT_TRUE(fleet.RunUntil(
        [&] { return fleet.world().Truth(std::size_t{12}).state == UnitState::kArmed; },
        Seconds(60)));
    fleet.world().disturb().faults(fleet.id(12))->silent = true;
    fleet.Run(Milliseconds(ms - 100));
    ASSERT_EQ(fleet.world().Truth(std::size_t{12}).moves_begun, 0u);
    fleet.Restart();
    fleet.ApplyRandom(98);
    ASSERT_TRUE(fleet.RunUntilIdle());
    EXPECT_EQ(fleet.world().Truth(std::size_t{12}).moves_begun, 0u) << ms;
    EXPECT_GE(CountOutcome(fleet, TargetOutcome::kArrived), 30u) << Unserved(fleet);
  }
}

TEST(Rest, UnitThatLosesPowerBetweenConfigurationsIsNoticed) {
  InProcessFleet fleet({.count = 7, .seed = 86});
  fleet.ApplyRandom(86);
  ASSERT_TRUE(fleet.RunUntilIdle());
  fleet.world().disturb().PowerCut(fleet.id(3));
  // The unit is asked every 10 s, and given up after five tries.
  fleet.Run(Seconds(12));
  EXPECT_EQ(fleet.coordinator().unit({3}).phase, UnitPhase::kSilent);
  EXPECT_TRUE(HasAlarm(fleet, "unit 4 does not answer"));
  fleet.world().disturb().PowerOn(fleet.id(3));
  fleet.Run(Seconds(5));
  EXPECT_EQ(fleet.coordinator().unit({3}).phase, UnitPhase::kReady);
  EXPECT_TRUE(IsPlace(fleet.coordinator().unit({3}).knowledge));
  ExpectStoreTellsTheTruth(fleet, "after its return");
}

// ---- stops

TEST(Stop, LeavesTheEvidenceOfAFault) {
  for (const bool direct : {false, true}) {
    InProcessFleet fleet({.count = 37, .seed = 87});
    fleet.world().disturb().faults(fleet.id(3))->in_motion =
        sim::UnitFaults::InMotion{.after = Seconds(2), .code = FaultCode::kOverCurrent};
    fleet.ApplyRandom(87);
    ASSERT_TRUE(fleet.RunUntil(
        [&] { return fleet.world().Truth(std::size_t{3}).state == UnitState::kFault; },
        Seconds(60)));
    if (direct)
      StopDirectly(&fleet);
    else
      fleet.Send({900, StopCommand{}});
    ASSERT_TRUE(fleet.RunUntilIdle(Seconds(30)));
    fleet.Run(Seconds(15));
    const auto look = [&](const char* when) {
      EXPECT_EQ(fleet.world().Truth(std::size_t{3}).fault, FaultCode::kOverCurrent) << when;
      EXPECT_EQ(fleet.coordinator().unit({3}).phase, UnitPhase::kFault) << when;
      EXPECT_EQ(fleet.coordinator().unit({3}).fault, FaultCode::kOverCurrent) << when;
      // Arbitration decides which of the two reports the fault.
      EXPECT_TRUE(HasAlarm(fleet, "unit 4 stopped with a fault") ||
                  HasAlarm(fleet, "unit 4 reports a fault"))
          << when;
    };
    look("after the stop");
    fleet.Restart();
    fleet.Run(Seconds(5));
    look("after a restart");
    fleet.Send({901, EnableCommand{{{3}}}});
    fleet.Run(Seconds(5));
    EXPECT_EQ(fleet.world().Truth(std::size_t{3}).fault, FaultCode::kNone) << "only this clears it";
  }
}

TEST(Stop, ReachesADisabledUnitThatMoves) {
  InProcessFleet fleet({.count = 7, .seed = 88});
  fleet.Run(Seconds(5));
  fleet.Send({900, EnableCommand{{{2}}, false, "fibre broken"}});
  fleet.Run(Seconds(1));
  MoveByAnotherHost(&fleet, 2, RoomyDelta(&fleet, 2, 20'000));
  fleet.Freeze(Seconds(2), InProcessFleet::Heard::kLost);
  ASSERT_EQ(fleet.world().Truth(std::size_t{2}).state, UnitState::kMoving);
  fleet.Send({901, StopCommand{}});
  fleet.Run(Milliseconds(10));
  EXPECT_EQ(fleet.world().Truth(std::size_t{2}).state, UnitState::kRest);
}

// ---- disabled units

TEST(Disabled, AThousandTimesIsOneEntryAndOutlivesTheHost) {
  InProcessFleet fleet({.count = 7, .seed = 89});
  fleet.Run(Seconds(5));
  const std::size_t entries = fleet.store().fleet.units.size();
  std::uint64_t request = 1000;
  for (int k = 0; k < 1000; ++k) {
    fleet.Send({++request, EnableCommand{{{2}}, false, "fibre broken"}});
    if (k < 999) fleet.Send({++request, EnableCommand{{{2}}}});
    fleet.Run(Milliseconds(1));
  }
  fleet.Run(Seconds(1));
  EXPECT_EQ(fleet.store().fleet.units.size(), entries);
  fleet.Restart();
  fleet.Run(Seconds(5));
  EXPECT_FALSE(fleet.coordinator().unit({2}).enabled);
  EXPECT_EQ(fleet.coordinator().unit({2}).disabled_reason, "fibre broken");
  fleet.Send({++request, EnableCommand{{{2}}}});
  fleet.Run(Seconds(1));
  EXPECT_TRUE(fleet.coordinator().unit({2}).enabled) << "once is enough";
}

// ---- commands

// A refused command has no effect at all: no frame, and no row but the refusal's own.
TEST(Refused, CommandsLeaveAConfigurationAsItIs) {
  std::uint64_t digests[2];
  std::vector<Pose> ends[2];
  for (const bool disturbed : {false, true}) {
    InProcessFleet fleet({.count = 37, .seed = 90});
    fleet.Run(Seconds(5));
    fleet.ApplyRandom(90);
    std::uint64_t request = 1000;
    for (int k = 0; k < 40; ++k) {
      fleet.Run(Milliseconds(k < 30 ? 20 : 1000));
      const PositionerIndex unit{static_cast<std::uint32_t>(k % 37)};
      if (!disturbed || !fleet.coordinator().busy()) continue;
      const bool loaded =
          fleet.coordinator().configuration().state != ConfigurationState::kPlanning;
      fleet.Send({++request, HomeCommand{{unit}}});
      fleet.Send({++request, AdoptCommand{unit}});
      fleet.Send({++request, WriteParameterCommand{unit, Axis::kTheta, Parameter::kRepeat, 50}});
      fleet.Send({++request, ApplyCommand{"another", {}, false}});
      if (loaded && fleet.world().Truth(unit.value).state == UnitState::kMoving)
        fleet.Send({++request, EnableCommand{{unit}, false, "in mid-move"}});
    }
    ASSERT_TRUE(fleet.RunUntilIdle());
    for (std::uint64_t r = 1001; r <= request; ++r) {
      ASSERT_TRUE(fleet.LastReply(r)) << r;
      EXPECT_TRUE(fleet.LastReply(r)->error) << r;
    }
    EXPECT_TRUE(!disturbed || request > 1100) << "or this tries nothing";
    ExpectOthersArrive(&fleet, 0);
    digests[disturbed ? 1 : 0] = fleet.digest();
    ends[disturbed ? 1 : 0] = TruePoses(fleet);
  }
  EXPECT_EQ(digests[0], digests[1]) << "every frame and its instant";
  EXPECT_EQ(ends[0], ends[1]);
}

TEST(Limits, TargetOutOfAnAxisRangeIsRefusedByName) {
  InProcessFleet fleet({.count = 7, .seed = 91});
  fleet.Run(Seconds(5));
  for (const Axis axis : kAxes)
    for (const int side : {-1, 1}) {
      const Unit& unit = fleet.layout().units()[2];
      const AxisGeometry& geometry = unit.axis[Index(axis)];
      const AxisDrive& drive = fleet.coordinator().drives()[2].axis[Index(axis)];
      std::vector<std::optional<Pose>> targets(7);
      targets[2] = TruePoses(fleet)[2];
      (*targets[2])[Index(axis)] =
          NearestVectors(side < 0 ? geometry.min_deg : geometry.max_deg, geometry, drive) +
          side * 200;
      fleet.Apply(targets);
      ASSERT_TRUE(fleet.RunUntilIdle(Seconds(60)));
      EXPECT_EQ(fleet.coordinator().unit({2}).outcome, TargetOutcome::kRefused)
          << Name(axis) << " " << side << ": " << fleet.coordinator().unit({2}).outcome_reason;
      EXPECT_EQ(fleet.world().Truth(std::size_t{2}).moves_begun, 0u);
    }
}

// The unit has limits of its own, in FLASH. They hold whatever the host believes.
TEST(Limits, TheUnitsOwnRangeHoldsToo) {
  InProcessFleet fleet({.count = 37, .seed = 92});
  fleet.Run(Seconds(5));
  const std::int32_t stands = fleet.world().flash(fleet.id(4)).axis[0].position();
  for (const Parameter limit : {Parameter::kMinPosition, Parameter::kMaxPosition}) {
    fleet.Send({900, WriteParameterCommand{{4}, Axis::kTheta, limit, stands}});
    fleet.Run(Seconds(1));
    ASSERT_TRUE(fleet.LastReply(900) && !fleet.LastReply(900)->error);
  }
  fleet.ApplyRandom(92);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({4}).outcome_reason, "refuses its move: out_of_range");
  EXPECT_EQ(fleet.world().Truth(std::size_t{4}).moves_begun, 0u);
  ExpectOthersArrive(&fleet, 4);
}

TEST(NoSleep, FromTheCommandToTheFirstVectorItTakesAnUploadAndTheStartDelay) {
  InProcessFleet fleet({.count = 200, .units_per_bus = 100, .seed = 93});
  fleet.Run(Seconds(5));
  fleet.ApplyRandom(93);
  const HostInstant asked = fleet.now();
  ASSERT_TRUE(fleet.RunUntil(
      [&] {
        for (std::size_t n = 0; n < 200; ++n)
          if (fleet.world().Truth(n).state == UnitState::kMoving) return true;
        return false;
      },
      Seconds(60)));
  // The time is start delay 250 ms, plan 20 ms, commit 5 ms and about 0.1 s of upload; nothing
  // else.
  EXPECT_LT((fleet.now() - asked).seconds(), 0.5);
}

// ---- the frames that are sent are those that were checked

/// The units' motions that the frames on the wire cause, derived from the frames alone.
class SentMoves {
 public:
  explicit SentMoves(InProcessFleet* fleet) : fleet_(*fleet) { fleet->sent = &frames_; }

  /// Takes the new frames. Where a start is among them, the motions that it starts are checked.
  void Look() {
    for (; next_ < frames_.size(); ++next_) {
      const OutFrame& out = frames_[next_];
      const auto heard = DecodeHost(out.frame);
      ASSERT_TRUE(heard);
      const auto row = fleet_.layout().Find(out.bus, heard->address.node);
      if (const auto* begin = std::get_if<StageBegin>(&heard->message)) {
        staged_[row->value] = {.begin = *begin, .segments = {}};
      } else if (const auto* segment = std::get_if<StageSegment>(&heard->message)) {
        staged_[row->value].segments[Index(segment->axis)][segment->index] = segment->segment;
      } else if (const auto* start = std::get_if<Start>(&heard->message)) {
        if (start->move == checked_) continue;
        checked_ = start->move;
        Check(start->move);
      }
    }
  }
  [[nodiscard]] int rounds() const { return rounds_; }

 private:
  struct Staged {
    StageBegin begin;
    std::array<std::map<std::uint8_t, Segment>, kAxisCount> segments;
  };

  [[nodiscard]] double Degrees(std::uint32_t row, std::size_t axis, std::int32_t vectors) const {
    return vectors * 360.0 / (96 * fleet_.layout().units()[row].axis[axis].gear);
  }
  void Check(MoveId move) {
    std::vector<CheckedUnit> units;
    std::vector<CheckedRow> rows;
    for (std::uint32_t n = 0; n < fleet_.layout().size(); ++n) {
      const Unit& unit = fleet_.layout().units()[n];
      CheckedUnit checked{.id = unit.id.value,
                          .base_x_mm = unit.base_fp.x_mm,
                          .base_y_mm = unit.base_fp.y_mm,
                          .half_width_mm = unit.arm_half_width_mm};
      const auto staged = staged_.find(n);
      for (std::size_t k = 0; k < kAxisCount; ++k) {
        const AxisGeometry& g = unit.axis[k];
        std::int32_t at = fleet_.world().flash(unit.id).axis[k].position();
        checked.axis[k] = {g.arm_mm, g.zero_deg, g.min_deg, g.max_deg, Degrees(n, k, at)};
        if (staged == staged_.end() || staged->second.begin.move != move) continue;
        EXPECT_EQ(staged->second.segments[k].size(), staged->second.begin.segments[k]);
        for (const auto& [index, segment] : staged->second.segments[k]) {
          const double t0_s = segment.start_ticks * 1e-4;
          rows.push_back({.unit = unit.id.value,
                          .axis = static_cast<int>(k),
                          .t0_s = t0_s,
                          .t1_s = t0_s + std::abs(segment.delta) * (segment.repeat * 500 / 144e6),
                          .from_deg = Degrees(n, k, at),
                          .to_deg = Degrees(n, k, at + segment.delta)});
          at += segment.delta;
        }
      }
      units.push_back(checked);
    }
    const CheckReport report = CheckPlan(units, rows, {}, {});
    EXPECT_TRUE(report.ok()) << "move " << move.value << ": " << report.Text();
    EXPECT_FALSE(rows.empty());
    ++rounds_;
  }

  InProcessFleet& fleet_;
  std::vector<OutFrame> frames_;
  std::size_t next_ = 0;
  std::map<std::uint32_t, Staged> staged_;
  MoveId checked_;
  int rounds_ = 0;
};

TEST(Checked, IsWhatTheFramesOnTheWireSay) {
  for (const std::uint64_t seed : {94u, 95u, 96u}) {
    FOCALFLEET_TRACE_SEED(seed);
    InProcessFleet fleet({.count = 61, .units_per_bus = 20, .seed = seed});
    fleet.world().disturb().faults(fleet.id(9))->loses_segments = 1;
    SentMoves moves(&fleet);
    for (int k = 0; k < 3; ++k) {
      fleet.ApplyRandom(seed * 10 + static_cast<std::uint64_t>(k));
      ASSERT_TRUE(fleet.RunUntil(
          [&] {
            moves.Look();
            return !fleet.coordinator().busy() && moves.rounds() > k;
          },
          Seconds(600)));
    }
    ExpectOthersArrive(&fleet, 0);
  }
}

}  // namespace
}  // namespace focalfleet
