#include "sim/world/unit/firmware.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "protocol/base/rng.h"
#include "tests/sim/world/firmware_rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using test::BenchMove;
using test::FirmwareRig;
using test::kBenchMax;
using test::kBenchMin;

constexpr std::uint16_t kOld = 6;   // the move that was begun last
constexpr std::uint16_t kMove = 7;  // the one that is staged or runs
constexpr std::uint16_t kNew = 8;

template <class M>
M Get(const CanFrame& frame) {
  const auto decoded = DecodeUnit(frame);
  EXPECT_TRUE(decoded && std::holds_alternative<M>(decoded->message));
  return decoded && std::holds_alternative<M>(decoded->message) ? std::get<M>(decoded->message)
                                                                : M{};
}

// ---- every message in every state

/// The states of the wire, and armed with the start signal already there.
enum class At { kRest, kStaging, kArmed, kWaiting, kMoving, kHoming, kFault, kHostLost };
constexpr At kAllAt[] = {At::kRest,   At::kStaging, At::kArmed, At::kWaiting,
                         At::kMoving, At::kHoming,  At::kFault, At::kHostLost};
constexpr const char* kAtNames[] = {"rest",   "staging", "armed", "waiting",
                                    "moving", "homing",  "fault", "host_lost"};
constexpr UnitState kStateOf[] = {UnitState::kRest,  UnitState::kStaging, UnitState::kArmed,
                                  UnitState::kArmed, UnitState::kMoving,  UnitState::kHoming,
                                  UnitState::kFault, UnitState::kHostLost};

void Bring(FirmwareRig* rig, At at) {
  rig->flash().last_begun = {kOld};
  switch (at) {
    case At::kRest:
      break;
    case At::kStaging:
      rig->Stage(BenchMove(kMove));
      break;
    case At::kArmed:
    case At::kWaiting:
    case At::kMoving:
      rig->StageAndArm(BenchMove(kMove), 200);
      if (at != At::kArmed) rig->StartAll({kMove}, 1000);
      if (at == At::kMoving) rig->Run(Milliseconds(110));
      break;
    case At::kHoming:
      rig->Give(Home{{kMove}}, 200);
      rig->Run(Milliseconds(10));
      break;
    case At::kFault: {
      TransmitQueue out;
      rig->firmware().RaiseFault({FaultCode::kDriver, Axis::kPhi}, rig->now(), &out);
      break;
    }
    case At::kHostLost:
      rig->Run(Milliseconds(5001));
      break;
  }
  ASSERT_EQ(rig->state(), kStateOf[static_cast<std::size_t>(at)]);
}

/// What came: a letter a state, in the order of At.
///   . nothing   + granted or plainly answered   w wrong_state   m wrong_move   b begun_before
struct Row {
  const char* name;
  HostMessage message;
  const char* answers;
  // r rest, s staging, a armed, m moving, h homing, f fault, l host_lost, = as it was
  const char* next;
};

char AnswerLetter(Answer answer) {
  switch (answer) {
    case Answer::kOk:
      return '+';
    case Answer::kWrongState:
      return 'w';
    case Answer::kWrongMove:
      return 'm';
    case Answer::kBegunBefore:
      return 'b';
    default:
      return '?';
  }
}

char LetterOf(const std::vector<CanFrame>& frames) {
  if (frames.empty()) return '.';
  if (frames.size() > 1) return '!';
  const auto decoded = DecodeUnit(frames[0]);
  if (!decoded) return '?';
  if (decoded->address != Address{FirmwareRig::kNode, 33}) return '#';
  if (const auto* m = std::get_if<ArmReply>(&decoded->message)) return AnswerLetter(m->answer);
  if (const auto* m = std::get_if<ConfirmReply>(&decoded->message)) return AnswerLetter(m->answer);
  if (const auto* m = std::get_if<HomeReply>(&decoded->message)) return AnswerLetter(m->answer);
  if (const auto* m = std::get_if<ParameterReply>(&decoded->message))
    return AnswerLetter(m->answer);
  return '+';
}

