#include "fleet/coordinate/round.h"

#include <algorithm>

namespace focalfleet {

void Round::SetPart(PositionerIndex i, Part part) {
  Part& mine = units_[i.value].part;
  if (mine != Part::kNone) --counts_[static_cast<std::size_t>(mine)];
  if (part != Part::kNone) ++counts_[static_cast<std::size_t>(part)];
  mine = part;
}

bool Round::HasParts() const {
  return std::any_of(counts_.begin(), counts_.end(),
                     [](std::uint32_t count) { return count != 0; });
}

UnitPlan* Round::PlanOf(PositionerIndex i) {
  const std::size_t index = units_[i.value].plan;
  return index == RoundUnit::kNoPlan ? nullptr : &plan.moves[index];
}

const UnitPlan* Round::PlanOf(PositionerIndex i) const {
  const std::size_t index = units_[i.value].plan;
  return index == RoundUnit::kNoPlan ? nullptr : &plan.moves[index];
}

MoveId Round::MoveOf(PositionerIndex i) const {
  const auto course = late_.find(i.value);
  return course == late_.end() ? move : course->second.move;
}

HostInstant Round::BeganOf(PositionerIndex i) const {
  const auto course = late_.find(i.value);
  return course == late_.end() ? started : AtPlanTime(course->second.late.start_s);
}

std::optional<Round::Course> Round::CourseOf(PositionerIndex i) const {
  const UnitPlan* const mine = PlanOf(i);
  if (part(i) != Part::kMoving || mine == nullptr) return std::nullopt;
  return Course{mine, BeganOf(i)};
}

void Round::TakePlan(const Plan& next) {
  // A round that was disarmed has not ended: its units still have their numbers.
  for (RoundUnit& unit : units_) {
    unit.plan = RoundUnit::kNoPlan;
    unit.ended_early = false;
  }
  plan = next;
}

void Round::AddLate(PositionerIndex i, const LateMove& late, MoveId move_id) {
  late_[i.value] = {late, move_id};
  units_[i.value].plan = plan.moves.size();
  plan.moves.push_back(late.move);
  units_[i.value].stage_tries = 0;
  units_[i.value].ended_early = false;
}

void Round::DropLate(PositionerIndex i) {
  late_.erase(i.value);
  units_[i.value].plan = RoundUnit::kNoPlan;
  units_[i.value].ended_early = true;  // it stands, whatever the plan of the round has it do
}

const LateMove* Round::LateOf(PositionerIndex i) const {
  const auto course = late_.find(i.value);
  return course == late_.end() ? nullptr : &course->second.late;
}

void Round::End() {
  started = kNever;
  for (const UnitPlan& over : plan.moves) units_[over.unit.value].plan = RoundUnit::kNoPlan;
  plan.moves.clear();
  late_.clear();
  running.reset();
  border.follows.clear();
  border.leads.clear();
  for (RoundUnit& unit : units_) unit.goes_on = 0;
}

void Round::Clear() {
  for (RoundUnit& unit : units_) {
    unit.plan = RoundUnit::kNoPlan;
    unit.part = Part::kNone;
  }
  counts_ = {};
  plan = {};
  late_.clear();
  running.reset();
  border = {};
}

}  // namespace focalfleet
