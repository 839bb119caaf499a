#include "fleet/plan/objective.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "fleet/estimate.h"
#include "fleet/plan/candidates.h"
#include "fleet/plan/proof.h"
#include "fleet/plan/rail_curves.h"
#include "protocol/base/instants.h"

namespace focalfleet {
namespace {

constexpr int kPassesMax = 12;     // over all units
constexpr double kGainMin = 2e-3;  // of the figure; a pass that gains less is the last
constexpr int kLimitTrials = 8;    // steps of the bisection for the least peak
constexpr int kTested = 6;         // so many of the better candidates are tested for a clear way
constexpr int kShifts = 16;        // begins over the time to spare at which a present way is tried
constexpr std::array kRounds{CandidateRound{Shape::kStraight, 0, 13},
                             CandidateRound{Shape::kFolding, 0, 4}};

class Improver {
 public:
  Improver(const PlanRequest& request, const PlanOptions& options, Plan plan, double within_s);

  Plan Run();

 private:
  using Draws = RailCurves::Draws;
  struct Better {
    double cost = 0;
    std::size_t candidate = 0;
  };

  double EndOfPaths(std::uint32_t unit, const AxisPaths& path) const;
  [[nodiscard]] double Cost(std::uint32_t unit, const Draws& draws);
  [[nodiscard]] bool IsClear(std::uint32_t unit, const Track& track) const;
  [[nodiscard]] bool NeedsChange(std::uint32_t unit, const Draws& draws) const;
  void FindCandidates(std::uint32_t unit);
  bool Improve(std::uint32_t unit);
  void Passes();
  [[nodiscard]] double Figure();
  /// Power up to this adds nothing to the figure.
  [[nodiscard]] double free_W() const { return objective_ == Objective::kLeastPeak ? limit_W_ : 0; }
  void LowerThePeak();
  void SaveEnergy();
  void SetPaths(const std::vector<AxisPaths>& paths);

