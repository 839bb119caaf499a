// The bus in trouble, against the standard's rules as a table of its own
// (sim/world/bus/error_counters.h has their numbers).
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "protocol/wire/frame_bits.h"
#include "sim/world/bus/bus.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

constexpr std::int64_t kBit = 1000;  // ns at 1 Mbit/s

CanFrame FrameOf(std::uint32_t id, std::uint8_t length = 8) {
  CanFrame frame{id, length, {}};
  std::fill_n(frame.data.begin(), length, std::uint8_t{0x5a});
  return frame;
}

Bus BusOf(std::uint32_t units, std::uint64_t seed = 1, const BusOptions& options = {}) {
  Bus bus(options, Rng(seed));
  for (std::uint32_t i = 0; i < units; ++i) bus.Attach();
  return bus;
}

std::vector<Bus::Heard> RunUntil(Bus* bus, HostInstant until) {
  std::vector<Bus::Heard> all;
  while (bus->NextEvent() <= until) {
    Bus::Heard heard;
    if (bus->Advance(&heard)) all.push_back(heard);
  }
  return all;
}

// ---- a small oracle: the counters of one node by the rules

struct OracleNode {
  int transmit = 0;
  int receive = 0;
  bool there = true;
  bool off = false;
  [[nodiscard]] bool hears() const { return there && !off; }
  [[nodiscard]] bool passive() const { return !off && (transmit > 127 || receive > 127); }
};

class Oracle {
 public:
  explicit Oracle(std::size_t nodes) : nodes_(nodes) {}
  std::vector<OracleNode>& nodes() { return nodes_; }

  // `bus` did something. The oracle takes the event from its counters, and nothing of how it counts
  // errors.
  void Follow(const BusCounters& before, const Bus& bus, std::size_t sender) {
    const BusCounters after = bus.counters();
    for (OracleNode& node : nodes_)
      if (after.controllers.recovered > before.controllers.recovered && node.off &&
          bus.node(IndexOf(node)).hears()) {
        node.off = false;
        node.transmit = node.receive = 0;
      }
    std::size_t kind = 0;
    for (std::size_t k = 1; k < kFrameErrorCount; ++k)
      if (after.wire.errors[k] > before.wire.errors[k]) kind = k;
    const bool passed =
        after.host_frames + after.unit_frames > before.host_frames + before.unit_frames;
    if (kind == 0 && passed) Well(sender, bus);
    if (kind != 0) Error(static_cast<FrameError>(kind), passed, sender, bus);
  }

  void ExpectSame(const Bus& bus, const std::string& when) const {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const auto node = static_cast<std::uint32_t>(i);
      const OracleNode& should = nodes_[i];
      ASSERT_EQ(bus.node(node).hears(), should.hears()) << when << " node " << i;
      if (should.off) {
        ASSERT_EQ(bus.node(node).state(), Confinement::kOff) << when << " node " << i;
        continue;
      }
      ASSERT_EQ(bus.node(node).errors.transmit(), static_cast<unsigned>(should.transmit))
          << when << " node " << i;
      ASSERT_EQ(bus.node(node).errors.receive(),
                static_cast<unsigned>(std::min(should.receive, 255)))
          << when << " node " << i;
      ASSERT_EQ(bus.node(node).state() == Confinement::kPassive, should.passive())
          << when << " " << i;
    }
  }

 private:
  [[nodiscard]] std::uint32_t IndexOf(const OracleNode& node) const {
    return static_cast<std::uint32_t>(&node - nodes_.data());
  }
  void Well(std::size_t sender, const Bus& bus) {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      OracleNode& node = nodes_[i];
      if (!node.hears()) continue;
      if (i == sender) {
        node.transmit = std::max(node.transmit - 1, 0);  // rule 7
      } else if (node.receive > 127) {                   // rule 8: any of 119..127
        node.receive = static_cast<int>(bus.node(IndexOf(node)).errors.receive());
        EXPECT_GE(node.receive, 119);
        EXPECT_LE(node.receive, 127);
      } else {
        node.receive = std::max(node.receive - 1, 0);
      }
    }
  }
  void Error(FrameError kind, bool passed, std::size_t sender, const Bus& bus) {
    const auto hearing = std::ranges::count_if(nodes_, [](const auto& n) { return n.hears(); });
    OracleNode& from = nodes_[sender];
    if (kind == FrameError::kStuff) {
      // In arbitration the sender sees the error as a receiver, or by exception 2 not at all.
      const int more =
          static_cast<int>(bus.node(IndexOf(from)).errors.receive()) - std::min(from.receive, 255);
      EXPECT_TRUE(more == 0 || more == 1);
      from.receive += more;
    } else if (kind != FrameError::kAcknowledgement || hearing > 1 ||
               !from.passive()) {  // exception 1
      from.transmit += 8;
    }
    int refusing = 0;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      OracleNode& node = nodes_[i];
      if (i == sender || !node.hears()) continue;
      if (!passed) {
        node.receive += 1;
      } else if (bus.node(IndexOf(node)).errors.receive() != static_cast<unsigned>(node.receive)) {
        node.receive += 9;  // rules 1 and 2: the node that refused the frame that the others have
        ++refusing;
      }
    }
    EXPECT_LE(refusing, 1);
    from.off = from.off || from.transmit > 255;
  }

  std::vector<OracleNode> nodes_;
};

