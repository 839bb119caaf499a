// Pursuit, before the start: each unit of the plan gets its move, reads it back, and arms.

#include "fleet/coordinate/pursuit.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

// Units of one bus that are uploaded at once: enough to keep the bus busy while answers are under
// way.
constexpr std::uint32_t kUploadsPerBus = 16;

}  // namespace

// ---- uploading

StagedMove Pursuit::StagedMoveOf(PositionerIndex i) const {
  const UnitPlan& plan = plan_.moves[plan_of_[i.value]];
  return {.move = MoveOf(i), .mode = plan.mode, .path = plan.path};
}

void Pursuit::PumpUploads() {
  for (std::size_t bus = 0; bus < waiting_.size(); ++bus) {
    while (!waiting_[bus].empty() && uploading_[bus] < kUploadsPerBus) {
      const PositionerIndex i = waiting_[bus].front();
      waiting_[bus].pop_front();
      if (part_[i.value] == Part::kWaiting && core_.unit(i).view.phase == kStaging) Upload(i);
    }
  }
}

void Pursuit::Upload(PositionerIndex i) {
  const StagedMove move = StagedMoveOf(i);
  BusRecord& bus = core_.bus_of(i);
  core_.Forget(i);
  if (part_[i.value] != Part::kUploading) {
    ++uploading_[core_.unit(i).bus];
    SetPart(i, Part::kUploading);
  }
  // Where the queue has no room the read-back shows it, and the move is sent again.
  const auto send = [&, to = Address{core_.layout.unit(i).node, 0}](const HostMessage& message) {
    static_cast<void>(bus.schedule.Enqueue({Encode(message, to), 0, {}}));
  };
  send(StageBegin{move.move, {move.path[0].size(), move.path[1].size()}, move.mode});
  for (const Axis axis : kAxes) {
    std::uint8_t index = 0;
    for (const Segment& segment : move.path[Index(axis)].segments())
      send(StageSegment{axis, index++, segment});
  }
  core_.SetPhase(i, kConfirming);
  core_.Ask(i, Confirm{move.move});
}

void Pursuit::OnConfirm(PositionerIndex i, const ConfirmReply& reply) {
  if (core_.unit(i).view.phase != kConfirming || reply.move != MoveOf(i)) return;
  const StagedMove move = StagedMoveOf(i);
  const std::uint32_t digest = Digest(move);
  if (reply.answer == Answer::kOk && reply.digest == digest) {
    core_.SetPhase(i, kArming);
    core_.Ask(i, Arm{move.move, digest});
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

void Pursuit::OnArm(PositionerIndex i, const ArmReply& reply) {
  if (core_.unit(i).view.phase != kArming || reply.move != MoveOf(i)) return;
  if (reply.answer != Answer::kOk) {
    FallOut(i, std::string("refuses to arm: ") + Name(reply.answer));
    return;
  }
  core_.SetPhase(i, kArmed);
  core_.SetDue(i, kNever);
  --uploading_[core_.unit(i).bus];
  SetPart(i, Part::kHolding);
}

void Pursuit::FallOut(PositionerIndex i, const std::string& reason) {
  core_.Forget(i);
  Strike(i, reason);
  core_.Raise(Severity::kWarning, i, {}, core_.NameOf(i) + " " + reason);
  if (part_[i.value] == Part::kUploading) --uploading_[core_.unit(i).bus];
  SetPart(i, Part::kNone);
  // Whatever it holds is taken back by reading it anew.
  contact_.Identify(i);
}

void Pursuit::UploadsOver() {
  if (parts_[static_cast<std::size_t>(Part::kWaiting)] != 0 ||
      parts_[static_cast<std::size_t>(Part::kUploading)] != 0)
    return;
  if (parts_[static_cast<std::size_t>(Part::kHolding)] == plan_.moves.size() && !stopping_) {
    CommitRound();
  } else {
    Disarm();
  }
}

void Pursuit::Disarm() {
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
