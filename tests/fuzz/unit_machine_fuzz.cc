// The test runs the unit's side of the protocol alone, as a board would run it. The host may send
// anything at any time, and the power supply may go at any time. The input is records of 12 bytes:
// event (1), delay (1), function and address (1), length and sequence (1), data (8). Staging frames
// may come in CAN FD groups. For any input the unit obeys these rules:
//
//   it answers in well-formed frames of its own node, an addressed request at most once, with that
//   request's sequence number;
//   it runs a motor only with the mark kept in FLASH, and no move twice in a row;
//   its FLASH after a power cut is a possible one, and a cut in motion is reported.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "protocol/base/check.h"
#include "protocol/base/limits.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/stage_group.h"
#include "sim/world/unit/unit_machine.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kRecord = 12;
constexpr std::size_t kRecordsMax = 200;
constexpr NodeId kNode{1};
constexpr std::int64_t kNsPerVector = 100'000;

struct Motor {
  bool running = false;
  std::int32_t from = 0;
  std::int32_t to = 0;
  BoardInstant begin;
  BoardInstant end;
  [[nodiscard]] std::int32_t At(BoardInstant now) const {
    if (!running || now >= end) return to;
    if (now <= begin) return from;
    const double share =
        static_cast<double>((now - begin).ns) / static_cast<double>((end - begin).ns);
    return from + static_cast<std::int32_t>(share * (static_cast<double>(to) - from));
  }
};

class Bench {
 public:
  Bench() : flash_(FirstFlash()), kept_(flash_), machine_(kNode, MakeBoard(), &flash_) {
    PowerOn();
  }

  void Give(const CanFrame& frame) {
    const bool powered = machine_.powered();
    const auto request = DecodeHost(frame);
    TransmitQueue out;
    machine_.OnFrame(frame, now_, &out);
    const bool to_it =
        request && (request->address.node == kNode || request->address.node == kBroadcastNode);
    FOCALFLEET_CHECK(out.frames().size() <= (powered && to_it ? 1u : 0u));
    for (const CanFrame& answer : out.frames()) {
      const auto message = DecodeUnit(answer);
      FOCALFLEET_CHECK(message && message->address == Address({kNode, request->address.sequence}));
    }
    CheckAll();
  }
  /// Collects frames for a group; a frame that no group carries comes alone, as a port would send
  /// it.
  void Collect(const CanFrame& frame) {
    if (!CanBeGrouped(frame)) return Give(frame);
    if (collected_.size() < kGroupEntriesMax) collected_.push_back(frame);
  }
  /// Delivers the collected frames as a group; any bytes where there are none.
  void GiveGroup(std::span<const std::uint8_t> bytes) {
    FdFrame group{.id = kGroupId};
    if (collected_.empty()) {
      group.length = FdLength(std::min(bytes.size(), group.data.size()));
      std::copy_n(bytes.begin(), std::min<std::size_t>(bytes.size(), group.length),
                  group.data.begin());
    } else {
      PackGroup(collected_, &group);
      collected_.clear();
    }
    const auto entries = UnpackGroup(group);
    const bool powered = machine_.powered();
    TransmitQueue out;
    machine_.OnGroup(group, now_, &out);
    FOCALFLEET_CHECK(out.frames().size() <= (powered && entries ? entries->count : 0u));
    for (const CanFrame& answer : out.frames()) {
      const auto message = DecodeUnit(answer);
      FOCALFLEET_CHECK(message && message->address.node == kNode);
    }
    CheckAll();
  }
  /// Acts as an honest host: reads back, then arms by the digest that it read.
  void ArmWhatIsHeld(MoveId move) {
    TransmitQueue out;
    machine_.OnFrame(Encode(HostMessage{Confirm{move}}, {kNode, 3}), now_, &out);
    if (out.frames().empty()) return;
    const auto reply = DecodeUnit(out.frames()[0]);
    const auto& confirm = std::get<ConfirmReply>(reply->message);
    Give(Encode(HostMessage{Arm{move, confirm.digest}}, {kNode, 4}));
  }
  /// Lets time pass by `pause`, or to the deadline where that comes first.
  void Pass(DurationNs pause) {
    const BoardInstant until = now_ + pause;
    for (int i = 0; i < 8 && machine_.deadline() <= until; ++i) {
      now_ = std::max(now_, machine_.deadline());
      TransmitQueue out;
      machine_.OnTime(now_, &out);
      for (const CanFrame& said : out.frames()) {
        const auto message = DecodeUnit(said);
        FOCALFLEET_CHECK(message && message->address == Address({kNode, 0}));
        FOCALFLEET_CHECK(std::holds_alternative<Done>(message->message));
      }
      CheckAll();
    }
    now_ = std::max(now_, until);
  }
  void Trip(FaultCode code, Axis axis) {
    TransmitQueue out;
    machine_.RaiseFault({code, axis}, now_, &out);
    CheckAll();
  }
  void CutPower() {
    if (!machine_.powered()) return;
    const bool ran = machine_.runs();
    machine_.PowerOff();
    for (Motor& motor : motor_) motor = {.to = motor.At(now_)};
    flash_ = kept_;  // the RAM is lost
    FOCALFLEET_CHECK(!ran || flash_.moving);
  }
  void PowerOn() {
    if (machine_.powered()) return;
    machine_.PowerOn(now_);
    FOCALFLEET_CHECK(!flash_.moving || machine_.interrupted());
    begun_ = flash_.moves_begun;
    last_ = flash_.last_begun;
  }