class RandomFaults {
 public:
  RandomFaults(std::uint64_t seed, std::uint32_t units)
      : rng_(seed), units_(units), bus_(BusOf(units, seed)), oracle_(units + 1) {}

  void Run(int rounds) {
    for (int round = 0; round < rounds; ++round) {
      Change();
      SendOne(round);
      if (::testing::Test::HasFatalFailure()) return;
    }
    const BusCounters c = bus_.counters();
    // All time is accounted for, to the bit.
    EXPECT_EQ((c.wire.busy + c.wire.idle).ns, ended_.ns);
    EXPECT_EQ(c.wire.busy.ns, static_cast<std::int64_t>(c.wire.bits + c.wire.error_bits) * kBit);
    EXPECT_EQ(c.wire.destroyed.ns, static_cast<std::int64_t>(c.wire.error_bits) * kBit);
  }
  [[nodiscard]] BusCounters counters() const { return bus_.counters(); }

 private:
  void Change() {
    constexpr double kRates[] = {0, 0, 1e-4, 1e-3, 1e-2, 3e-2};
    bus_.faults().bit_error_rate = kRates[rng_.Below(6)];
    bus_.faults().duplicate = rng_.Below(4) == 0 ? 0.2 : 0;
    const auto node = static_cast<std::uint32_t>(1 + rng_.Below(units_));
    OracleNode& should = oracle_.nodes()[node];
    if (rng_.Below(5) != 0) return;
    if (should.there) {
      bus_.disturb().PowerOff(node, ended_);
      should = {.there = false};
    } else {
      bus_.disturb().PowerOn(node, ended_);
      should = {};
    }
  }
  void SendOne(int round) {
    const auto sender = static_cast<std::uint32_t>(rng_.Below(units_ + 1));
    const HostInstant at = ended_ + Microseconds(static_cast<std::int64_t>(rng_.Below(2000)));
    if (oracle_.nodes()[sender].hears())
      bus_.Offer({FrameOf(static_cast<std::uint32_t>(rng_.Below(1u << 29)),
                          static_cast<std::uint8_t>(rng_.Below(9))),
                  sender != 0, sender},
                 at);
    // The bus runs until the frame is through, or a node is off after many attempts, or no node is
    // there.
    const std::string when = "round " + std::to_string(round);
    for (int i = 0; i < 80 && bus_.NextEvent() != kNever; ++i) {
      AdvanceOnce(sender, when);
      if (::testing::Test::HasFatalFailure()) return;
    }
    // A node that still tries gets another one between two attempts, and a bus without errors.
    if (bus_.waiting() > 0) {
      for (const auto busy = bus_.counters().wire.busy; busy == bus_.counters().wire.busy;)
        AdvanceOnce(sender, when);
      PowerOnSomebody();
    }
    bus_.faults() = {};
    while (bus_.NextEvent() != kNever) {
      AdvanceOnce(sender, when + " with company");
      if (::testing::Test::HasFatalFailure()) return;
    }
  }
  void AdvanceOnce(std::uint32_t sender, const std::string& when) {
    const BusCounters before = bus_.counters();
    const HostInstant now = bus_.NextEvent();
    Bus::Heard heard;
    bus_.Advance(&heard);
    if (bus_.counters().wire.busy.ns > before.wire.busy.ns) ended_ = now;
    oracle_.Follow(before, bus_, sender);
    oracle_.ExpectSame(bus_, when);
  }
  void PowerOnSomebody() {
    for (std::uint32_t node = 1; node <= units_; ++node) {
      if (oracle_.nodes()[node].there) continue;
      bus_.disturb().PowerOn(node, ended_);
      oracle_.nodes()[node] = {};
      return;
    }
  }

