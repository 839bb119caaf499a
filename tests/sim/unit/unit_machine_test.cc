// What only a board sees of the machine: when FLASH is kept, and that C can drive it. What the unit
// says and does is firmware_test.cc's, on simulated axes.
#include "sim/unit/unit_machine.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/wire/codec.h"
#include "tests/support/alloc_guard.h"

namespace focalfleet::sim {
namespace {

constexpr NodeId kNode{9};

// A board that writes down what it is asked, and whose paths take a second.
struct Asked {
  std::string what;
  Flash flash;  // as it stood then
};
struct PaperBoard {
  Flash flash;
  Flash kept;
  std::vector<Asked> asked;
  std::int32_t at[kAxisCount] = {0, 0};
  std::int32_t to[kAxisCount] = {0, 0};
  bool writes = true;

  void Note(const char* what) {
    if (writes) asked.push_back({what, flash});
  }
  static PaperBoard& Of(void* context) { return *static_cast<PaperBoard*>(context); }
  Board MakeBoard() {
    return {.context = this,
            .energise = [](void* c, Axis, Field) { Of(c).Note("energise"); },
            .run =
                [](void* c, Axis axis, PathOrder order) {
                  Of(c).Note("run");
                  std::int32_t& end = Of(c).to[Index(axis)];
                  end = order.from;
                  for (std::size_t i = 0; i < order.count; ++i) end += order.segments[i].delta;
                  return order.begin + Milliseconds(1000);
                },
            .halt =
                [](void* c, Axis axis, BoardInstant) {
                  Of(c).Note("halt");
                  Of(c).at[Index(axis)] = Of(c).to[Index(axis)];
                },
            .applied = [](void* c, Axis axis, BoardInstant) { return Of(c).at[Index(axis)]; },
            .recount = [](void* c, Axis axis,
                          std::int32_t position) { Of(c).at[Index(axis)] = position; },
            .after = [](void*, BoardInstant from, DurationNs duration) { return from + duration; },
            .ticks = [](void*,
                        BoardInstant now) { return static_cast<std::uint32_t>(now.ns / kTick.ns); },
            .keep =
                [](void* c) {
                  Of(c).Note("keep");
                  Of(c).kept = Of(c).flash;
                }};
  }
};

class UnitMachineTest : public ::testing::Test {
 protected:
  UnitMachineTest() : machine_(kNode, board_.MakeBoard(), &board_.flash) {
    for (AxisFlash& axis : board_.flash.axis) axis.max_position = 9600;
    board_.kept = board_.flash;
    machine_.PowerOn(now_);
    board_.asked.clear();
  }
  Outbox Give(const HostMessage& message) {
    Outbox out;
    machine_.OnFrame(Encode(message, {kNode, 7}), now_, &out);
    return out;
  }
  Outbox Pass() {
    now_ = machine_.deadline();
    Outbox out;
    machine_.OnTime(now_, &out);
    return out;
  }
  void StageArmStart() {
    StagedMove move{{5}, WaveMode::kAsymmetric, {}};
    move.path[0].Append({0, 100, 37});
    Give(StageBegin{{5}, {1, 0}, WaveMode::kAsymmetric});
    Give(StageSegment{Axis::kTheta, 0, {0, 100, 37}});
    Give(Arm{{5}, Digest(move)});
    Give(focalfleet::Start{{5}, 10});
  }
  std::vector<std::string> Asked() const {
    std::vector<std::string> what;
    for (const auto& asked : board_.asked) what.push_back(asked.what);
    return what;
  }

  PaperBoard board_;
  UnitMachine machine_;
  BoardInstant now_{0};
};

TEST_F(UnitMachineTest, KeepsTheMarkBeforeTheFirstStepAndThePlaceAfterTheLast) {
  StageArmStart();
  Pass();  // begins
  EXPECT_EQ(Asked(), (std::vector<std::string>{"keep", "run", "run"}));
  EXPECT_TRUE(board_.kept.moving);
  EXPECT_EQ(board_.kept.last_begun, MoveId{5});
  EXPECT_EQ(board_.kept.moves_begun, 1u);
  board_.asked.clear();
  Pass();  // ends
  EXPECT_EQ(Asked(), (std::vector<std::string>{"halt", "halt", "keep"}));
  EXPECT_FALSE(board_.kept.moving);
  EXPECT_EQ(board_.kept.axis[0].position(), 100);
}

TEST_F(UnitMachineTest, KeepsTheMarkBeforeHoming) {
  Give(Home{{6}});
  EXPECT_EQ(Asked(), (std::vector<std::string>{"keep", "run"}));
  EXPECT_TRUE(board_.kept.moving);
  EXPECT_EQ(board_.kept.last_begun, MoveId{6});
  Pass();  // phi is there, theta begins
  EXPECT_TRUE(board_.kept.moving);
  Pass();
  EXPECT_FALSE(board_.kept.moving);
}

TEST_F(UnitMachineTest, KeepsWhateverItAnsweredOf) {
  Give(ParameterWrite{Axis::kPhi, Parameter::kRepeat, 42});
  EXPECT_EQ(board_.kept.axis[1].repeat, 42);
  Give(ParameterWrite{Axis::kPhi, Parameter::kRepeat, 0});
  EXPECT_EQ(Asked(), (std::vector<std::string>{"keep"})) << "a refused value wears no FLASH";
}

// Whenever power goes, what was kept is what the unit will wake up with: after every request and
// every deadline the FLASH that it works on is the one that is kept.
TEST_F(UnitMachineTest, LeavesNothingUnkept) {
  StageArmStart();
  EXPECT_EQ(board_.kept, board_.flash);
  Pass();
  EXPECT_EQ(board_.kept, board_.flash);
  Give(Stop{});
  EXPECT_EQ(board_.kept, board_.flash);
  Give(Home{{8}});
  EXPECT_EQ(board_.kept, board_.flash);
  Pass();
  EXPECT_EQ(board_.kept, board_.flash);
  Give(Stop{});
  EXPECT_EQ(board_.kept, board_.flash);
  for (const auto parameter :
       {Parameter::kPosition, Parameter::kSubdivision, Parameter::kHostTimeoutMs}) {
    Give(ParameterWrite{Axis::kTheta, parameter, 192});
    EXPECT_EQ(board_.kept, board_.flash) << Name(parameter);
  }
  board_.flash.moving = true;
  machine_.PowerOff();
  machine_.PowerOn(now_);
  EXPECT_EQ(board_.kept, board_.flash);
  EXPECT_TRUE(machine_.interrupted());
}

TEST_F(UnitMachineTest, UsesNoHeap) {
  board_.writes = false;
  const focalfleet::testing::AllocGuard guard;
  StageArmStart();
  Pass();
  Pass();
  Give(Home{{8}});
  Give(StatusRequest{true});
  Give(Stop{});
  EXPECT_EQ(guard.allocations(), 0u);
}

TEST_F(UnitMachineTest, IsSmall) { EXPECT_LE(sizeof(UnitMachine), 1024u); }

}  // namespace
}  // namespace focalfleet::sim
