// A unit in trouble: faults, silence of the host, power cuts, and frames in any order.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "protocol/base/rng.h"
#include "tests/sim/world/firmware_rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using test::BenchMove;
using test::FirmwareRig;
using test::Get;
using test::kMove;
using test::kNew;

TEST(Firmware, AFaultStopsTheMoveAndHoldsUntilCleared) {
  FirmwareRig rig;
  rig.faults().in_motion = {Milliseconds(30), FaultCode::kOverCurrent, Axis::kPhi};
  ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
  rig.StartAll({kMove}, 0);
  const auto said = rig.Run(Milliseconds(300));
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(Get<Done>(said[0]).outcome, Outcome::kFault);
  EXPECT_EQ(Get<Done>(said[0]).position[0], 81);  // 30 ms / 375 us and the vector that is shown
  EXPECT_EQ(rig.state(), UnitState::kFault);
  EXPECT_FALSE(rig.flash().moving);
  const auto status = rig.Ask<StatusReply>(StatusRequest{});
  EXPECT_EQ(status->fault, FaultCode::kOverCurrent);
  EXPECT_EQ(rig.Ask<FaultReply>(FaultRequest{})->axis, Axis::kPhi);
  EXPECT_EQ(rig.Ask<FaultReply>(FaultRequest{true})->code, FaultCode::kNone);
  EXPECT_EQ(rig.state(), UnitState::kRest);
  EXPECT_EQ(rig.StageAndArm(BenchMove(kNew)), Answer::kOk);
}