  Rng rng_;
  std::uint32_t units_;
  Bus bus_;
  Oracle oracle_;
  HostInstant ended_{0};  // end of the last frame
};

TEST(FaultConfinement, CountersAndTimeFollowTheRulesOnAnySequenceOfFaults) {
  const std::uint64_t first = focalfleet::test::TestSeed(51);
  std::uint64_t passive = 0;
  std::uint64_t off = 0;
  std::uint64_t back = 0;
  for (std::uint64_t seed = first; seed < first + 40; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    RandomFaults run(seed, 1 + static_cast<std::uint32_t>(seed % 5));
    run.Run(400);
    if (HasFatalFailure()) return;
    passive += run.counters().controllers.went_passive;
    off += run.counters().controllers.went_off;
    back += run.counters().controllers.recovered;
  }
  // The sequences must reach the passive and the off state often.
  EXPECT_GT(passive, 100u);
  EXPECT_GT(off, 20u);
  EXPECT_GT(back, 10u);
}

// ---- single rules

TEST(FaultConfinement, AFrameIsDestroyedWithTheProbabilityOfItsBits) {
  const std::uint64_t seed = focalfleet::test::TestSeed(52);
  FOCALFLEET_TRACE_SEED(seed);
  const CanFrame frame = FrameOf(0x12345);
  const double bits = ExposedBits(frame);
  for (const double rate : {1e-4, 5e-4}) {  // with more than one error in nine the sender goes off
    Bus bus = BusOf(2, seed);
    bus.faults().bit_error_rate = rate;
    constexpr int kFrames = 40'000;
    for (int i = 0; i < kFrames; ++i) {
      const HostInstant at{i * 10'000'000ll};
      bus.Offer({frame, false, 0}, at);
      RunUntil(&bus, at + Milliseconds(9));
    }
    const double lost = 1 - std::pow(1 - rate, bits);
    const auto attempts = static_cast<double>(kFrames + bus.counters().repeats);
    const double deviation = std::sqrt(attempts * lost * (1 - lost));
    EXPECT_NEAR(static_cast<double>(bus.counters().wire.error_frames()), attempts * lost,
                5 * deviation);
    EXPECT_EQ(bus.counters().host_frames, kFrames + bus.counters().received_twice);
  }
}

