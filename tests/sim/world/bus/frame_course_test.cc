#include "sim/world/bus/frame_course.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "protocol/base/rng.h"
#include "protocol/wire/frame_bits.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

// A transmitter and two receivers go bit by bit over a wired AND: the levels that each drives and
// sees. The model has the frame as a string of levels and the rules of error signalling, and no
// formula.
class BitByBit {
 public:
  BitByBit(const CanFrame& frame, bool passive) : passive_(passive) {
    const FrameLevels levels = LevelsOf(frame);
    for (std::uint32_t i = 0; i < levels.bits; ++i)
      sent_ += levels.recessive[i] ? (levels.stuff[i] ? 'R' : 'r') : 'd';
    arbitration_ = levels.arbitration;
    slot_ = sent_.size() + 1;
    end_ = sent_.size() + 10;
  }

  FrameCourse Run(std::uint32_t disturbed) {
    FrameCourse course;
    std::uint32_t last_dominant = 0;
    for (std::uint32_t t = 0; t < 400; ++t) {
      bool level = Drives(t) && Receives(t);
      if (t == disturbed) level = !level;
      row_ = t > 0 && level == before_ ? row_ + 1 : 1;
      before_ = level;
      const bool was_flagging = sender_flags_ > t || receiver_flags_ > t;
      if (was_flagging) last_dominant = t;
      Sender(t, level, &course);
      Receiver(t, level, &course);
      if (Done(t)) break;
    }
    course.bits = last_dominant + 1 + 8 + 3;
    return course;
  }

 private:
  static constexpr std::uint32_t kNotYet = 0;
  [[nodiscard]] bool Drives(std::uint32_t t) const {
    if (sender_flags_ != kNotYet) return passive_ || t >= sender_flags_;
    if (lost_ || t >= sent_.size()) return true;
    return sent_[t] != 'd';
  }
  [[nodiscard]] bool Receives(std::uint32_t t) const {
    if (receiver_flags_ != kNotYet) return t >= receiver_flags_;
    return t != slot_ || crc_wrong_;
  }
  void Sender(std::uint32_t t, bool level, FrameCourse* course) {
    if (sender_flags_ != kNotYet || t >= end_) return;
    FrameError error = FrameError::kNone;
    if (lost_) {
      if (row_ >= 6) error = FrameError::kStuff;
    } else if (t == slot_) {
      if (level) error = FrameError::kAcknowledgement;
    } else if (t > sent_.size() || t == sent_.size()) {
      if (!level) error = FrameError::kForm;
    } else if (level != (sent_[t] != 'd')) {
      if (!level && t < arbitration_ && sent_[t] == 'r') {
        lost_ = course->lost_arbitration = true;
        return;
      }
      course->excused = !level && t < arbitration_;
      error = course->excused ? FrameError::kStuff : FrameError::kBit;
    }
    if (error == FrameError::kNone) return;
    course->error = error;
    sender_flags_ = t + 1 + 6;
  }
  void Receiver(std::uint32_t t, bool level, FrameCourse* course) {
    if (t < sent_.size() && level != (sent_[t] != 'd')) crc_wrong_ = true;
    if (receiver_flags_ != kNotYet || t >= end_) return;
    bool error = false;
    bool accepted = false;
    if (t < sent_.size()) {
      error = row_ >= 6;
    } else if (t == slot_) {
      error = level && !crc_wrong_;  // its own acknowledgement is missing
    } else if (t == slot_ + 1) {
      error = !level || crc_wrong_;
    } else {
      error = !level;
      accepted = t + 1 == end_;
    }
    if (!error) return;
    course->accepted = accepted;
    receiver_flags_ = t + 1 + 6;
  }
  [[nodiscard]] bool Done(std::uint32_t t) const {
    return sender_flags_ != kNotYet && receiver_flags_ != kNotYet && t + 1 >= sender_flags_ &&
           t + 1 >= receiver_flags_;
  }