TEST(Firmware, WithoutAHostItFinishesItsMoveAndThenTakesOnlyStopAndStatus) {
  FirmwareRig rig;
  StagedMove longest{{kMove}, WaveMode::kAsymmetric, {}};
  longest.path[0].Append({60'000, 1000, 108});  // begins 6 s after the start signal
  ASSERT_EQ(rig.StageAndArm(longest), Answer::kOk);
  rig.StartAll({kMove}, 100);
  rig.Run(Milliseconds(5500));
  EXPECT_EQ(rig.state(), UnitState::kMoving);
  const auto said = rig.Run(Milliseconds(2000));
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(Get<Done>(said[0]).outcome, Outcome::kArrived);
  EXPECT_EQ(Get<Done>(said[0]).position[0], 1000);
  EXPECT_EQ(rig.state(), UnitState::kHostLost);
  rig.Give(Clock{});
  EXPECT_EQ(rig.state(), UnitState::kHostLost) << "a host's frame alone is no resumption";
  EXPECT_EQ(rig.StageAndArm(BenchMove(kNew)), Answer::kWrongState);
  EXPECT_TRUE(rig.Ask<StatusReply>(StatusRequest{false})->host_lost);
  EXPECT_FALSE(rig.Ask<StatusReply>(StatusRequest{true})->host_lost);
  EXPECT_EQ(rig.StageAndArm(BenchMove(kNew)), Answer::kOk);
}

TEST(Firmware, AnArmedMoveWhoseStartNeverCameIsDroppedWithTheHost) {
  FirmwareRig rig;
  ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
  rig.Run(Milliseconds(4999));
  EXPECT_EQ(rig.state(), UnitState::kArmed);
  rig.Run(Milliseconds(2));
  EXPECT_EQ(rig.state(), UnitState::kHostLost);
  rig.StartAll({kMove}, 0);
  rig.Run(Milliseconds(10));
  EXPECT_EQ(rig.flash().moves_begun, 0u);
}

TEST(Firmware, SaysRestartedUntilAHostResumes) {
  FirmwareRig rig;
  EXPECT_TRUE(rig.Ask<StatusReply>(StatusRequest{false}, 1)->restarted);
  EXPECT_TRUE(rig.Ask<StatusReply>(StatusRequest{true}, 2)->restarted);
  EXPECT_TRUE(rig.Ask<StatusReply>(StatusRequest{true}, 2)->restarted) << "the answer was lost";
  EXPECT_FALSE(rig.Ask<StatusReply>(StatusRequest{false}, 3)->restarted);
  EXPECT_FALSE(rig.Ask<StatusReply>(StatusRequest{true}, 2)->restarted);
  rig.CutPower();
  EXPECT_TRUE(rig.Give(IdentifyRequest{}).empty());
  rig.GivePower();
  EXPECT_TRUE(rig.Ask<StatusReply>(StatusRequest{false}, 3)->restarted);
}

// ---- power

TEST(Firmware, APowerCutAtAnyInstantOfAMoveNeverLooksLikeRest) {
  for (std::int64_t cut_us = 0; cut_us <= 175'000; cut_us += 977) {
    SCOPED_TRACE(cut_us);
    FirmwareRig rig;
    ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
    rig.StartAll({kMove}, 100);
    rig.Run(Microseconds(cut_us));
    const UnitState was = rig.state();
    const double true_deg = rig.AngleDeg(Axis::kTheta);
    rig.CutPower();
    rig.Run(Milliseconds(50));
    EXPECT_EQ(rig.AngleDeg(Axis::kTheta), true_deg);
    rig.GivePower();
    const auto status = rig.Ask<StatusReply>(StatusRequest{});
    ASSERT_TRUE(status);
    EXPECT_TRUE(status->restarted);
    EXPECT_EQ(status->interrupted, was == UnitState::kMoving);
    EXPECT_EQ(status->state, UnitState::kRest);
    const double stored_deg = rig.flash().axis[0].position() * 360.0 / 9600;
    if (was == UnitState::kMoving) {
      // The stored vector is applied: the shaft stands whole electrical turns (3.6 deg) from it.
      const double turns = (rig.AngleDeg(Axis::kTheta) - stored_deg) / 3.6;
      EXPECT_NEAR(turns, std::round(turns), 0.06);
      EXPECT_NEAR(rig.AngleDeg(Axis::kTheta), true_deg, 1.8 + 0.3);
      EXPECT_EQ(rig.StageAndArm(BenchMove(kNew)), Answer::kInterrupted);
      EXPECT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kBegunBefore);
    } else {
      EXPECT_NEAR(rig.AngleDeg(Axis::kTheta), stored_deg, 0.2);
      EXPECT_EQ(rig.StageAndArm(BenchMove(kNew)), Answer::kOk);
    }
  }
}

TEST(Firmware, AnInterruptedUnitMovesAgainWhenBothPositionsAreSet) {
  FirmwareRig rig;
  ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
  rig.StartAll({kMove}, 0);
  rig.Run(Milliseconds(60));
  rig.CutPower();
  rig.GivePower();
  rig.CutPower();  // a second time: the doubt is in FLASH
  rig.GivePower();
  for (const Axis axis : kAxes) {
    EXPECT_TRUE(rig.Ask<StatusReply>(StatusRequest{})->interrupted);
    const auto measured = static_cast<std::int32_t>(std::lround(rig.AngleDeg(axis) * 9600 / 360));
    EXPECT_EQ(rig.Ask<ParameterReply>(ParameterWrite{axis, Parameter::kPosition, measured})->answer,
              Answer::kOk);
    EXPECT_NEAR(rig.flash().axis[Index(axis)].position(), measured, 6);
  }
  EXPECT_FALSE(rig.Ask<StatusReply>(StatusRequest{})->interrupted);
  EXPECT_FALSE(rig.flash().moving);
  EXPECT_EQ(rig.StageAndArm(BenchMove(kNew, 10, 10)), Answer::kOk);
}

// ---- random frames

// The host forgets, repeats and mixes frames; moves get ascending ids, and power fails now and
// then.
TEST(Firmware, NeverBeginsAMoveTwiceWhateverComes) {
  for (std::uint64_t round = 0; round < 60; ++round) {
    const std::uint64_t seed = focalfleet::test::TestSeed(1) + round;
    FOCALFLEET_TRACE_SEED(seed);
    Rng rng(seed);
    FirmwareRig rig;
    std::vector<std::uint16_t> begun;
    std::uint32_t counted = 0;
    std::vector<CanFrame> sent;
    std::uint16_t move = 1;
    for (int step = 0; step < 400; ++step) {
      const auto way = static_cast<std::int32_t>(rng.Below(200)) - 100;
      if (rng.Below(6) == 0) ++move;
      const std::uint16_t id =
          rng.Below(4) == 0 && move > 1 ? static_cast<std::uint16_t>(move - 1) : move;
      const StagedMove staged = BenchMove(id, way, -way);
      const auto sequence = static_cast<std::uint8_t>(rng.Below(4));
      std::vector<CanFrame> frames;
      const auto add = [&](const HostMessage& m, NodeId node = FirmwareRig::kNode) {
        frames.push_back(Encode(m, {node, sequence}));
      };
      switch (rng.Below(9)) {
        case 0:
        case 1:
          add(StageBegin{{id}, {1, 1}});
          add(StageSegment{Axis::kTheta, 0, staged.path[0].segments()[0]});
          add(StageSegment{Axis::kPhi, 0, staged.path[1].segments()[0]});
          add(Arm{{id}, Digest(staged)});
          break;
        case 2:
        case 3:
          add(focalfleet::Start{{id}, static_cast<std::uint32_t>(rng.Below(200))}, kBroadcastNode);
          break;
        case 4:
          add(Arm{{id}, Digest(staged)});
          break;
        case 5:
          if (rng.Below(4) == 0) add(Home{{id}});
          break;
        case 6:
          if (rng.Below(3) == 0) add(Stop{});
          break;
        case 7:
          if (!sent.empty()) frames.push_back(sent[rng.Below(sent.size())]);
          break;
        default:
          if (rng.Below(4) == 0) {
            rig.CutPower();
            rig.Run(Milliseconds(5));
            rig.GivePower();
            for (const Axis axis : kAxes) add(ParameterWrite{axis, Parameter::kPosition, 0});
          }
          add(StatusRequest{true});
          break;
      }
      for (const CanFrame& frame : frames) {
        sent.push_back(frame);
        rig.Give(frame);
        rig.Run(Microseconds(static_cast<std::int64_t>(rng.Below(30'000))));
        if (rig.flash().moves_begun == counted) continue;
        counted = rig.flash().moves_begun;
        const std::uint16_t last = rig.flash().last_begun.value;
        // Only an id older than the last could come again; this host's ids do not go back further.
        if (begun.empty() || last != begun.back()) {
          begun.push_back(last);
        } else {
          ADD_FAILURE() << "move " << last << " begun twice";
        }
      }
    }
    EXPECT_GT(begun.size(), 3u) << "the test moved nothing";
  }
}

TEST(Firmware, AnyFrameIsTakenOrLeftButMovesNoUnitThatIsNotArmed) {
  const std::uint64_t seed = focalfleet::test::TestSeed(2);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  FirmwareRig rig;
  for (int i = 0; i < 200'000; ++i) {
    CanFrame frame;
    const bool plausible = rng.Below(2) == 0;
    frame.id = static_cast<std::uint32_t>(rng.Bits()) & (plausible ? kCanIdMax : UINT32_MAX);
    if (plausible) {
      const auto function = static_cast<Function>(rng.Below(kFunctionCount));
      const NodeId node = rng.Below(3) == 0 ? kBroadcastNode : FirmwareRig::kNode;
      frame.id = Pack({function,
                       rng.Below(8) == 0,
                       {node, static_cast<std::uint8_t>(rng.Below(256))},
                       static_cast<std::uint8_t>(rng.Below(3))});
    }
    frame.length = static_cast<std::uint8_t>(rng.Below(plausible ? 9 : 256));
    for (auto& byte : frame.data)
      byte = static_cast<std::uint8_t>(rng.Below(2) == 0 ? rng.Below(3) : rng.Below(256));
    const UnitState before = rig.state();
    rig.Give(frame);
    if (rig.state() == UnitState::kMoving) FAIL() << "began without a deadline";
    if (rig.state() == UnitState::kHoming && before != UnitState::kHoming) rig.Give(Stop{});
    if (i % 1000 == 0) rig.Give(StatusRequest{true});
    if (rig.flash().lost_axes != 0)
      for (const Axis axis : kAxes) rig.Give(ParameterWrite{axis, Parameter::kPosition, 0});
  }
  EXPECT_EQ(rig.axis(Axis::kTheta).Applied(rig.now()), rig.flash().axis[0].position());
}

}  // namespace
}  // namespace focalfleet::sim