 private:
  static Flash FirstFlash() {
    Flash flash;
    flash.serial = {4711};
    for (AxisFlash& axis : flash.axis) {
      axis.min_position = -9600;
      axis.max_position = 9600;
      axis.home_position = 9600;
    }
    return flash;
  }

  void CheckAll() {
    FOCALFLEET_CHECK(kept_ == flash_);
    for (const AxisFlash& axis : flash_.axis) {
      FOCALFLEET_CHECK(axis.subdivision > 0 && axis.vector < axis.subdivision && axis.repeat > 0);
      FOCALFLEET_CHECK(std::abs(axis.position()) <= limits::kPositionMax);
      FOCALFLEET_CHECK(axis.min_position <= axis.max_position);
    }
    FOCALFLEET_CHECK(!machine_.runs() || flash_.moving);
    FOCALFLEET_CHECK(machine_.runs() || (!motor_[0].running && !motor_[1].running));
    FOCALFLEET_CHECK(machine_.deadline() >= now_ || machine_.powered());
    if (begun_ == flash_.moves_begun) return;
    FOCALFLEET_CHECK(flash_.moves_begun == begun_ + 1 && flash_.last_begun != last_);
    begun_ = flash_.moves_begun;
    last_ = flash_.last_begun;
  }

  static Bench& Of(void* context) { return *static_cast<Bench*>(context); }
  Board MakeBoard() {
    return {.context = this,
            .energise =
                [](void* c, Axis axis, Field field) {
                  FOCALFLEET_CHECK(field.subdivision > 0);
                  Of(c).motor_[Index(axis)] = {.to = field.position};
                },
            .run = &Run,
            .halt =
                [](void* c, Axis axis, BoardInstant now) {
                  Motor& motor = Of(c).motor_[Index(axis)];
                  motor = {.to = motor.At(now)};
                },
            .applied = [](void* c, Axis axis,
                          BoardInstant now) { return Of(c).motor_[Index(axis)].At(now); },
            .recount = [](void* c, Axis axis,
                          std::int32_t position) { Of(c).motor_[Index(axis)] = {.to = position}; },
            .after = [](void*, BoardInstant from, DurationNs duration) { return from + duration; },
            .ticks = [](void*,
                        BoardInstant now) { return static_cast<std::uint32_t>(now.ns / kTick.ns); },
            .keep = [](void* c) { Of(c).kept_ = Of(c).flash_; }};
  }
  static BoardInstant Run(void* c, Axis axis, PathOrder order) {
    FOCALFLEET_CHECK(Of(c).kept_.moving && order.count <= limits::kSegmentsPerAxis);
    Motor& motor = Of(c).motor_[Index(axis)];
    motor = {.running = true, .from = order.from, .to = order.from, .begin = order.begin};
    std::int64_t way = 0;
    for (std::size_t i = 0; i < order.count; ++i) {
      motor.to += order.segments[i].delta;
      way += std::abs(std::int64_t{order.segments[i].delta});
    }
    motor.end = order.begin + DurationNs{way * kNsPerVector};
    return motor.end;
  }

  Flash flash_;
  Flash kept_;
  Motor motor_[kAxisCount];
  UnitMachine machine_;
  std::vector<CanFrame> collected_;
  BoardInstant now_{0};
  std::uint32_t begun_ = 0;
  MoveId last_;
};

// A known function in the host's direction for this unit or for all, with any length, detail and
// data; now and then any identifier.
CanFrame FrameOf(const std::uint8_t* record) {
  CanFrame frame;
  frame.length = static_cast<std::uint8_t>((record[3] & 15u) % 10);
  std::memcpy(frame.data.data(), record + 4, 8);
  if (record[0] == 255) {
    std::memcpy(&frame.id, record + 4, 4);
    return frame;
  }
  const auto function = static_cast<Function>(record[2] % kFunctionCount);
  const NodeId node = (record[2] & 0x80u) != 0 ? kBroadcastNode : kNode;
  const auto sequence = static_cast<std::uint8_t>(record[3] >> 4);
  const auto detail = static_cast<std::uint8_t>((record[2] & 0x40u) != 0 ? 1 : 0);
  frame.id = Pack({function, false, {node, sequence}, detail});
  return frame;
}

}  // namespace
}  // namespace focalfleet::sim

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace sim = focalfleet::sim;
  sim::Bench bench;
  for (std::size_t i = 0; i < sim::kRecordsMax && size >= sim::kRecord;
       ++i, data += sim::kRecord, size -= sim::kRecord) {
    switch (data[0] % 16) {
      case 0:
        bench.CutPower();
        break;
      case 1:
        bench.PowerOn();
        break;
      case 2:
        bench.Trip(static_cast<focalfleet::FaultCode>(data[2] % focalfleet::kFaultCodeCount),
                   static_cast<focalfleet::Axis>(data[3] % 2));
        break;
      case 3:
        bench.ArmWhatIsHeld({static_cast<std::uint16_t>(data[4] | data[5] << 8)});
        break;
      case 4:
        bench.Collect(sim::FrameOf(data));
        break;
      case 5:
        bench.GiveGroup({data + 4, size - 4});
        break;
      default:
        bench.Give(sim::FrameOf(data));
    }
    // Delays reach from none to beyond the host's time-out.
    if (data[1] % 18 != 0)
      bench.Pass(focalfleet::Microseconds(100) * (std::int64_t{1} << (data[1] % 18)));
  }
  return 0;
}
