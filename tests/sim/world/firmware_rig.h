// The firmware of a single unit on the bench: its FLASH and its axes, without a bus. The test hands
// in frames and lets time pass.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "protocol/wire/codec.h"
#include "protocol/wire/staged_move.h"
#include "sim/world/unit/firmware.h"
#include "tests/sim/drive/bench_motor.h"

namespace focalfleet::sim::test {

inline constexpr double kBenchGear = 100;
inline constexpr std::int32_t kBenchMin = -9600;  // one output turn is 9600 vectors
inline constexpr std::int32_t kBenchMax = 9600;

class FirmwareRig {
 public:
  static constexpr NodeId kNode{9};

  explicit FirmwareRig(double clock_rate = 1, const Firmware::Hardware::Joint& joint = {})
      : axes_{AxisModel(Traits(), &BenchMotor(), AxisModel::Start{0, 96, kBenchGear}),
              AxisModel(Traits(), &BenchMotor(), AxisModel::Start{960, 96, kBenchGear})},
        firmware_({kNode, {clock_rate}, &flash_, {&axes_[0], &axes_[1]}, &faults_, joint}) {
    flash_.serial = {4711};
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      flash_.axis[i].min_position = kBenchMin;
      flash_.axis[i].max_position = kBenchMax;
      flash_.axis[i].home_position = i == 0 ? kBenchMin : kBenchMax;
    }
    flash_.axis[1].set_position(960);
    firmware_.PowerOn(now_);
  }
  FirmwareRig(const FirmwareRig&) = delete;
  FirmwareRig& operator=(const FirmwareRig&) = delete;

  Flash& flash() { return flash_; }
  UnitFaults& faults() { return faults_; }
  Firmware& firmware() { return firmware_; }
  AxisModel& axis(Axis which) { return axes_[Index(which)]; }
  [[nodiscard]] HostInstant now() const { return now_; }
  [[nodiscard]] UnitState state() const { return firmware_.state(); }
  [[nodiscard]] double AngleDeg(Axis which) const { return axes_[Index(which)].AngleDeg(now_); }

  /// Lets time pass from deadline to deadline, and returns the frames that the unit sent unasked.
  std::vector<CanFrame> Run(DurationNs duration) {
    std::vector<CanFrame> said;
    const HostInstant end = now_ + duration;
    while (firmware_.deadline() <= end) {
      now_ = std::max(now_, firmware_.deadline());
      TransmitQueue out;
      firmware_.OnTime(now_, &out);
      said.insert(said.end(), out.frames().begin(), out.frames().end());
    }
    now_ = end;
    return said;
  }
  std::vector<CanFrame> Give(const CanFrame& frame) {
    TransmitQueue out;
    firmware_.OnFrame(frame, now_, &out);
    return {out.frames().begin(), out.frames().end()};
  }
  std::vector<CanFrame> Give(const HostMessage& message, std::uint8_t sequence = 1,
                             NodeId node = kNode) {
    return Give(Encode(message, {node, sequence}));
  }
  /// The answer to a message. None: there is no answer, more than one, or one of another kind.
  template <class M>
  std::optional<M> Ask(const HostMessage& message, std::uint8_t sequence = 1) {
    const auto frames = Give(message, sequence);
    if (frames.size() != 1) return std::nullopt;
    const auto decoded = DecodeUnit(frames[0]);
    if (!decoded || !std::holds_alternative<M>(decoded->message)) return std::nullopt;
    if (decoded->address != Address{kNode, sequence}) return std::nullopt;
    return std::get<M>(decoded->message);
  }

  void Stage(const StagedMove& move) {
    Give(StageBegin{move.move, {move.path[0].size(), move.path[1].size()}, move.mode});
    for (const Axis which : kAxes) {
      std::uint8_t index = 0;
      for (const Segment& segment : move.path[Index(which)].segments())
        Give(StageSegment{which, index++, segment});
    }
  }
  std::optional<Answer> StageAndArm(const StagedMove& move, std::uint8_t sequence = 1) {
    Stage(move);
    const auto reply = Ask<ArmReply>(Arm{move.move, Digest(move)}, sequence);
    return reply ? std::optional(reply->answer) : std::nullopt;
  }
  void StartAll(MoveId move, std::uint32_t delay_ticks) {
    Give(focalfleet::Start{move, delay_ticks}, 1, kBroadcastNode);
  }
  void PulseSync() {
    TransmitQueue out;
    firmware_.OnSync(now_, &out);
  }
  void CutPower() { firmware_.PowerOff(now_); }
  void GivePower() { firmware_.PowerOn(now_); }

  static AxisTraits Traits() {
    AxisTraits traits;
    traits.gear = kBenchGear;
    traits.stop_low_deg = (kBenchMin - 24) * 360.0 / (96 * kBenchGear);
    traits.stop_high_deg = (kBenchMax + 24) * 360.0 / (96 * kBenchGear);
    return traits;
  }

 private:
  Flash flash_;
  UnitFaults faults_;
  std::array<AxisModel, kAxisCount> axes_;
  Firmware firmware_;
  HostInstant now_{1'000'000};
};

inline constexpr std::uint16_t kMove = 7;  // the move that is staged or runs
inline constexpr std::uint16_t kNew = 8;

inline StagedMove BenchMove(std::uint16_t id, std::int32_t theta = 400, std::int32_t phi = -300) {
  StagedMove move{{id}, WaveMode::kAsymmetric, {}};
  move.path[0].Append({0, theta, 108});
  move.path[1].Append({50, phi, 108});
  return move;
}

template <class M>
M Get(const CanFrame& frame) {
  const auto decoded = DecodeUnit(frame);
  EXPECT_TRUE(decoded && std::holds_alternative<M>(decoded->message));
  return decoded && std::holds_alternative<M>(decoded->message) ? std::get<M>(decoded->message)
                                                                : M{};
}

}  // namespace focalfleet::sim::test