  const PlanRequest& request_;
  const PlanOptions& options_;
  Objective objective_;  // of the present passes
  double within_s_;
  Plan plan_;
  Scene scene_;
  std::vector<Track> tracks_;
  Proof proof_;
  Tolerance with_notice_;
  Tolerance plain_;
  std::vector<Pose> start_;
  std::vector<Pose> end_;
  std::vector<AxisPaths> paths_;
  std::vector<std::uint8_t> fixed_;
  std::vector<std::uint32_t> order_;  // the units that may change, the most energy first
  RailCurves curves_;
  double limit_W_ = 0;  // with kLeastPeak
  std::vector<Candidate> candidates_;
};

Improver::Improver(const PlanRequest& request, const PlanOptions& options, Plan plan,
                   double within_s)
    : request_(request),
      options_(options),
      objective_(options.objective),
      within_s_(within_s),
      plan_(std::move(plan)),
      scene_(SceneOf(request, plan_.moves)),
      tracks_(TracksOf(scene_, request, plan_.moves)),
      with_notice_(ToleranceOf(options)),
      plain_(with_notice_),
      start_(EndsOf(request, {})),
      end_(EndsOf(request, plan_.moves)),
      paths_(scene_.size()),
      fixed_(scene_.size(), 1),
      curves_(request, options, within_s) {
  plain_.notice_s = 0;
  proof_ = Prove(scene_, tracks_, with_notice_);
  std::vector<double> energy(scene_.size(), 0);
  for (const UnitPlan& move : plan_.moves) {
    const std::uint32_t i = move.unit.value;
    paths_[i] = move.path;
    fixed_[i] = !request.given.empty() && request.given[i] != 0 ? 1 : 0;
    const Draws draws = curves_.DrawsOf(i, move.path);
    energy[i] = RailCurves::Energy(draws);
    curves_.Add(i, draws, 1);
  }
  for (const auto& [a, b] : proof_.unproven) fixed_[a] = fixed_[b] = 1;
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (fixed_[i] == 0) order_.push_back(i);
  std::stable_sort(order_.begin(), order_.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return energy[a] > energy[b]; });
}

double Improver::EndOfPaths(std::uint32_t unit, const AxisPaths& path) const {
  double end_s = 0;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    for (const Segment& segment : path[k].segments())
      end_s = std::max(end_s, TimeOf(segment, request_.drives[unit].axis[k]).t1_s);
  return end_s;
}

/// The amount that the unit adds to the figure if it draws so. Pre: its own draws are not in the
/// curves.
double Improver::Cost(std::uint32_t unit, const Draws& draws) {
  return objective_ == Objective::kLeastEnergy ? RailCurves::Energy(draws)
                                               : curves_.AddedSquares(unit, draws, free_W());
}

bool Improver::IsClear(std::uint32_t unit, const Track& track) const {
  const ArmGeometry& arm = scene_.arm(unit);
  std::uint32_t met = 0;
  if (!scene_.PassesClearOfStanding(unit, track, &met)) return false;
  for (const NeighbourNeed& near : scene_.neighbours(unit)) {
    if (!scene_.is_place(near.unit)) continue;
    const IndexPair pair = std::minmax(unit, near.unit);
    const bool excepted =
        std::binary_search(proof_.without_notice.begin(), proof_.without_notice.end(), pair);
    const Tolerance& tolerance = excepted ? plain_ : with_notice_;
    const ArmGeometry& other = scene_.arm(near.unit);
    const bool clear =
        unit < near.unit
            ? PassesClear(arm, track, other, tracks_[near.unit], near.need_mm, tolerance)
            : PassesClear(other, tracks_[near.unit], arm, track, near.need_mm, tolerance);
    if (!clear) return false;
  }
  return true;
}

/// With a limit only a unit that runs while the limit is exceeded can help.
bool Improver::NeedsChange(std::uint32_t unit, const Draws& draws) const {
  return objective_ != Objective::kLeastPeak || curves_.Exceeds(unit, draws, limit_W_);
}

void Improver::FindCandidates(std::uint32_t unit) {
  candidates_.clear();
  CandidateQuestion question{.scene = &scene_,
                             .drive = &request_.drives[unit],
                             .unit = unit,
                             .from = start_[unit],
                             .to = end_[unit],
                             .within_s = within_s_,
                             .round = {}};
  if (start_[unit] != end_[unit])
    for (const CandidateRound& round : kRounds) {
      question.round = round;
      AppendCandidates(question, &candidates_);
    }
  const auto begin = static_cast<std::int64_t>(BeginTicks(paths_[unit]));
  const double spare_s =
      std::max(0.0, within_s_ - EndOfPaths(unit, paths_[unit])) + static_cast<double>(begin) * 1e-4;
  for (int k = 0; k <= kShifts; ++k) {
    const auto to = static_cast<std::int64_t>(spare_s * k / kShifts / kTickS);
    candidates_.push_back({Shifted(paths_[unit], to - begin), 0});
  }
}

/// True: the unit goes another way or at another time than before.
bool Improver::Improve(std::uint32_t unit) {
  const Draws before = curves_.DrawsOf(unit, paths_[unit]);
  if (!NeedsChange(unit, before)) return false;
  FindCandidates(unit);
  curves_.Add(unit, before, -1);
  const double cost_before = Cost(unit, before);
  std::vector<Better> better;
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    const AxisPaths& path = candidates_[c].path;
    if (EndOfPaths(unit, path) > within_s_) continue;
    const double cost = Cost(unit, curves_.DrawsOf(unit, path));
    if (cost < cost_before - 1e-9 * std::abs(cost_before)) better.push_back({cost, c});
  }
  std::stable_sort(better.begin(), better.end(),
                   [](const Better& a, const Better& b) { return a.cost < b.cost; });
  bool changed = false;
  for (std::size_t k = 0; k < std::min<std::size_t>(better.size(), kTested) && !changed; ++k) {
    const AxisPaths& path = candidates_[better[k].candidate].path;
    if (!curves_.KeepsLimits(unit, curves_.DrawsOf(unit, path))) continue;
    Track track(scene_.arm(unit), request_.drives[unit], start_[unit], path);
    if (!IsClear(unit, track)) continue;
    paths_[unit] = path;
    tracks_[unit] = std::move(track);
    changed = true;
  }
  curves_.Add(unit, curves_.DrawsOf(unit, paths_[unit]), 1);
  return changed;
}