TEST(FaultConfinement, AloneOnTheBusTheHostGoesPassiveAndNeverOff) {
  Bus bus = BusOf(1);
  bus.disturb().PowerOff(1, {0});
  bus.Offer({FrameOf(7), false, 0}, {0});
  RunUntil(&bus, {Seconds(1).ns});
  EXPECT_EQ(bus.node(kHostNode).state(), Confinement::kPassive);
  EXPECT_EQ(bus.node(kHostNode).errors.transmit(), 128u);
  EXPECT_EQ(bus.waiting(), 1u);
  // Once the host is passive, each attempt costs its bits and the eight of suspend transmission.
  const std::int64_t attempt = (Unacknowledged(FrameOf(7)).bits + 8) * kBit;
  EXPECT_NEAR(static_cast<double>(bus.counters().wire.error_frames()),
              1e9 / static_cast<double>(attempt), 2);
  bus.disturb().PowerOn(1, {Seconds(1).ns});
  EXPECT_EQ(RunUntil(&bus, {Seconds(1).ns + 1'000'000}).size(), 1u) << "it gets through at last";
  EXPECT_EQ(bus.node(kHostNode).errors.transmit(), 127u);
  EXPECT_EQ(bus.node(kHostNode).state(), Confinement::kActive);
}

TEST(FaultConfinement, APassiveSenderLeavesEightBitsToTheOthers) {
  Bus bus = BusOf(2);
  bus.disturb().PowerOff(1, {0});
  bus.disturb().PowerOff(2, {0});
  bus.Offer({FrameOf(7), false, 0}, {0});
  RunUntil(&bus, {Milliseconds(100).ns});
  ASSERT_EQ(bus.node(kHostNode).state(), Confinement::kPassive);
  bus.disturb().PowerOn(1, {Milliseconds(100).ns});
  RunUntil(&bus, {Milliseconds(101).ns});
  // The host is active again for one more frame. Then it is passive, with two frames after one
  // another.
  for (int i = 0; i < 5; ++i) bus.Offer({FrameOf(9), false, 0}, {Milliseconds(200).ns});
  bus.faults().bit_error_rate = 1;
  while (bus.node(kHostNode).state() != Confinement::kPassive) {
    Bus::Heard heard;
    bus.Advance(&heard);
  }
  bus.faults().bit_error_rate = 0;
  const HostInstant error_over = bus.NextEvent();
  bus.Offer({FrameOf(1000), true, 1}, error_over + DurationNs{3 * kBit});
  const auto heard = RunUntil(&bus, error_over + Milliseconds(1));
  ASSERT_GE(heard.size(), 2u);
  EXPECT_TRUE(heard[0].sent.from_unit) << "its identifier is higher, but it did not have to wait";
  EXPECT_EQ((heard[0].at - error_over).ns, (3 + FrameBits(FrameOf(1000))) * kBit);
  EXPECT_EQ((heard[1].at - heard[0].at).ns, FrameBits(FrameOf(9)) * kBit) << "not suspended";
}

TEST(FaultConfinement, AUnitThatIsOffComesBackAfter128TimesElevenRecessiveBits) {
  Bus bus = BusOf(2);
  bus.faults().bit_error_rate = 1;
  bus.Offer({FrameOf(7), true, 1}, {0});
  while (bus.node(1).state() != Confinement::kOff) {
    ASSERT_LT(bus.NextEvent().ns, Seconds(1).ns);
    Bus::Heard heard;
    bus.Advance(&heard);
  }
  bus.faults().bit_error_rate = 0;
  const std::int64_t off_at = bus.counters().wire.busy.ns + bus.counters().wire.idle.ns;
  EXPECT_EQ(bus.NextEvent().ns, off_at + 128 * 11 * kBit);
  // Frames of other nodes count a row each: their end is eleven recessive bits.
  for (int i = 0; i < 50; ++i) bus.Offer({FrameOf(9), false, 0}, {off_at});
  const auto heard = RunUntil(&bus, {Seconds(2).ns});
  ASSERT_EQ(heard.size(), 51u);
  EXPECT_EQ(heard[50].sent.sender, 1u) << "what it wanted to say is not forgotten";
  EXPECT_EQ(heard[50].at.ns, off_at + 50 * FrameBits(FrameOf(9)) * kBit + 78 * 11 * kBit +
                                 FrameBits(FrameOf(7)) * kBit);
}