  std::string sent_;  // r, R (stuff), d
  bool passive_;
  std::size_t arbitration_ = 0;
  std::size_t slot_ = 0;
  std::size_t end_ = 0;
  std::uint32_t row_ = 0;
  bool before_ = true;
  bool lost_ = false;
  bool crc_wrong_ = false;
  std::uint32_t sender_flags_ = kNotYet;  // the bit behind its flag
  std::uint32_t receiver_flags_ = kNotYet;
};

CanFrame AnyFrame(Rng* rng) {
  CanFrame frame{static_cast<std::uint32_t>(rng->Below(1u << 29)),
                 static_cast<std::uint8_t>(rng->Below(9)),
                 {}};
  if (rng->Below(3) == 0) frame.id = rng->Below(2) != 0 ? 0x1fffffffu : 0u;
  for (int k = 0; k < frame.length; ++k)
    frame.data[static_cast<std::size_t>(k)] =
        static_cast<std::uint8_t>(rng->Below(2) != 0 ? 0xff * rng->Below(2) : rng->Below(256));
  return frame;
}

TEST(FrameCourse, EveryDisturbedBitCostsWhatNodesThatSignalItBitByBitTake) {
  const std::uint64_t seed = focalfleet::test::TestSeed(41);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  std::array<int, 13> flags{};
  for (int i = 0; i < 300; ++i) {
    const CanFrame frame = AnyFrame(&rng);
    for (const bool passive : {false, true}) {
      for (std::uint32_t at = 0; at < ExposedBits(frame); ++at) {
        const FrameCourse is = DisturbedAt(frame, at, passive);
        const FrameCourse should = BitByBit(frame, passive).Run(at);
        ASSERT_EQ(is.bits, should.bits) << at << " of " << ExposedBits(frame) << " " << passive;
        ASSERT_EQ(is.error, should.error) << at << " of " << ExposedBits(frame);
        ASSERT_EQ(is.accepted, should.accepted) << at;
        ASSERT_EQ(is.excused, should.excused) << at;
        ASSERT_EQ(is.lost_arbitration, should.lost_arbitration) << at;
        if (!is.lost_arbitration && !passive) ++flags[is.bits - (at + 1) - 8 - 3];
      }
    }
  }
  for (std::size_t length = 6; length <= 12; ++length) EXPECT_GT(flags[length], 0) << length;
}

TEST(FrameCourse, WithoutAnAcknowledgementItEndsBehindTheSlot) {
  const CanFrame frame{0x1abcdef, 8, {1, 2, 3, 4, 5, 6, 7, 8}};
  // The good frame's acknowledgement delimiter, end of frame and intermission are missing.
  EXPECT_EQ(Unacknowledged(frame).bits, FrameBits(frame) - 1 - 7 - 3 + 6 + 8 + 3);
  EXPECT_FALSE(Unacknowledged(frame).accepted);
}

TEST(FrameCourse, AReceiverThatRefusesInTheLastBitCostsOneMoreThanAnErrorThere) {
  const CanFrame frame{0x1abcdef, 2, {1, 2}};
  EXPECT_EQ(RefusedByOne(frame).bits, FrameBits(frame) - 3 - 1 + 7 + 8 + 3);
  EXPECT_TRUE(RefusedByOne(frame).accepted);
}

TEST(FrameCourse, WhoeverIsCutOffIsNoticedByTheSixthRecessiveBit) {
  const CanFrame frame{0, 0, {}};  // SOF and eleven dominant bits: stuffed behind every fifth
  EXPECT_EQ(CutOffAt(frame, 0).bits, 6u + 6 + 8 + 3);
  EXPECT_EQ(CutOffAt(frame, 6).bits, 6 + 5 + 6 + 8 + 3u) << "the stuff bit was recessive, too";
}

}  // namespace
}  // namespace focalfleet::sim