/// The figure of all units together, of which Cost is one unit's part.
double Improver::Figure() {
  if (objective_ != Objective::kLeastEnergy) return curves_.SumOfSquares(free_W());
  double energy_J = 0;
  for (const std::uint32_t i : order_)
    energy_J += RailCurves::Energy(curves_.DrawsOf(i, paths_[i]));
  return energy_J;
}

void Improver::Passes() {
  double figure = Figure();
  for (int pass = 0; pass < kPassesMax; ++pass) {
    bool any = false;
    for (const std::uint32_t i : order_) any = Improve(i) || any;
    const double now = Figure();
    if (!any || figure - now < kGainMin * figure) return;
    figure = now;
  }
}

void Improver::SetPaths(const std::vector<AxisPaths>& paths) {
  for (const std::uint32_t i : order_) {
    curves_.Add(i, curves_.DrawsOf(i, paths_[i]), -1);
    paths_[i] = paths[i];
    curves_.Add(i, curves_.DrawsOf(i, paths_[i]), 1);
    tracks_[i] = Track(scene_.arm(i), request_.drives[i], start_[i], paths_[i]);
  }
}

/// Each trial goes on from the best plan so far.
void Improver::LowerThePeak() {
  double high_W = curves_.Peak();
  double low_W = curves_.HighestMean();
  std::vector<AxisPaths> best = paths_;
  for (int trial = 0; trial < kLimitTrials; ++trial) {
    limit_W_ = (low_W + high_W) / 2;
    Passes();
    // A trial that fails may still have come down.
    if (const double peak_W = curves_.Peak(); peak_W < high_W - 1e-9) {
      high_W = peak_W;
      best = paths_;
    } else {
      SetPaths(best);
    }
    if (high_W > limit_W_) low_W = limit_W_;
    if (high_W - low_W < 0.005 * high_W) break;
  }
  SetPaths(best);
}

/// A unit that blocks a shorter way neither loses nor gains by another time. Spreading the power
/// over all the time moves such units.
void Improver::SaveEnergy() {
  constexpr int kRoundsMax = 4;
  Passes();
  double least_J = Figure();
  std::vector<AxisPaths> best = paths_;
  for (int round = 0; round < kRoundsMax; ++round) {
    objective_ = Objective::kEvenPower;
    Passes();
    objective_ = Objective::kLeastEnergy;
    Passes();
    const double now_J = Figure();
    if (now_J >= least_J) break;
    least_J = now_J;
    best = paths_;
  }
  SetPaths(best);
}

Plan Improver::Run() {
  if (options_.objective == Objective::kLeastPeak)
    LowerThePeak();
  else if (options_.objective == Objective::kLeastEnergy)
    SaveEnergy();
  else
    Passes();
  for (UnitPlan& move : plan_.moves) move.path = paths_[move.unit.value];
  proof_ = Prove(scene_, tracks_, with_notice_);
  FillPromises(request_, options_, scene_, tracks_, proof_, &plan_);
  return std::move(plan_);
}

}  // namespace

Result<Plan> ImprovePlan(const PlanRequest& request, const PlanOptions& options, Plan plan) {
  if (options.objective == Objective::kSoonest) return plan;
  constexpr double kRoundingS = 1e-9;
  if (options.within_s > 0 && plan.makespan_s > options.within_s + kRoundingS) {
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(),
                  "no plan within %.2f s was found: the soonest one takes %.2f s (the slowest unit "
                  "alone %.2f s)",
                  options.within_s, plan.makespan_s, plan.bound_s);
    return Fail(ErrorCode::kRefused, text.data());
  }
  const double within_s = options.within_s > 0 ? options.within_s : plan.makespan_s;
  return Improver(request, options, std::move(plan), within_s + kRoundingS).Run();
}

}  // namespace focalfleet