TEST(FaultConfinement, TheHostComesBackOnRequestOrByItself) {
  Bus bus = BusOf(1, 1, {.host_restart = DurationNs{kNever.ns}});
  bus.Offer({FrameOf(7), false, 0}, {0});
  bus.disturb().ThrowHostOff({50'000});
  EXPECT_EQ(bus.node(kHostNode).state(), Confinement::kOff);
  EXPECT_FALSE(bus.Offer({FrameOf(8), false, 0}, {60'000}));
  EXPECT_EQ(RunUntil(&bus, {Seconds(100).ns}).size(), 0u) << "cut off in mid-frame";
  EXPECT_EQ(bus.node(kHostNode).state(), Confinement::kOff);
  bus.disturb().RestartHost({Seconds(100).ns});
  RunUntil(&bus, {Seconds(100).ns + 128 * 11 * kBit - 1});
  EXPECT_EQ(bus.node(kHostNode).state(), Confinement::kOff);
  RunUntil(&bus, {Seconds(100).ns + 128 * 11 * kBit});
  EXPECT_EQ(bus.node(kHostNode).state(), Confinement::kActive);

  Bus other = BusOf(1, 1, {.host_restart = Milliseconds(20)});
  other.disturb().ThrowHostOff({0});
  RunUntil(&other, {Milliseconds(20).ns + 128 * 11 * kBit - 1});
  EXPECT_EQ(other.node(kHostNode).state(), Confinement::kOff);
  RunUntil(&other, {Milliseconds(20).ns + 128 * 11 * kBit});
  EXPECT_EQ(other.node(kHostNode).state(), Confinement::kActive);
}

TEST(FaultConfinement, ABabblerStarvesAllBelowItAndNobodyAbove) {
  Bus bus = BusOf(3);
  bus.disturb().Babble(2, FrameOf(100), {0});
  bus.Offer({FrameOf(200), false, 0}, {0});
  bus.Offer({FrameOf(99), true, 1}, {1'000'000});
  const auto heard = RunUntil(&bus, {Milliseconds(10).ns});
  EXPECT_EQ(bus.counters().babbled + 1, heard.size());
  EXPECT_EQ(bus.counters().wire.idle.ns, 0) << "no bit is left";
  const auto other = std::ranges::find(heard, 99u, [](const auto& h) { return h.sent.frame.id; });
  ASSERT_NE(other, heard.end());
  EXPECT_LE(other->at.ns, 1'000'000 + (FrameBits(FrameOf(100)) + FrameBits(FrameOf(99))) * kBit);
  EXPECT_EQ(bus.waiting(), 2u) << "the host's frame and the one on the wire";
  bus.disturb().Babble(2, std::nullopt, {Milliseconds(10).ns});
  EXPECT_EQ(RunUntil(&bus, {Milliseconds(20).ns}).back().sent.frame.id, 200u);
}

TEST(FaultConfinement, ABabblerNeverSendsBeforeItCan) {
  Bus bus = BusOf(3);
  constexpr std::int64_t kSecond = 1'000'000'000;
  bus.disturb().Babble(2, FrameOf(100), {kSecond});
  EXPECT_EQ(bus.NextEvent().ns, kSecond);
  RunUntil(&bus, {kSecond + 1'000'000});
  bus.disturb().PowerOff(2, {kSecond + 1'000'000});
  RunUntil(&bus, {2 * kSecond});
  bus.disturb().PowerOn(2, {2 * kSecond});
  EXPECT_EQ(bus.NextEvent().ns, 2 * kSecond);
  RunUntil(&bus, {2 * kSecond + 1'000'000});
  bus.disturb().Kill({2 * kSecond + 1'000'000});
  EXPECT_EQ(bus.NextEvent(), kNever);
  bus.disturb().Revive({3 * kSecond});
  EXPECT_EQ(bus.NextEvent().ns, 3 * kSecond);
}

TEST(FaultConfinement, ADominantWireThrowsTheSenderOffAndMakesAllOthersPassive) {
  Bus bus = BusOf(3);
  bus.Offer({FrameOf(7), true, 1}, {0});
  Bus::Heard heard;
  bus.Advance(&heard);
  bus.disturb().Stick({40'000});
  RunUntil(&bus, {Seconds(1).ns});
  EXPECT_EQ(bus.NextEvent(), kNever);
  EXPECT_EQ(bus.node(1).state(), Confinement::kOff);
  for (const std::uint32_t node : {0u, 2u, 3u})
    EXPECT_EQ(bus.node(node).state(), Confinement::kPassive);
  bus.disturb().Release({Seconds(1).ns});
  const std::int64_t over = Seconds(1).ns + 11 * kBit;
  EXPECT_EQ(bus.NextEvent().ns, over + 128 * 11 * kBit) << "only recessive bits count";
  ASSERT_EQ(RunUntil(&bus, {Seconds(2).ns}).size(), 1u);
  EXPECT_EQ(bus.node(1).state(), Confinement::kActive);
  EXPECT_EQ(bus.node(2).errors.receive(), 119u);
  const BusCounters c = bus.counters();
  EXPECT_EQ(c.wire.stuck.ns, over - 40'000);
  EXPECT_EQ((c.wire.busy + c.wire.idle).ns, over + 128 * 11 * kBit + FrameBits(FrameOf(7)) * kBit);
}

TEST(FaultConfinement, AUnitWhoseSupplyFailsInMidFrameCostsTheOthersAnErrorFrame) {
  Bus bus = BusOf(2);
  bus.Offer({FrameOf(7), true, 1}, {0});
  bus.Offer({FrameOf(9), false, 0}, {0});
  Bus::Heard heard;
  bus.Advance(&heard);
  bus.disturb().PowerOff(1, {60'000});
  const auto all = RunUntil(&bus, {Seconds(1).ns});
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].at.ns, (CutOffAt(FrameOf(7), 60).bits + FrameBits(FrameOf(9))) * kBit);
  EXPECT_EQ(bus.node(2).errors.receive(), 0u) << "one up, one down";
  EXPECT_EQ(bus.node(kHostNode).errors.receive(), 1u);
}

TEST(FaultConfinement, AnUnpluggedUnitKeepsWhatItsMailboxesHoldAndIsPassiveWhenItIsBack) {
  Bus bus = BusOf(2);
  bus.disturb().Unplug(1, {0});
  for (std::uint32_t i = 0; i < 5; ++i) bus.Offer({FrameOf(10 + i), true, 1}, {0});
  EXPECT_EQ(RunUntil(&bus, {Seconds(1).ns}).size(), 0u);
  EXPECT_EQ(bus.counters().mailboxes.refused, 2u);
  bus.disturb().Plug(1, {Seconds(1).ns});
  EXPECT_EQ(bus.node(1).state(), Confinement::kPassive);
  EXPECT_EQ(RunUntil(&bus, {Seconds(2).ns}).size(), 3u);
  EXPECT_EQ(bus.node(1).errors.transmit(), 125u);
}

TEST(FaultConfinement, ADoubledFrameIsHeardTwiceByAllButTheOneThatRefusedIt) {
  Bus bus = BusOf(3);
  bus.faults().duplicate = 1;
  bus.Offer({FrameOf(7), false, 0}, {0});
  Bus::Heard first;
  while (!bus.Advance(&first)) {
  }
  bus.faults().duplicate = 0;
  const auto rest = RunUntil(&bus, {Seconds(1).ns});
  ASSERT_EQ(rest.size(), 1u);
  EXPECT_NE(first.but_not, kNoNode);
  EXPECT_NE(first.but_not, kHostNode);
  EXPECT_EQ(rest[0].but_not, kNoNode);
  EXPECT_EQ(rest[0].at.ns, (RefusedByOne(FrameOf(7)).bits + FrameBits(FrameOf(7))) * kBit);
}

}  // namespace
}  // namespace focalfleet::sim
