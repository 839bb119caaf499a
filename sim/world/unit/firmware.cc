#include "sim/world/unit/firmware.h"

#include <algorithm>
#include <span>
#include <utility>

#include "sim/world/axis/field_path.h"

namespace focalfleet::sim {

Firmware::Firmware(const Hardware& hardware)
    : hardware_(hardware), machine_(hardware.node, MakeBoard(), hardware.flash) {}

// ---- the board

Board Firmware::MakeBoard() {
  static constexpr auto kAxisOf = [](void* context, Axis axis) -> AxisModel& {
    return *static_cast<Firmware*>(context)->hardware_.axis[Index(axis)];
  };
  return {
      .context = this,
      .energise =
          [](void* context, Axis axis, Field field) {
            kAxisOf(context, axis).Energise({field.position, field.subdivision});
          },
      .run =
          [](void* context, Axis axis, PathOrder order) {
            const UnitClock clock = static_cast<Firmware*>(context)->hardware_.clock;
            const FieldPath path({order.from, order.begin, clock, order.counter1},
                                 std::span(order.segments, order.count));
            kAxisOf(context, axis).Run(path);
            return path.end();
          },
      .halt = [](void* context, Axis axis, BoardInstant now) { kAxisOf(context, axis).Halt(now); },
      .applied = [](void* context, Axis axis,
                    BoardInstant now) { return kAxisOf(context, axis).Applied(now); },
      .recount = [](void* context, Axis axis,
                    std::int32_t position) { kAxisOf(context, axis).Recount(position); },
      .after =
          [](void* context, BoardInstant from, DurationNs duration) {
            const UnitClock clock = static_cast<Firmware*>(context)->hardware_.clock;
            return from + clock.ToHost(static_cast<double>(duration.ns));
          },
      .ticks =
          [](void* context, BoardInstant now) {
            const auto& firmware = *static_cast<Firmware*>(context);
            const double unit_ns = firmware.hardware_.clock.ToUnitNs(now - firmware.powered_at_);
            return static_cast<std::uint32_t>(
                static_cast<std::uint64_t>(unit_ns / static_cast<double>(kTick.ns)));
          },
      .sensors = hardware_.joint.sensors,
      .sense =
          [](void* context, BoardInstant now, std::uint16_t* counts) {
            auto& firmware = *static_cast<Firmware*>(context);
            firmware.Sense(now, {counts, firmware.hardware_.joint.sensors});
          },
      // A simulated FLASH keeps a value as soon as it is written.
      .keep = [](void*) {},
  };
}

void Firmware::Sense(HostInstant now, std::span<std::uint16_t> counts) {
  const Hardware::Joint& joint = hardware_.joint;
  const std::complex<double> tip = FibreAt(*joint.mechanism, {hardware_.axis[0]->AngleDeg(now),
                                                              hardware_.axis[1]->AngleDeg(now)}) -
                                   joint.mechanism->base_mm;
  joint.magnets->Read(joint.unit, readings_++, {tip.real(), tip.imag(), joint.fibre_carrier_mm},
                      counts);
  if (!hardware_.faults->sensor) return;
  using Kind = UnitFaults::Sensor::Kind;
  const UnitFaults::Sensor& lies = *hardware_.faults->sensor;
  if (lies.sensor >= counts.size() || lies.other >= counts.size()) return;
  std::uint16_t& count = counts[lies.sensor];
  constexpr int kMiddle = kFullCount / 2;
  switch (lies.kind) {
    case Kind::kStuck:
      count = 20'000;
      break;
    case Kind::kSaturated:
      count = kFullCount;
      break;
    case Kind::kMissing:
      count = kNoCount;
      break;
    case Kind::kSwapped:
      std::swap(count, counts[lies.other]);
      break;
    case Kind::kGain:
      count = static_cast<std::uint16_t>(kMiddle + (count - kMiddle) * 7 / 10);
      break;
  }
}

// ---- power, frames and time

void Firmware::PowerOn(HostInstant now) {
  if (powered()) return;
  powered_at_ = now;
  trip_at_ = kNever;
  motions_seen_ = hardware_.flash->moves_begun;
  machine_.PowerOn(now);
}

void Firmware::PowerOff(HostInstant now) {
  if (!powered()) return;
  for (AxisModel* axis : hardware_.axis) axis->Release(now);
  machine_.PowerOff();
}

HostInstant Firmware::deadline() const {
  return powered() ? std::min(machine_.deadline(), trip_at_) : kNever;
}

void Firmware::OnFrame(const CanFrame& frame, HostInstant now, TransmitQueue* out) {
  if (Withheld(frame, now, out)) return;
  TransmitQueue said;
  machine_.OnFrame(frame, now, &said);
  FollowMotion();
  Pass(said, Cause::kFrame, out);
}

void Firmware::OnTime(HostInstant now, TransmitQueue* out) {
  TripIfDue(now, out);
  TransmitQueue said;
  machine_.OnTime(now, &said);
  FollowMotion();
  Pass(said, Cause::kTime, out);
  TripIfDue(now, out);
}

void Firmware::OnSync(HostInstant now, TransmitQueue* out) {
  OnTime(now, out);
  machine_.OnSync(now);
  FollowMotion();
}

void Firmware::RaiseFault(const Trip& trip, HostInstant now, TransmitQueue* out) {
  TransmitQueue said;
  machine_.RaiseFault(trip, now, &said);
  FollowMotion();
  Pass(said, Cause::kTime, out);
}

// ---- planted faults

void Firmware::FollowMotion() {
  if (!machine_.runs()) trip_at_ = kNever;
  if (motions_seen_ == hardware_.flash->moves_begun) return;
  motions_seen_ = hardware_.flash->moves_begun;
  if (machine_.runs() && hardware_.faults->in_motion)
    trip_at_ = machine_.began_at() + hardware_.faults->in_motion->after;
}

void Firmware::TripIfDue(HostInstant now, TransmitQueue* out) {
  if (!hardware_.faults->in_motion) trip_at_ = kNever;  // the fault was taken back meanwhile
  if (trip_at_ > now || trip_at_ >= machine_.end_at()) return;
  const Trip trip{hardware_.faults->in_motion->code, hardware_.faults->in_motion->axis};
  hardware_.faults->in_motion.reset();
  hardware_.faults->Acts(UnitFaults::Kind::kInMotion);
  RaiseFault(trip, now, out);
}

bool Firmware::Withheld(const CanFrame& frame, HostInstant now, TransmitQueue* out) {
  UnitFaults& faults = *hardware_.faults;
  const bool planted = faults.ignores || faults.refuses || faults.loses_segments > 0 ||
                       faults.stale_sequence || faults.claims_arrival;
  if (!planted || !powered()) return false;
  const auto request = DecodeHost(frame);
  if (!request) return false;
  const NodeId node = request->address.node;
  if (node != hardware_.node && node != kBroadcastNode) return false;
  // A repeated request has the sequence number of the original.
  if (node == hardware_.node && request->address.sequence != sequence_)
    sequence_before_ = std::exchange(sequence_, request->address.sequence);
  const auto function = static_cast<Function>(frame.id >> 20 & 63);
  if (faults.ignores == function) {
    faults.Acts(UnitFaults::Kind::kIgnores);
    return true;
  }
  if (faults.loses_segments > 0 && function == Function::kStageSegment) {
    --faults.loses_segments;
    return true;
  }
  const auto* start = std::get_if<Start>(&request->message);
  if (faults.claims_arrival && start != nullptr) {
    const Flash& flash = *hardware_.flash;
    if (state() == UnitState::kArmed)
      out->Add(Encode(UnitMessage{Done{Outcome::kArrived,
                                       {flash.axis[0].position(), flash.axis[1].position()},
                                       start->move}},
                      {hardware_.node, 0}));
    return true;
  }
  if (!faults.refuses || faults.refuses->what != function) return false;
  faults.Acts(UnitFaults::Kind::kRefuses);
  if (const auto refusal = Refused(*request, now))
    out->Add(Encode(*refusal, {hardware_.node, request->address.sequence}));
  return true;
}

std::optional<UnitMessage> Firmware::Refused(const Addressed<HostMessage>& request,
                                             HostInstant now) {
  const Answer answer = hardware_.faults->refuses->answer;
  if (const auto* confirm = std::get_if<Confirm>(&request.message))
    return ConfirmReply{confirm->move, 0, {}, answer};
  if (const auto* arm = std::get_if<Arm>(&request.message)) return ArmReply{arm->move, answer};
  if (const auto* home = std::get_if<Home>(&request.message)) return HomeReply{home->move, answer};
  const auto* write = std::get_if<ParameterWrite>(&request.message);
  if (write == nullptr) return std::nullopt;
  TransmitQueue said;  // the answers that it withholds
  machine_.OnFrame(
      Encode(HostMessage{ParameterRead{write->axis, write->parameter}}, request.address), now,
      &said);
  const auto read =
      said.frames().empty() ? std::nullopt : std::optional(DecodeUnit(said.frames()[0]));
  if (!read || !*read) return std::nullopt;
  auto reply = std::get<ParameterReply>((*read)->message);
  reply.written = true;
  reply.answer = answer;
  return reply;
}

void Firmware::Pass(const TransmitQueue& said, Cause cause, TransmitQueue* out) const {
  for (const CanFrame& frame : said.frames()) {
    // The only frame that comes with time is the end of a motion.
    if (cause == Cause::kTime && hardware_.faults->mute_done) {
      hardware_.faults->Acts(UnitFaults::Kind::kMuteDone);
      continue;
    }
    out->Add(Distorted(frame));
  }
}

CanFrame Firmware::Distorted(const CanFrame& frame) const {
  UnitFaults& faults = *hardware_.faults;
  if (!faults.wrong_digest && !faults.foreign_serial && !faults.stale_sequence &&
      !faults.protocol_version)
    return frame;
  auto decoded = DecodeUnit(frame);
  if (!decoded) return frame;
  if (auto* confirm = std::get_if<ConfirmReply>(&decoded->message);
      confirm != nullptr && faults.wrong_digest) {
    confirm->digest ^= 0x00ff00ffu;
    faults.Acts(UnitFaults::Kind::kWrongDigest);
  }
  if (auto* identify = std::get_if<IdentifyReply>(&decoded->message)) {
    if (faults.foreign_serial) faults.Acts(UnitFaults::Kind::kForeignSerial);
    identify->serial = faults.foreign_serial.value_or(identify->serial);
    identify->protocol_version = faults.protocol_version.value_or(identify->protocol_version);
  }
  // Sequence number 0 belongs to frames that are sent unasked.
  if (faults.stale_sequence && decoded->address.sequence != 0) {
    faults.Acts(UnitFaults::Kind::kStaleSequence);
    decoded->address.sequence = sequence_before_;
  }
  return Encode(decoded->message, decoded->address);
}

}  // namespace focalfleet::sim
