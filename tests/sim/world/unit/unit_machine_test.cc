// The behaviour of the machine that only a board sees: when FLASH is kept, and that C can drive it.
// The firmware_*_test.cc files test the unit's answers and motions, on simulated axes.
#include "sim/world/unit/unit_machine.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/base/rng.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/stage_group.h"
#include "tests/protocol/random_messages.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

constexpr NodeId kNode{9};

// A board that records its calls, and whose paths take a second.
struct Asked {
  std::string what;
  Flash flash;  // as it stood at the call
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
  TransmitQueue Give(const HostMessage& message) {
    TransmitQueue out;
    machine_.OnFrame(Encode(message, {kNode, 7}), now_, &out);
    return out;
  }
  TransmitQueue Pass() {
    now_ = machine_.deadline();
    TransmitQueue out;
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
  Pass();  // the motion begins
  EXPECT_EQ(Asked(), (std::vector<std::string>{"keep", "run", "run"}));
  EXPECT_TRUE(board_.kept.moving);
  EXPECT_EQ(board_.kept.last_begun, MoveId{5});
  EXPECT_EQ(board_.kept.moves_begun, 1u);
  board_.asked.clear();
  Pass();  // the motion ends
  EXPECT_EQ(Asked(), (std::vector<std::string>{"halt", "halt", "keep"}));
  EXPECT_FALSE(board_.kept.moving);
  EXPECT_EQ(board_.kept.axis[0].position(), 100);
}

FdFrame GroupOf(const std::vector<CanFrame>& frames) {
  FdFrame group;
  EXPECT_EQ(PackGroup(frames, &group), frames.size());
  return group;
}

TEST_F(UnitMachineTest, TakesItsOwnEntriesOfAGroupAndNobodyElses) {
  StagedMove move{{5}, WaveMode::kAsymmetric, {}};
  move.path[0].Append({0, 100, 37});
  const auto stage = [](NodeId node, std::int32_t delta) {
    return std::vector<CanFrame>{
        Encode(HostMessage(StageBegin{{5}, {1, 0}, WaveMode::kAsymmetric}), {node, 0}),
        Encode(HostMessage(StageSegment{Axis::kTheta, 0, {0, delta, 37}}), {node, 0}),
        Encode(HostMessage(Confirm{{5}}), {node, 3})};
  };
  std::vector<CanFrame> frames = stage({8}, 777);
  for (const CanFrame& frame : stage(kNode, 100)) frames.push_back(frame);
  TransmitQueue out;
  machine_.OnGroup(GroupOf(frames), now_, &out);
  ASSERT_EQ(out.frames().size(), 1u);
  EXPECT_EQ(out.frames()[0],
            Encode(UnitMessage(ConfirmReply{{5}, Digest(move), {1, 0}, {}}), {kNode, 3}));
  EXPECT_EQ(machine_.malformed(), 0u);
  // A group for other units has no effect on it, and does not count as a sign of the host.
  const BoardInstant deadline = machine_.deadline();
  TransmitQueue nothing;
  machine_.OnGroup(GroupOf(stage({8}, 100)), now_ + Milliseconds(100), &nothing);
  EXPECT_TRUE(nothing.frames().empty());
  EXPECT_EQ(machine_.deadline(), deadline);
  // A wrong byte in another unit's entry drops the whole group, and counts once.
  FdFrame broken = GroupOf(frames);
  broken.data[2] |= 7;
  machine_.OnGroup(broken, now_, &nothing);
  EXPECT_TRUE(nothing.frames().empty());
  EXPECT_EQ(machine_.malformed(), 1u);
}

TEST_F(UnitMachineTest, HasRoomForTheAnswersToTheFullestGroup) {
  const std::vector<CanFrame> frames(kGroupEntriesMax,
                                     Encode(HostMessage(Confirm{{5}}), {kNode, 3}));
  TransmitQueue out;
  machine_.OnGroup(GroupOf(frames), now_, &out);
  EXPECT_EQ(out.frames().size(), kGroupEntriesMax);
}

// Staging in any portions gives the same answers and the same staged move.
TEST_F(UnitMachineTest, GroupsSayTheSameAsTheirFramesAlone) {
  const auto seed = focalfleet::test::TestSeed(41);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  PaperBoard other_board;
  other_board.flash = board_.flash;
  UnitMachine alone(kNode, other_board.MakeBoard(), &other_board.flash);
  alone.PowerOn(now_);
  std::size_t answers = 0;
  for (int round = 0; round < 3000; ++round) {
    std::vector<CanFrame> frames;
    while (frames.size() < 1 + rng.Below(12)) {
      HostMessage message = focalfleet::test::RandomHost(rng);
      // Few move ids, so that some of the moves are complete.
      const MoveId move{static_cast<std::uint16_t>(1 + rng.Below(2))};
      if (auto* begin = std::get_if<StageBegin>(&message)) *begin = {move, {1, 0}, begin->mode};
      if (auto* segment = std::get_if<StageSegment>(&message)) segment->index = 0;
      if (auto* confirm = std::get_if<Confirm>(&message)) confirm->move = move;
      const auto node = static_cast<std::uint8_t>(kNode.value + rng.Below(2));
      const CanFrame frame = Encode(message, {{node}, static_cast<std::uint8_t>(rng.Below(256))});
      if (CanBeGrouped(frame)) frames.push_back(frame);
    }
    now_ = now_ + Milliseconds(1);
    TransmitQueue together;
    FdFrame group;
    const std::size_t taken = PackGroup(frames, &group);
    machine_.OnGroup(group, now_, &together);
    std::vector<CanFrame> one_by_one;
    for (std::size_t i = 0; i < taken; ++i) {
      TransmitQueue out;
      alone.OnFrame(frames[i], now_, &out);
      one_by_one.insert(one_by_one.end(), out.frames().begin(), out.frames().end());
    }
    ASSERT_EQ(std::vector<CanFrame>(together.frames().begin(), together.frames().end()),
              one_by_one);
    ASSERT_EQ(machine_.deadline(), alone.deadline());
    ASSERT_EQ(machine_.state(), alone.state());
    answers += one_by_one.size();
  }
  EXPECT_GT(answers, 1000u);
}

TEST_F(UnitMachineTest, KeepsTheMarkBeforeHoming) {
  Give(Home{{6}});
  EXPECT_EQ(Asked(), (std::vector<std::string>{"keep", "run"}));
  EXPECT_TRUE(board_.kept.moving);
  EXPECT_EQ(board_.kept.last_begun, MoveId{6});
  Pass();  // phi has arrived, theta begins
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

// Whenever power fails, the unit will start from the FLASH that was kept last. After every request
// and every deadline the FLASH that it works on is therefore the one that is kept.
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
  const focalfleet::test::AllocGuard guard;
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