UnitState NextOf(char letter, UnitState was) {
  switch (letter) {
    case 'r':
      return UnitState::kRest;
    case 's':
      return UnitState::kStaging;
    case 'a':
      return UnitState::kArmed;
    case 'h':
      return UnitState::kHoming;
    default:
      return was;
  }
}

const std::vector<Row>& Rows() {
  static const std::vector<Row> rows = {
      // state:                                             R S A W M H F L     R S A W M H F L
      {"stop", Stop{}, "++++++++", "=rrrrr=="},
      {"start, other move", Start{{kNew}, 10}, "........", "========"},
      {"start", Start{{kMove}, 10}, "........", "========"},
      {"clock", Clock{5}, "........", "========"},
      {"clock request", ClockRequest{}, "++++++++", "========"},
      {"arm", Arm{{kMove}, Digest(BenchMove(kMove))}, "m+++bbww", "=a======"},
      {"arm, other move", Arm{{kNew}, 0}, "mmmmwwww", "========"},
      {"arm, begun move", Arm{{kOld}, 0}, "bbbbwwbb", "========"},
      {"confirm", Confirm{{kMove}}, "m+++bbww", "========"},
      {"confirm, other move", Confirm{{kNew}}, "mmmmwwww", "========"},
      {"stage_begin", StageBegin{{kNew}, {1, 0}}, "........", "sss====="},
      {"stage_begin again", StageBegin{{kMove}, {1, 1}}, "........", "s======="},
      {"stage_segment", StageSegment{Axis::kTheta, 0, {0, 400, 108}}, "........", "========"},
      {"home", Home{{kNew}}, "++wwwwww", "hh======"},
      {"home, begun move", Home{{kOld}}, "bbbbwwbb", "========"},
      {"progress", ProgressRequest{}, "++++++++", "========"},
      {"status", StatusRequest{false}, "++++++++", "========"},
      {"status, resume", StatusRequest{true}, "++++++++", "=======r"},
      {"vector", VectorRequest{Axis::kPhi}, "++++++++", "========"},
      {"fault", FaultRequest{false}, "++++++++", "========"},
      {"fault, clear", FaultRequest{true}, "++++++++", "======r="},
      {"identify", IdentifyRequest{}, "++++++++", "========"},
      {"parameter_read", ParameterRead{Axis::kPhi, Parameter::kRepeat}, "++++++++", "========"},
      {"parameter_write", ParameterWrite{Axis::kPhi, Parameter::kRepeat, 50}, "+wwwwwww",
       "========"},
      {"position write", ParameterWrite{Axis::kPhi, Parameter::kPosition, 960}, "+wwwwwww",
       "========"},
  };
  return rows;
}

/// A joint whose sensors show the number of the reading.
class CountingJoint final : public JointSensors {
 public:
  void Read(UnitId unit, std::uint32_t reading, const FibreCarrierTip& tip,
            std::span<std::uint16_t> counts) const override {
    EXPECT_EQ(unit.value, 77u);
    EXPECT_EQ(tip.length_mm, 30);
    for (std::size_t k = 0; k < counts.size(); ++k)
      counts[k] = static_cast<std::uint16_t>(100 * (reading + 1) + k);
  }
};

TEST(FirmwareSensors, TellsOneReadingInPartsUntilItIsAskedForTheFirstAgain) {
  const CountingJoint magnets;
  const Mechanism mechanism{};
  FirmwareRig rig(1, {UnitId{77}, 6, 30, &mechanism, &magnets});
  EXPECT_EQ(rig.Ask<IdentifyReply>(IdentifyRequest{})->protocol_version, 2);
  const auto part = [&](std::uint8_t number) {
    const auto reply = rig.Ask<SensorsReply>(SensorsRequest{number});
    EXPECT_EQ(reply->part, number);
    return reply->counts;
  };
  using Counts = std::array<std::uint16_t, kSensorsPerPart>;
  EXPECT_EQ(part(1), (Counts{104, 105, kNoCount, kNoCount})) << "nothing was read before";
  EXPECT_EQ(part(0), (Counts{200, 201, 202, 203}));
  EXPECT_EQ(part(1), (Counts{204, 205, kNoCount, kNoCount})) << "the rest of the same reading";
  EXPECT_EQ(part(3), (Counts{kNoCount, kNoCount, kNoCount, kNoCount}));
  EXPECT_EQ(part(0), (Counts{300, 301, 302, 303}));
}

