#include "fleet/plan/step_questions.h"

#include <algorithm>
#include <numbers>

namespace focalfleet {
namespace {

constexpr double kTurnsMost = 1.6;  // whole turns of the slowest axis
constexpr double kWithinMost = 2;   // times the time of the first plan; it may never take longer

TimeSteps DenseStepsOf(const LocalSearchRequest& q) {
  double end_s = kWithinMost * q.within_s;
  // Two that are hooked into each other may need turns that neither needs alone.
  for (std::uint32_t i = 0; i < q.scene->size(); ++i)
    if (q.movable[i] != 0)
      for (const Axis axis : kAxes)
        end_s = std::max(end_s, kTurnsMost * 2 * std::numbers::pi / q.scene->arm(i).step_rad(axis) *
                                    SecondsPerVector(q.drives[i].axis[Index(axis)]));
  for (std::uint32_t i = 0; i < q.scene->size() && !q.begin_with.empty(); ++i)
    if (!IsEmpty(q.begin_with[i]) && q.scene->is_place(i))
      end_s =
          std::max(end_s, Track(q.scene->arm(i), q.drives[i], q.from[i], q.begin_with[i]).end_s());
  return StepsUntil(*q.scene, q.drives, end_s);
}

}  // namespace

StepQuestions::StepQuestions(const Motions* motions)
    : motions_(*motions),
      q_(motions->request()),
      scene_(motions->scene()),
      occupancy_(*motions, DenseStepsOf(motions->request())) {}

void StepQuestions::FindRests(std::span<const std::uint32_t> units, std::int32_t end_step) {
  rests_.clear();
  if (q_.ledger == nullptr) return;
  double power_W = 0;
  for (const std::uint32_t i : units)
    for (std::size_t k = 0; k < kAxisCount; ++k) power_W += q_.ledger->Motor_W(i, k);
  const double h = occupancy_.steps().step_s();
  rests_.resize(static_cast<std::size_t>(end_step) + 1);
  for (std::size_t step = 0; step < rests_.size(); ++step) {
    const double from_s = static_cast<double>(step) * h;
    const bool room = std::all_of(units.begin(), units.end(), [&](std::uint32_t i) {
      return q_.ledger->HasRoom(i, power_W, from_s, from_s + h);
    });
    rests_[step] = room ? 0 : 1;
  }
}

StepQuestion StepQuestions::Ask(std::uint32_t unit, std::size_t m, std::int32_t end_step) {
  occupancy_.Look(unit, &around_[m]);
  moving_[m].clear();
  for (std::uint32_t slot = 0; slot < scene_.neighbours(unit).size(); ++slot) {
    const NeighbourNeed& near = scene_.neighbours(unit)[slot];
    if (scene_.is_place(near.unit) && !motions_.track(near.unit).legs().empty())
      moving_[m].push_back({&scene_.arm(near.unit), &motions_.track(near.unit), near.need_mm,
                            motions_.ToleranceOf(unit, slot)});
  }
  return {.arm = &scene_.arm(unit),
          .drive = &q_.drives[unit],
          .around = &around_[m],
          .moving = moving_[m],
          .standing = scene_.standing(unit),
          .steps = occupancy_.steps(),
          .from = q_.from[unit],
          .to = q_.to[unit],
          .within = RangeAround(scene_.arm(unit), q_.from[unit]),
          .end_step = end_step,
          .rests = rests_};
}

}  // namespace focalfleet
