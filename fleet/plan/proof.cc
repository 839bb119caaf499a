#include "fleet/plan/proof.h"

#include <algorithm>

#include "fleet/plan/candidates.h"
#include "fleet/plan/guarantee.h"

namespace focalfleet {

std::vector<Track> TracksOf(const Scene& scene, const PlanRequest& request,
                            std::span<const UnitPlan> moves) {
  std::vector<Track> tracks(scene.size());
  for (std::uint32_t i = 0; i < scene.size(); ++i)
    if (scene.is_place(i)) tracks[i] = Track(scene.arm(i), PlaceOf(request.start[i]));
  for (const UnitPlan& move : moves) {
    const std::uint32_t i = move.unit.value;
    tracks[i] = Track(scene.arm(i), request.drives[i], move.from, move.path);
  }
  return tracks;
}

std::vector<Pose> EndsOf(const PlanRequest& request, std::span<const UnitPlan> moves) {
  std::vector<Pose> ends;
  ends.reserve(request.start.size());
  for (const UnitKnowledge& k : request.start) ends.push_back(IsPlace(k) ? PlaceOf(k) : Pose{});
  for (const UnitPlan& move : moves) ends[move.unit.value] = move.to;
  return ends;
}

Scene SceneOf(const PlanRequest& request, std::span<const UnitPlan> moves) {
  Scene scene(*request.layout, request.drives, request.start, request.offsets);
  scene.AllowFor(EndsOf(request, {}));
  scene.AllowFor(EndsOf(request, moves));
  return scene;
}

Proof Prove(const Scene& scene, std::span<const Track> tracks, const Tolerance& tolerance) {
  Tolerance plain = tolerance;
  plain.notice_s = 0;
  Proof proof;
  for (std::uint32_t i = 0; i < scene.size(); ++i) {
    if (!scene.is_place(i)) continue;
    const bool moves = tracks[i].legs().size() > 1;
    for (const StandingThing& thing : scene.standing(i))
      if (moves && !PassesClearOf(scene.arm(i), tracks[i], thing.capsule, thing.need_mm)) {
        proof.unproven.emplace_back(i, i);
        break;
      }
    for (const NeighbourNeed& near : scene.neighbours(i)) {
      if (near.unit < i || !scene.is_place(near.unit)) continue;
      if (!moves && tracks[near.unit].legs().size() == 1) continue;
      const auto clear = [&](const Tolerance& with) {
        return PassesClear(scene.arm(i), tracks[i], scene.arm(near.unit), tracks[near.unit],
                           near.need_mm, with);
      };
      if (clear(tolerance)) continue;
      proof.without_notice.emplace_back(i, near.unit);
      if (!clear(plain)) proof.unproven.emplace_back(i, near.unit);
    }
  }
  return proof;
}

void FillPromises(const PlanRequest& request, const PlanOptions& options, const Scene& scene,
                  std::span<const Track> tracks, const Proof& proof, Plan* plan) {
  constexpr std::size_t kTightest = 20;
  const Tolerance tolerance = ToleranceOf(options);
  Tolerance plain = tolerance;
  plain.notice_s = 0;
  plan->makespan_s = 0;
  for (const UnitPlan& move : plan->moves)
    plan->makespan_s = std::max(plan->makespan_s, EndOf(move, request.drives[move.unit.value]));
  std::vector<std::uint8_t> served(scene.size(), 1);
  for (const Unserved& unserved : plan->unserved) served[unserved.unit.value] = 0;
  plan->bound_s = 0;
  for (std::uint32_t i = 0; i < scene.size(); ++i)
    if (request.targets[i] && served[i] != 0 && scene.is_place(i))
      plan->bound_s = std::max(
          plan->bound_s,
          Straight(request.drives[i], PlaceOf(request.start[i]), *request.targets[i]).end_s);
  FindFollowers({.scene = &scene,
                 .tracks = tracks,
                 .tolerance = tolerance,
                 .without_notice = proof.without_notice,
                 .notice_s = options.notice_s},
                plan);
  plan->tightest = FindTightest(scene, tracks, plain, kTightest);
}

}  // namespace focalfleet
