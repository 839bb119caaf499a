// ConfigurationExecutor, before the start: each unit of the plan gets its move, reads it back, and
// arms.

#include <algorithm>

#include "fleet/coordinate/executor.h"
#include "protocol/base/limits.h"
#include "protocol/wire/frame_bits.h"

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

/// What a unit answers where all is well.
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

// ---- uploading

StagedMove ConfigurationExecutor::StagedMoveOf(PositionerIndex i) const {
  const UnitPlan& plan = plan_.moves[plan_of_[i.value]];
  return {.move = MoveOf(i), .mode = plan.mode, .path = plan.path};
}

void ConfigurationExecutor::PumpUploads() {
  for (std::size_t bus = 0; bus < waiting_.size(); ++bus) {
    while (!waiting_[bus].empty() && uploading_[bus] < kUploadsPerBus) {
      const PositionerIndex i = waiting_[bus].front();
      waiting_[bus].pop_front();
      if (part_[i.value] == Part::kWaiting && core_.unit(i).view.phase == kStaging) Upload(i);
    }
  }
}

void ConfigurationExecutor::Upload(PositionerIndex i) {
  const StagedMove move = StagedMoveOf(i);
  BusRecord& bus = core_.bus_of(i);
  core_.Forget(i);
  if (part_[i.value] != Part::kUploading) {
    ++uploading_[core_.unit(i).bus];
    SetPart(i, Part::kUploading);
  }
  const NodeId node = core_.layout.unit(i).node;
  // Where the queue has no room the read-back shows it, and the move is sent again.
  ForEachStageFrame(move, node, [&](const CanFrame& frame) {
    static_cast<void>(bus.schedule.Enqueue({frame, 0, {}}));
  });
  core_.SetPhase(i, kConfirming);
  core_.Ask(i, Confirm{move.move}, BitsOfConfirmed(move, {node, core_.SequenceAfter(i, 1)}));
}

/// To the bit, where nothing is lost: what stands in a frame decides how long it is, the sequence
/// numbers of the two questions included.
std::uint32_t ConfigurationExecutor::UploadBits(PositionerIndex i,
                                                std::vector<CanFrame>* staged) const {
  const StagedMove move = StagedMoveOf(i);
  const NodeId node = core_.layout.unit(i).node;
  const Address confirm{node, core_.SequenceAfter(i, 1)};
  const Address arm{node, core_.SequenceAfter(i, 2)};
  ForEachStageFrame(move, node, [&](const CanFrame& frame) { staged->push_back(frame); });
  staged->push_back(Encode(HostMessage(Confirm{move.move}), confirm));
  return BitsOfConfirmed(move, confirm) + BitsOfArmed(move.move, arm) +
         FrameBits(Encode(HostMessage(Arm{move.move, Digest(move)}), arm));
}

void ConfigurationExecutor::PredictUpload() {
  double longest_s = 0;
  for (std::size_t b = 0; b < waiting_.size(); ++b) {
    BusRecord& bus = core_.buses[b];
    bus.upload_began = kNever;
    bus.upload_ended = HostInstant{INT64_MIN};
    std::uint64_t bits = 0;
    std::vector<CanFrame> staged;
    for (const PositionerIndex i : waiting_[b]) bits += UploadBits(i, &staged);
    bits += BitsOnWire(staged, core_.rates);
    const double bits_s = static_cast<double>(bits) / core_.config.bit_rate_bps;
    bus.view.upload.bits_predicted += bits;
    bus.view.upload.predicted_s += bits_s;
    view_.upload.bits_predicted += bits;
    longest_s = std::max(longest_s, bits_s);
  }
  view_.upload.predicted_s += longest_s;
}

void ConfigurationExecutor::MeasureUpload() {
  double longest_s = 0;
  for (BusRecord& bus : core_.buses) {
    if (bus.upload_began > bus.upload_ended) continue;
    const double took_s = (bus.upload_ended - bus.upload_began).seconds();
    bus.view.upload.measured_s += took_s;
    longest_s = std::max(longest_s, took_s);
  }
  view_.upload.measured_s += longest_s;
}

void ConfigurationExecutor::OnConfirm(PositionerIndex i, const ConfirmReply& reply) {
  if (core_.unit(i).view.phase != kConfirming || reply.move != MoveOf(i)) return;
  const StagedMove move = StagedMoveOf(i);
  const std::uint32_t digest = Digest(move);
  if (reply.answer == Answer::kOk && reply.digest == digest) {
    core_.SetPhase(i, kArming);
    core_.Ask(i, Arm{move.move, digest},
              BitsOfArmed(move.move, {core_.layout.unit(i).node, core_.SequenceAfter(i, 1)}));
  } else if ((reply.answer == Answer::kOk || reply.answer == Answer::kIncomplete ||
              reply.answer == Answer::kWrongMove) &&
             ++stage_tries_[i.value] <= limits::kStageRetries) {
    ++core_.bus_of(i).view.retries;
    core_.SetPhase(i, kStaging);
    Upload(i);
  } else {
    FallOut(i, std::string("refuses its move: ") +
                   (reply.answer == Answer::kOk ? "its read-back differs" : Name(reply.answer)));
  }
}

void ConfigurationExecutor::OnArm(PositionerIndex i, const ArmReply& reply) {
  if (core_.unit(i).view.phase != kArming || reply.move != MoveOf(i)) return;
  if (reply.answer != Answer::kOk) {
    FallOut(i, std::string("refuses to arm: ") + Name(reply.answer));
    return;
  }
  core_.SetPhase(i, kArmed);
  core_.bus_of(i).upload_ended = core_.now;
  core_.SetDue(i, kNever);
  --uploading_[core_.unit(i).bus];
  SetPart(i, Part::kHolding);
}

void ConfigurationExecutor::FallOut(PositionerIndex i, const std::string& reason) {
  core_.Forget(i);
  Strike(i, reason);
  core_.Raise(Severity::kWarning, i, {}, core_.NameOf(i) + " " + reason);
  if (part_[i.value] == Part::kUploading) --uploading_[core_.unit(i).bus];
  SetPart(i, Part::kNone);
  // Whatever it holds is taken back by reading it anew.
  sessions_.Identify(i);
}

void ConfigurationExecutor::UploadsOver() {
  if (parts_[static_cast<std::size_t>(Part::kWaiting)] != 0 ||
      parts_[static_cast<std::size_t>(Part::kUploading)] != 0)
    return;
  MeasureUpload();
  if (parts_[static_cast<std::size_t>(Part::kHolding)] == plan_.moves.size() && !stopping_) {
    CommitRound();
  } else {
    Disarm();
  }
}

void ConfigurationExecutor::Disarm() {
  SetState(State::kDisarming);
  for (const UnitPlan& move : plan_.moves) {
    if (part_[move.unit.value] == Part::kNone) continue;
    const UnitPhase phase = core_.unit(move.unit).view.phase;
    if (phase == kStaging) {  // nothing was sent yet
      SetPart(move.unit, Part::kNone);
      core_.SetPhase(move.unit, kReady);
      core_.SetDue(move.unit, core_.now + core_.config.poll_period);
    } else if (IsLoaded(phase)) {
      core_.Forget(move.unit);
      core_.Ask(move.unit, Stop{});
    }
  }
  for (auto& queue : waiting_) queue.clear();
}

}  // namespace focalfleet
