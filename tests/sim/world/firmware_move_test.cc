// A unit's motions: a staged move from its upload to its end, and homing.
#include <gtest/gtest.h>

#include <vector>

#include "tests/sim/world/firmware_rig.h"

namespace focalfleet::sim {
namespace {

using test::BenchMove;
using test::FirmwareRig;
using test::Get;
using test::kBenchMax;
using test::kBenchMin;
using test::kMove;
using test::kNew;

// ---- a move's life

TEST(Firmware, BeginsOnItsOwnClockAndEndsWhenTheFormulaSays) {
  for (const double rate : {1.0, 1.005, 0.995}) {
    FirmwareRig rig(rate);
    ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
    const HostInstant heard = rig.now();
    rig.StartAll({kMove}, 2500);
    const HostInstant begin = rig.firmware().deadline();
    EXPECT_NEAR(static_cast<double>((begin - heard).ns), 250e6 / rate, 2);
    rig.Run(begin - rig.now());
    EXPECT_EQ(rig.state(), UnitState::kMoving);
    // theta: 400 vectors of 108 * 500 / 144 MHz; phi begins 5 ms later but has only 300.
    EXPECT_NEAR(static_cast<double>((rig.firmware().deadline() - begin).ns), 400 * 375e3 / rate, 2);
  }
}

TEST(Firmware, TellsWhenItsMoveBeganByItsOwnClock) {
  FirmwareRig rig(1.004);
  EXPECT_EQ(rig.Ask<ClockReply>(ClockRequest{})->began_ticks, 0u);
  rig.Run(Milliseconds(1000));
  ASSERT_EQ(rig.StageAndArm(BenchMove(5)), Answer::kOk);
  rig.StartAll({5}, 2500);
  EXPECT_EQ(rig.Ask<ClockReply>(ClockRequest{})->began_ticks, 0u);
  const std::uint32_t heard = rig.Ask<ClockReply>(ClockRequest{})->ticks;
  EXPECT_EQ(heard, 10'040u);
  rig.Run(Milliseconds(400));
  const ClockReply moving = *rig.Ask<ClockReply>(ClockRequest{});
  EXPECT_EQ(moving.began_ticks, heard + 2500);
  EXPECT_EQ(moving.ticks, 14'056u);
  rig.Run(Seconds(60));
  ASSERT_EQ(rig.state(), UnitState::kHostLost);
  EXPECT_EQ(rig.Ask<ClockReply>(ClockRequest{})->began_ticks, moving.began_ticks);
  rig.CutPower();
  rig.GivePower();
  EXPECT_EQ(rig.Ask<ClockReply>(ClockRequest{})->began_ticks, 0u);
}

TEST(Firmware, ASyncEdgeMeansAStartOnlyShortlyBeforeItsTime) {
  FirmwareRig rig;
  rig.PulseSync();
  EXPECT_EQ(rig.state(), UnitState::kRest);
  ASSERT_EQ(rig.StageAndArm(BenchMove(5)), Answer::kOk);
  rig.PulseSync();
  EXPECT_EQ(rig.state(), UnitState::kArmed) << "no start has come";
  rig.StartAll({5}, 1000);
  rig.Run(Microseconds(79'900));
  rig.PulseSync();
  EXPECT_EQ(rig.state(), UnitState::kArmed) << "20.1 ms before its time";
  rig.Run(Microseconds(5100));
  const std::uint32_t edge = rig.Ask<ClockReply>(ClockRequest{})->ticks;
  rig.PulseSync();
  EXPECT_EQ(rig.state(), UnitState::kMoving);
  rig.PulseSync();
  rig.Run(Milliseconds(50));
  EXPECT_EQ(rig.Ask<ClockReply>(ClockRequest{})->began_ticks, edge);
  EXPECT_EQ(rig.flash().moves_begun, 1u);
  rig.CutPower();
  rig.PulseSync();
}

TEST(Firmware, WritesFlashBeforeTheFirstStepAndAfterTheLast) {
  FirmwareRig rig;
  const Flash before = rig.flash();
  ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
  rig.StartAll({kMove}, 100);
  EXPECT_EQ(rig.flash(), before);
  rig.Run(Milliseconds(10));
  EXPECT_TRUE(rig.flash().moving);
  EXPECT_EQ(rig.flash().last_begun, MoveId{kMove});
  EXPECT_EQ(rig.flash().moves_begun, before.moves_begun + 1);
  EXPECT_EQ(rig.flash().axis, before.axis);
  const auto said = rig.Run(Milliseconds(200));
  ASSERT_EQ(said.size(), 1u);
  const Done done = Get<Done>(said[0]);
  EXPECT_EQ(done.outcome, Outcome::kArrived);
  EXPECT_EQ(done.position[0], 400);
  EXPECT_EQ(done.position[1], 660);
  EXPECT_FALSE(rig.flash().moving);
  EXPECT_EQ(rig.flash().axis[0].position(), 400);
  EXPECT_EQ(rig.flash().axis[0].turns, 4);
  EXPECT_EQ(rig.flash().axis[0].vector, 16);
  EXPECT_EQ(rig.flash().axis[1].position(), 660);
}

TEST(Firmware, AStartThatComesAgainMovesNothing) {
  FirmwareRig rig;
  ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
  rig.StartAll({kMove}, 1000);
  const HostInstant begin = rig.firmware().deadline();
  rig.Run(Milliseconds(50));
  rig.StartAll({kMove}, 1000);
  EXPECT_EQ(rig.firmware().deadline(), begin);
  rig.Run(Milliseconds(60));
  const HostInstant end = rig.firmware().deadline();
  rig.StartAll({kMove}, 0);
  EXPECT_EQ(rig.firmware().deadline(), end);
  rig.Run(Milliseconds(300));
  rig.StartAll({kMove}, 0);
  EXPECT_EQ(rig.state(), UnitState::kRest);
  EXPECT_EQ(rig.flash().moves_begun, 1u);
}

TEST(Firmware, ConfirmTellsWhatIsHeldAndWhatIsMissing) {
  FirmwareRig rig;
  const StagedMove move = BenchMove(kMove);
  rig.Give(StageBegin{{kMove}, {1, 1}});
  auto reply = rig.Ask<ConfirmReply>(Confirm{{kMove}});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->answer, Answer::kIncomplete);
  EXPECT_EQ(reply->segments[0] + reply->segments[1], 0);
  rig.Give(StageSegment{Axis::kPhi, 0, move.path[1].segments()[0]});
  rig.Give(StageSegment{Axis::kTheta, 0, move.path[0].segments()[0]});
  reply = rig.Ask<ConfirmReply>(Confirm{{kMove}});
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->answer, Answer::kOk);
  EXPECT_EQ(reply->digest, Digest(move));
  EXPECT_EQ(rig.Ask<ArmReply>(Arm{{kMove}, Digest(move) + 1})->answer, Answer::kIncomplete);
  EXPECT_EQ(rig.state(), UnitState::kStaging);
}

TEST(Firmware, RepeatedUploadFramesChangeNothing) {
  FirmwareRig rig;
  const StagedMove move = BenchMove(kMove);
  rig.Stage(move);
  rig.Stage(move);
  rig.Give(StageBegin{{kMove}, {1, 1}});
  EXPECT_EQ(rig.Ask<ConfirmReply>(Confirm{{kMove}})->digest, Digest(move));
  ASSERT_EQ(rig.Ask<ArmReply>(Arm{{kMove}, Digest(move)})->answer, Answer::kOk);
  rig.Stage(move);
  EXPECT_EQ(rig.state(), UnitState::kArmed);
}

TEST(Firmware, RefusesAPathThatLeavesTheRange) {
  for (const std::int32_t far : {kBenchMax + 1, kBenchMin - 1}) {
    FirmwareRig rig;
    EXPECT_EQ(rig.StageAndArm(BenchMove(kMove, far, 0)), Answer::kOutOfRange);
    StagedMove there_and_back{{kNew}, WaveMode::kAsymmetric, {}};
    there_and_back.path[0].Append({0, far, 108});
    there_and_back.path[0].Append({0, -far, 108});
    EXPECT_EQ(rig.StageAndArm(there_and_back), Answer::kOutOfRange);
  }
  FirmwareRig rig;
  EXPECT_EQ(rig.StageAndArm(BenchMove(kMove, kBenchMax, kBenchMin - 960)), Answer::kOk);
}

TEST(Firmware, GrantsARepeatedArmAgainAfterTheMoveWasBegun) {
  FirmwareRig rig;
  const StagedMove move = BenchMove(kMove);
  ASSERT_EQ(rig.StageAndArm(move, 5), Answer::kOk);
  rig.StartAll({kMove}, 0);
  rig.Run(Milliseconds(1));
  EXPECT_EQ(rig.Ask<ArmReply>(Arm{{kMove}, Digest(move)}, 5)->answer, Answer::kOk);
  EXPECT_EQ(rig.Ask<ArmReply>(Arm{{kMove}, Digest(move)}, 6)->answer, Answer::kBegunBefore);
  EXPECT_EQ(rig.state(), UnitState::kMoving);
}

TEST(Firmware, DoesNotGrantARepeatedArmThatAStopUndid) {
  FirmwareRig rig;
  const StagedMove move = BenchMove(kMove);
  ASSERT_EQ(rig.StageAndArm(move, 5), Answer::kOk);
  rig.Give(Stop{}, 6);
  EXPECT_EQ(rig.Ask<ArmReply>(Arm{{kMove}, Digest(move)}, 5)->answer, Answer::kWrongMove);
}

TEST(Firmware, StopEndsAtTheVectorThatIsShown) {
  FirmwareRig rig;
  ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
  rig.StartAll({kMove}, 0);
  rig.Run(Microseconds(375 * 100 + 10));  // 100 vectors have been shown, the next one is applied
  const auto done = rig.Ask<Done>(Stop{}, 77);
  ASSERT_TRUE(done);
  EXPECT_EQ(done->outcome, Outcome::kStopped);
  EXPECT_EQ(done->position[0], 101);
  EXPECT_EQ(done->move, MoveId{kMove});
  EXPECT_FALSE(rig.flash().moving);
  EXPECT_EQ(rig.flash().axis[0].position(), 101);
  EXPECT_TRUE(rig.Run(Milliseconds(500)).empty()) << "said done twice";
}

// ---- homing

TEST(Firmware, HomingFindsTheStopsFromAnywhereAndEndsAllDoubt) {
  for (const std::int32_t lie : {0, 96, -96 * 7, 96 * 20}) {
    FirmwareRig rig;
    rig.Run(Milliseconds(1));
    // The unit's position is off by whole turns, as after a power cut.
    for (const Axis axis : kAxes)
      EXPECT_EQ(
          rig.Ask<ParameterReply>(ParameterWrite{axis, Parameter::kPosition,
                                                 rig.flash().axis[Index(axis)].position() + lie})
              ->answer,
          Answer::kOk);
    EXPECT_EQ(rig.Ask<HomeReply>(Home{{kMove}})->answer, Answer::kOk);
    std::vector<CanFrame> said;
    for (int s = 0; s < 60 && said.empty(); ++s) {
      rig.Give(Clock{}, 0, kBroadcastNode);
      said = rig.Run(Milliseconds(1000));
    }
    ASSERT_EQ(said.size(), 1u);
    const Done done = Get<Done>(said[0]);
    EXPECT_EQ(done.outcome, Outcome::kHomed);
    EXPECT_EQ(done.position[0], kBenchMin);
    EXPECT_EQ(done.position[1], kBenchMax);
    EXPECT_NEAR(rig.AngleDeg(Axis::kTheta), -360, 6 * 360.0 / 9600);
    EXPECT_NEAR(rig.AngleDeg(Axis::kPhi), 360, 6 * 360.0 / 9600);
    // A move from there goes where it should.
    ASSERT_EQ(rig.StageAndArm(BenchMove(kNew, 960, -960)), Answer::kOk);
    rig.StartAll({kNew}, 0);
    rig.Run(Milliseconds(500));
    EXPECT_NEAR(rig.AngleDeg(Axis::kTheta), -324, 6 * 360.0 / 9600);
    EXPECT_NEAR(rig.AngleDeg(Axis::kPhi), 324, 6 * 360.0 / 9600);
  }
}

TEST(Firmware, HomingDrivesPhiFirst) {
  FirmwareRig rig;
  rig.Give(Home{{kMove}});
  rig.Run(Milliseconds(100));
  EXPECT_NEAR(rig.AngleDeg(Axis::kTheta), 0, 0.2);
  EXPECT_GT(rig.AngleDeg(Axis::kPhi), 40);
}

TEST(Firmware, HomingThatIsStoppedKnowsItsPlaceOnlyBeforeTheStop) {
  FirmwareRig early;
  early.Give(Home{{kMove}});
  early.Run(Milliseconds(100));
  EXPECT_EQ(early.Ask<Done>(Stop{})->outcome, Outcome::kStopped);
  EXPECT_FALSE(early.Ask<StatusReply>(StatusRequest{})->interrupted);
  EXPECT_NEAR(early.flash().axis[1].position() * 360.0 / 9600, early.AngleDeg(Axis::kPhi), 0.2);

  FirmwareRig late;
  late.Give(Home{{kMove}});
  late.Run(Milliseconds(3700));  // 960 + 9866 vectors of 375 us: phi has met its stop
  ASSERT_EQ(late.state(), UnitState::kHoming);
  EXPECT_EQ(late.Ask<Done>(Stop{})->outcome, Outcome::kStopped);
  EXPECT_TRUE(late.Ask<StatusReply>(StatusRequest{})->interrupted);
  EXPECT_TRUE(late.flash().moving) << "the mark stays until the place is known again";
  EXPECT_EQ(late.StageAndArm(BenchMove(kNew, 10, -10)), Answer::kInterrupted);
}

}  // namespace
}  // namespace focalfleet::sim
