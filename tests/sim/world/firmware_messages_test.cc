// Every message in every state of a unit, against one table.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "sim/world/unit/transitions.h"
#include "tests/sim/world/firmware_rig.h"

namespace focalfleet::sim {
namespace {

using test::BenchMove;
using test::FirmwareRig;
using test::kMove;
using test::kNew;

constexpr std::uint16_t kOld = 6;  // the move that was begun last

/// The states of the wire, and the armed state in which the start signal has come.
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

/// The answers: a letter a state, in the order of At.
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

}  // namespace
}  // namespace focalfleet::sim
