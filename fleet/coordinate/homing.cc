#include "fleet/coordinate/homing.h"

#include <algorithm>
#include <cstdint>
#include <string>

#include "fleet/coordinate/intents.h"
#include "fleet/estimate.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

IntentRow HomingIntentOf(const Coordination& fleet, std::uint64_t configuration, MoveId move,
                         PositionerIndex i) {
  const UnitView& view = fleet.units[i].view;
  const Unit& unit = fleet.layout.unit(i);
  IntentRow row{.configuration = configuration,
                .serial = view.serial,
                .unit = unit.id,
                .move = move,
                .from = {},
                .to = HomeCountOf(fleet, i),
                .hull = {}};
  for (const Axis axis : kAxes) {
    const AxisGeometry& geometry = unit.axis[Index(axis)];
    const AxisDrive& drive = fleet.drive(i).axis[Index(axis)];
    const std::int32_t low = NearestVectors(geometry.min_deg, geometry, drive);
    const std::int32_t high = NearestVectors(geometry.max_deg, geometry, drive);
    const AxisKnowledge& known = view.knowledge[Index(axis)];
    const bool unknown = known.witness == Witness::kUnknown;
    const std::int32_t to = row.to[Index(axis)];
    row.from[Index(axis)] = unknown ? low : known.low - view.offset[Index(axis)];
    row.hull[Index(axis)] = {Witness::kInterval, std::min(unknown ? low : known.low, to),
                             std::max(unknown ? high : known.high, to)};
  }
  return row;
}

/// The motion of a wave as docs/protocol.md has it: phi, then theta, each over its range and some
/// turns more, from wherever it stands. The estimate is right to a tenth: the surplus is the
/// firmware's own affair.
Plan HomingMotion(const Coordination& fleet, const std::vector<PositionerIndex>& wave) {
  constexpr double kOverRange = 1.05;
  constexpr int kTurnsMore = 2;
  Plan plan;
  for (const PositionerIndex i : wave) {
    const UnitDrive& drive = fleet.drive(i);
    UnitPlan motion{
        .unit = i, .from = {}, .to = {}, .mode = drive.mode, .path = {}, .followers = {}};
    std::uint32_t start_ticks = 0;
    for (const Axis axis : {Axis::kPhi, Axis::kTheta}) {
      const AxisGeometry& geometry = fleet.layout.unit(i).axis[Index(axis)];
      const AxisDrive& tuned = drive.axis[Index(axis)];
      const auto way = static_cast<std::int32_t>(
          NearestVectors(geometry.max_deg - geometry.min_deg, geometry, tuned) * kOverRange +
          kTurnsMore * tuned.subdivision);
      const Segment segment{start_ticks, way, tuned.repeat};
      motion.path[Index(axis)].Append(segment);
      start_ticks = static_cast<std::uint32_t>(TimeOf(segment, tuned).t1_s * 1e9 /
                                               static_cast<double>(kTick.ns));
    }
    plan.moves.push_back(std::move(motion));
  }
  return plan;
}

}  // namespace

void Homing::Begin(const Goal& goal) {
  to_home_ = goal.to_home;
  unproven_ = goal.unproven;
}

void Homing::Clear() {
  to_home_.clear();
  wave_.clear();
}

void Homing::RefuseUnready() {
  std::erase_if(to_home_, [&](PositionerIndex i) {
    if (fleet_.units[i].view.phase == kReady) return false;
    configuration_.outcomes.Set(i, TargetOutcome::kRefused,
                                "it cannot home: it " + fleet_.units.TroubleOf(i));
    return true;
  });
}

bool Homing::Commit() {
  std::erase_if(wave_, [&](PositionerIndex i) {
    if (fleet_.units[i].view.phase == kReady) return false;
    configuration_.outcomes.Set(i, TargetOutcome::kFailed, "it " + fleet_.units.TroubleOf(i));
    std::erase(to_home_, i);
    return true;
  });
  if (wave_.empty()) return false;
  // A new id: the moves that made way for these units had their own.
  round_.move = fleet_.ledger.TakeMoveId();
  fleet_.ledger.homing_configurations.insert(configuration_.view.id);
  for (const PositionerIndex i : wave_) {
    // The unit begins to count anew at its stop, so the offset of its old count is over.
    Intend(fleet_, HomingIntentOf(fleet_, configuration_.view.id, round_.move, i), {}, i, &round_);
  }
  // The units of a wave have few different drive settings, so the estimate is quick enough for this
  // thread.
  const PlanEstimate estimate =
      Estimate(HomingMotion(fleet_, wave_), fleet_.layout, fleet_.units.drives, MotorModel{});
  round_.prediction = {estimate.makespan_s, estimate.energy_J, estimate.peak_power_W};
  round_.commit_batch = fleet_.ledger.batch_now();
  return true;
}

/// The unit may have been lost, and even read anew, while the store wrote its intent.
bool Homing::MayBegin(PositionerIndex i) const {
  const UnitView& view = fleet_.units[i].view;
  const auto intent = fleet_.ledger.intents.find(view.serial);
  return view.phase == kReady && intent != fleet_.ledger.intents.end() &&
         intent->second.move == round_.move;
}

void Homing::Start() {
  round_.started = fleet_.now();
  round_.last_arrival = fleet_.now();
  for (const PositionerIndex i : wave_) {
    round_[i].plan = RoundUnit::kNoPlan;
    if (!MayBegin(i)) {
      configuration_.outcomes.Set(i, TargetOutcome::kFailed, "it was lost before it could home");
      TakeBackIntent(fleet_, i, &round_);
      continue;
    }
    round_.SetPart(i, Part::kMoving);
    fleet_.units.SetPhase(i, kHoming);
    fleet_.units[i].next_poll = fleet_.now() + fleet_.config.poll_period;
    fleet_.requests.Ask(i, Home{round_.move});
  }
}

bool Homing::Refuses(PositionerIndex i, const HomeReply& reply) {
  if (fleet_.units[i].view.phase != kHoming || reply.move != round_.move) return false;
  fleet_.timers.Set(i, fleet_.units[i].next_poll);
  if (reply.answer == Answer::kOk || reply.answer == Answer::kBegunBefore) {
    round_[i].before.reset();
    return false;
  }
  TakeBackIntent(fleet_, i, &round_);  // with the offset of its old count
  configuration_.outcomes.Set(i, TargetOutcome::kFailed,
                              std::string("refuses to home: ") + Name(reply.answer));
  round_.SetPart(i, Part::kNone);
  return true;
}

void Homing::EndWave() {
  for (const PositionerIndex i : wave_) std::erase(to_home_, i);
  wave_.clear();
}

}  // namespace focalfleet
