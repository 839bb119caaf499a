#include "fleet/coordinate/upload.h"

#include <algorithm>

#include "protocol/base/limits.h"
#include "protocol/wire/staged_move.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

// Units of one bus that are uploaded at once: enough to keep the bus busy while answers are under
// way.
constexpr std::uint32_t kUploadsPerBus = 16;

/// Calls `send` with each frame of a move that has no answer, in their order.
template <class Send>
void ForEachStageFrame(const StagedMove& move, NodeId node, const Send& send) {
  const Address to{node, 0};
  send(Encode(
      HostMessage(StageBegin{move.move, {move.path[0].size(), move.path[1].size()}, move.mode}),
      to));
  for (const Axis axis : kAxes) {
    std::uint8_t index = 0;
    for (const Segment& segment : move.path[Index(axis)].segments())
      send(Encode(HostMessage(StageSegment{axis, index++, segment}), to));
  }
}

// Answers of a unit that takes its move.
std::uint32_t BitsOfConfirmed(const StagedMove& move, const Address& address) {
  return FrameBits(
      Encode(UnitMessage(ConfirmReply{
                 move.move, Digest(move), {move.path[0].size(), move.path[1].size()}, Answer::kOk}),
             address));
}
std::uint32_t BitsOfArmed(MoveId move, const Address& address) {
  return FrameBits(Encode(UnitMessage(ArmReply{move, Answer::kOk}), address));
}

}  // namespace

Upload::Upload(const Coordination& fleet, Round* round)
    : fleet_(fleet), round_(*round), buses_(fleet.units.buses.size()) {}

StagedMove Upload::StagedMoveOf(PositionerIndex i) const {
  const UnitPlan& plan = *round_.PlanOf(i);
  return {.move = round_.MoveOf(i), .mode = plan.mode, .path = plan.path};
}

void Upload::Add(PositionerIndex i) {
  round_[i].stage_tries = 0;
  round_.SetPart(i, Part::kWaiting);
  fleet_.units.SetPhase(i, kStaging);
  bus_of(i).waiting.push_back(i);
}

void Upload::Pump() {
  for (BusUpload& bus : buses_) {
    while (!bus.waiting.empty() && bus.uploading < kUploadsPerBus) {
      const PositionerIndex i = bus.waiting.front();
      bus.waiting.pop_front();
      if (round_.part(i) == Part::kWaiting && fleet_.units[i].view.phase == kStaging) Send(i);
    }
  }
}

void Upload::Send(PositionerIndex i) {
  const StagedMove move = StagedMoveOf(i);
  BusRecord& bus = fleet_.units.bus_of(i);
  fleet_.requests.Forget(i);
  if (round_.part(i) != Part::kUploading) {
    ++bus_of(i).uploading;
    round_.SetPart(i, Part::kUploading);
  }
  const NodeId node = fleet_.layout.unit(i).node;
  // Where the queue has no room the read-back shows it, and the move is sent again.
  ForEachStageFrame(move, node, [&](const CanFrame& frame) {
    static_cast<void>(bus.schedule.Enqueue({frame, 0, {}}));
  });
  fleet_.units.SetPhase(i, kConfirming);
  fleet_.requests.Ask(i, Confirm{move.move},
                      BitsOfConfirmed(move, {node, fleet_.requests.SequenceAfter(i, 1)}));
}

ProgressReply Upload::ArmedProgressOf(PositionerIndex i) const {
  const UnitView& view = fleet_.units[i].view;
  const Pose place = PlaceOf(view.knowledge);
  return {.state = UnitState::kArmed,
          .position = {place[0] - view.offset[0], place[1] - view.offset[1]},
          .move = view.move};
}

// Exact to the bit where nothing is lost. The content of a frame decides its length, the sequence
// numbers of the three questions included.
std::uint32_t Upload::BitsOf(PositionerIndex i, std::vector<CanFrame>* staged) const {
  const StagedMove move = StagedMoveOf(i);
  const NodeId node = fleet_.layout.unit(i).node;
  const Address confirm{node, fleet_.requests.SequenceAfter(i, 1)};
  const Address arm{node, fleet_.requests.SequenceAfter(i, 2)};
  ForEachStageFrame(move, node, [&](const CanFrame& frame) { staged->push_back(frame); });
  staged->push_back(Encode(HostMessage(Confirm{move.move}), confirm));
  const Address progress{node, fleet_.requests.SequenceAfter(i, 3)};
  return BitsOfConfirmed(move, confirm) + BitsOfArmed(move.move, arm) +
         FrameBits(Encode(HostMessage(Arm{move.move, Digest(move)}), arm)) +
         FrameBits(Encode(HostMessage(ProgressRequest{}), progress)) +
         FrameBits(Encode(UnitMessage(ArmedProgressOf(i)), progress));
}