TEST(FirmwareSensors, ABoardWithoutAnySpeaksVersion1AndDropsTheFrame) {
  FirmwareRig rig;
  EXPECT_EQ(rig.Ask<IdentifyReply>(IdentifyRequest{})->protocol_version, 1);
  const std::uint64_t malformed = rig.firmware().malformed();
  EXPECT_TRUE(rig.Give(SensorsRequest{0}).empty());
  EXPECT_EQ(rig.firmware().malformed(), malformed + 1);
}

TEST(Firmware, AnswersEveryMessageInEveryStateAsTheTableSays) {
  for (const Row& row : Rows()) {
    for (const At at : kAllAt) {
      const auto column = static_cast<std::size_t>(at);
      SCOPED_TRACE(std::string(row.name) + " in " + kAtNames[column]);
      FirmwareRig rig;
      Bring(&rig, at);
      const UnitState was = rig.state();
      EXPECT_EQ(LetterOf(rig.Give(row.message, 33)), row.answers[column]);
      EXPECT_EQ(rig.state(), NextOf(row.next[column], was));
      EXPECT_EQ(rig.flash().moving,
                rig.state() == UnitState::kMoving || rig.state() == UnitState::kHoming);
    }
  }
}

TEST(Firmware, TakesNoBroadcastButStopStartClockAndReads) {
  for (const Row& row : Rows()) {
    for (const At at : kAllAt) {
      SCOPED_TRACE(std::string(row.name) + " in " + kAtNames[static_cast<std::size_t>(at)]);
      FirmwareRig rig;
      Bring(&rig, at);
      const UnitState was = rig.state();
      const auto frames = rig.Give(row.message, 33, kBroadcastNode);
      const bool read = std::holds_alternative<StatusRequest>(row.message) ||
                        std::holds_alternative<ProgressRequest>(row.message) ||
                        std::holds_alternative<IdentifyRequest>(row.message) ||
                        std::holds_alternative<ClockRequest>(row.message) ||
                        std::holds_alternative<VectorRequest>(row.message) ||
                        std::holds_alternative<FaultRequest>(row.message) ||
                        std::holds_alternative<ParameterRead>(row.message);
      const bool stop = std::holds_alternative<Stop>(row.message);
      EXPECT_EQ(frames.size(), read || stop ? 1u : 0u);
      const bool resume = std::string(row.name) == "status, resume";
      if (!stop && !resume) {
        EXPECT_EQ(rig.state(), was);
      }
    }
  }
}

TEST(Firmware, AllowsExactlyTheTransitionsOfTheTable) {
  using enum UnitState;
  const std::vector<std::pair<UnitState, UnitState>> expected = {
      {kRest, kStaging},    {kRest, kHoming},      {kRest, kFault},     {kRest, kHostLost},
      {kStaging, kRest},    {kStaging, kStaging},  {kStaging, kArmed},  {kStaging, kHoming},
      {kStaging, kFault},   {kStaging, kHostLost}, {kArmed, kRest},     {kArmed, kStaging},
      {kArmed, kMoving},    {kArmed, kFault},      {kArmed, kHostLost}, {kMoving, kRest},
      {kMoving, kFault},    {kMoving, kHostLost},  {kHoming, kRest},    {kHoming, kFault},
      {kHoming, kHostLost}, {kFault, kRest},       {kFault, kFault},    {kHostLost, kRest},
      {kHostLost, kFault}};
  std::size_t allowed = 0;
  for (std::uint8_t from = 0; from < kUnitStateCount; ++from)
    for (std::uint8_t to = 0; to < kUnitStateCount; ++to)
      allowed += Allowed(static_cast<UnitState>(from), static_cast<UnitState>(to)) ? 1u : 0u;
  EXPECT_EQ(allowed, expected.size());
  for (const auto& [from, to] : expected)
    EXPECT_TRUE(Allowed(from, to)) << Name(from) << " to " << Name(to);
}

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
  rig.Run(Microseconds(375 * 100 + 10));  // 100 vectors shown out, the next one applied
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
    // What it believes is off by whole turns, as after a cut.
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
    // And a move from there goes where it should.
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