void Upload::Predict(UploadView* upload) {
  const BusRates rates{fleet_.config.bit_rate_bps, fleet_.config.data_bit_rate_bps};
  double longest_s = 0;
  for (std::size_t b = 0; b < buses_.size(); ++b) {
    BusRecord& bus = fleet_.units.buses[b];
    bus.upload_began = kNever;
    bus.upload_ended = HostInstant{INT64_MIN};
    std::uint64_t bits = 0;
    std::vector<CanFrame> staged;
    for (const PositionerIndex i : buses_[b].waiting) bits += BitsOf(i, &staged);
    bits += BitsOnWire(staged, rates);
    const double bits_s = static_cast<double>(bits) / fleet_.config.bit_rate_bps;
    bus.view.upload.bits_predicted += bits;
    bus.view.upload.predicted_s += bits_s;
    upload->bits_predicted += bits;
    longest_s = std::max(longest_s, bits_s);
  }
  upload->predicted_s += longest_s;
}

void Upload::Measure(UploadView* upload) {
  double longest_s = 0;
  for (BusRecord& bus : fleet_.units.buses) {
    if (bus.upload_began > bus.upload_ended) continue;
    const double took_s = (bus.upload_ended - bus.upload_began).seconds();
    bus.view.upload.measured_s += took_s;
    longest_s = std::max(longest_s, took_s);
  }
  upload->measured_s += longest_s;
}

std::optional<std::string> Upload::OnConfirm(PositionerIndex i, const ConfirmReply& reply) {
  if (fleet_.units[i].view.phase != kConfirming || reply.move != round_.MoveOf(i)) return {};
  const StagedMove move = StagedMoveOf(i);
  const std::uint32_t digest = Digest(move);
  if (reply.answer == Answer::kOk && reply.digest == digest) {
    fleet_.units.SetPhase(i, kArming);
    fleet_.requests.Ask(
        i, Arm{move.move, digest},
        BitsOfArmed(move.move, {fleet_.layout.unit(i).node, fleet_.requests.SequenceAfter(i, 1)}));
    return {};
  }
  if ((reply.answer == Answer::kOk || reply.answer == Answer::kIncomplete ||
       reply.answer == Answer::kWrongMove) &&
      ++round_[i].stage_tries <= limits::kStageRetries) {
    ++fleet_.units.bus_of(i).view.retries;
    fleet_.units.SetPhase(i, kStaging);
    Send(i);
    return {};
  }
  return std::string("refuses its move: ") +
         (reply.answer == Answer::kOk ? "its read-back differs" : Name(reply.answer));
}

std::optional<std::string> Upload::OnArm(PositionerIndex i, const ArmReply& reply) {
  if (fleet_.units[i].view.phase != kArming || reply.move != round_.MoveOf(i)) return {};
  if (reply.answer != Answer::kOk) return std::string("refuses to arm: ") + Name(reply.answer);
  const Address progress{fleet_.layout.unit(i).node, fleet_.requests.SequenceAfter(i, 1)};
  fleet_.requests.Ask(i, ProgressRequest{},
                      FrameBits(Encode(UnitMessage(ArmedProgressOf(i)), progress)));
  return {};
}

std::optional<std::string> Upload::OnProgress(PositionerIndex i, const ProgressReply& reply) {
  if (fleet_.units[i].view.phase != kArming) return {};
  const ProgressReply armed = ArmedProgressOf(i);
  if (reply.state != armed.state) return std::string("does not hold its move any more");
  if (reply.position != armed.position)
    return std::string("counts from elsewhere than it stood, as after a restart");
  fleet_.units.SetPhase(i, kArmed);
  fleet_.units.bus_of(i).upload_ended = fleet_.now();
  fleet_.timers.Set(i, kNever);
  --bus_of(i).uploading;
  round_.SetPart(i, Part::kHolding);
  return {};
}

void Upload::Leave(PositionerIndex i) {
  if (round_.part(i) == Part::kUploading) --bus_of(i).uploading;
  round_.SetPart(i, Part::kNone);
}

void Upload::DropWaiting() {
  for (BusUpload& bus : buses_) bus.waiting.clear();
}

void Upload::Clear() {
  for (BusUpload& bus : buses_) {
    bus.waiting.clear();
    bus.uploading = 0;
  }
}

}  // namespace focalfleet