// ---- faults, silence of the host, parameters

TEST(Firmware, AFaultStopsTheMoveAndHoldsUntilCleared) {
  FirmwareRig rig;
  rig.faults().in_motion = {Milliseconds(30), FaultCode::kOverCurrent, Axis::kPhi};
  ASSERT_EQ(rig.StageAndArm(BenchMove(kMove)), Answer::kOk);
  rig.StartAll({kMove}, 0);
  const auto said = rig.Run(Milliseconds(300));
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(Get<Done>(said[0]).outcome, Outcome::kFault);
  EXPECT_EQ(Get<Done>(said[0]).position[0], 81);  // 30 ms / 375 us and the one shown
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

TEST(Firmware, KeepsParametersWithinTheirBounds) {
  FirmwareRig rig;
  const auto write = [&](Parameter parameter, std::int32_t value) {
    return *rig.Ask<ParameterReply>(ParameterWrite{Axis::kTheta, parameter, value});
  };
  struct Bound {
    Parameter parameter;
    std::int32_t low, high;
  };
  for (const Bound& b :
       {Bound{Parameter::kCounter1, 50, 20'000}, Bound{Parameter::kRepeat, 1, 255},
        Bound{Parameter::kMode, 0, 2}, Bound{Parameter::kHostTimeoutMs, 100, 3'600'000},
        Bound{Parameter::kMinPosition, -limits::kPositionMax, kBenchMax},
        Bound{Parameter::kHomePosition, kBenchMin, kBenchMax}}) {
    SCOPED_TRACE(Name(b.parameter));
    const std::int32_t was =
        rig.Ask<ParameterReply>(ParameterRead{Axis::kTheta, b.parameter})->value;
    for (const std::int32_t value : {b.low, b.high}) {
      EXPECT_EQ(write(b.parameter, value).answer, Answer::kOk);
      EXPECT_EQ(rig.Ask<ParameterReply>(ParameterRead{Axis::kTheta, b.parameter})->value, value);
    }
    for (const std::int32_t value : {b.low - 1, b.high + 1, INT32_MIN, INT32_MAX}) {
      EXPECT_EQ(write(b.parameter, value).answer, Answer::kBadValue);
      EXPECT_EQ(write(b.parameter, value).value, b.high);
    }
    EXPECT_EQ(write(b.parameter, was).answer, Answer::kOk);
  }
  for (const std::int32_t bad : {0, 5, 97, 1542, -96, INT32_MAX})
    EXPECT_EQ(write(Parameter::kSubdivision, bad).answer, Answer::kBadValue);
}

TEST(Firmware, AnotherSubdivisionKeepsAllAngles) {
  FirmwareRig rig;
  const double before_deg = rig.AngleDeg(Axis::kPhi);
  ASSERT_EQ(
      rig.Ask<ParameterReply>(ParameterWrite{Axis::kPhi, Parameter::kSubdivision, 48})->answer,
      Answer::kOk);
  EXPECT_EQ(rig.flash().axis[1].position(), 480);
  EXPECT_EQ(rig.flash().axis[1].max_position, kBenchMax / 2);
  EXPECT_NEAR(rig.AngleDeg(Axis::kPhi), before_deg, 0.1);
}

TEST(Firmware, APositionIsSetOnlyToPlacesThatShowTheAppliedVector) {
  FirmwareRig rig;
  const auto reply =
      rig.Ask<ParameterReply>(ParameterWrite{Axis::kTheta, Parameter::kPosition, 1000});
  EXPECT_EQ(reply->answer, Answer::kOk);
  EXPECT_EQ(reply->value, 960);  // the vector is 0: 960 is ten turns, 1000 is not whole
  EXPECT_NEAR(rig.AngleDeg(Axis::kTheta), 0, 1e-9) << "the shaft turned";
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
  rig.CutPower();  // and again: the doubt is in FLASH
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

// ---- whatever comes

// A host that forgets, repeats and mixes; moves get ascending ids, power fails now and then.
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
        // Only an older id than the last could come again; this host's ids do not go back further.
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
