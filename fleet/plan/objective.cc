#include "fleet/plan/objective.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <numeric>

#include "fleet/estimate.h"
#include "fleet/plan/candidates.h"
#include "fleet/plan/power_ledger.h"
#include "fleet/plan/proof.h"

namespace focalfleet {
namespace {

constexpr double kSlotS = 0.05;
constexpr double kTickS = 1e-4;
constexpr int kPassesMax = 12;
constexpr double kGainMin = 2e-3;  // of the figure; a pass that gains less is the last
constexpr int kLimitTrials = 8;
constexpr int kTested = 6;  // of the candidates that are better, how many are asked for their way
constexpr int kShifts = 16;
constexpr std::array kRounds{CandidateRound{Shape::kStraight, 0, 13},
                             CandidateRound{Shape::kFolding, 0, 4}};

/// One motor on for some slots.
struct Draw {
  std::size_t first = 0;
  std::size_t last = 0;  // included
  double power_W = 0;
  double lasts_s = 0;  // by nominal clocks
};
using Draws = std::vector<Draw>;

AxisPaths Shifted(const AxisPaths& path, std::int64_t ticks) {
  AxisPaths shifted;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    for (Segment segment : path[k].segments()) {
      segment.start_ticks = static_cast<std::uint32_t>(segment.start_ticks + ticks);
      shifted[k].Append(segment);
    }
  return shifted;
}

std::uint32_t BeginTicks(const AxisPaths& path) {
  std::uint32_t begin = std::numeric_limits<std::uint32_t>::max();
  for (const AxisPath& axis : path)
    if (axis.size() > 0) begin = std::min(begin, axis.segments().front().start_ticks);
  return begin;
}

class Improver {
 public:
  Improver(const PlanRequest& request, const PlanOptions& options, Plan plan, double within_s);

  Plan Run();

 private:
  struct Better {
    double cost = 0;
    std::size_t candidate = 0;
  };

  double EndOfPaths(std::uint32_t unit, const AxisPaths& path) const;
  Draws DrawsOf(std::uint32_t unit, const AxisPaths& path);
  void Add(std::uint32_t unit, const Draws& draws, double sign);
  [[nodiscard]] static double Energy(const Draws& draws);
  [[nodiscard]] double Cost(std::uint32_t unit, const Draws& draws);
  [[nodiscard]] bool KeepsLimits(std::uint32_t unit, const Draws& draws);
  [[nodiscard]] bool IsClear(std::uint32_t unit, const Track& track) const;
  [[nodiscard]] bool NeedsChange(std::uint32_t unit, const Draws& draws) const;
  void FindCandidates(std::uint32_t unit);
  bool Improve(std::uint32_t unit);
  void Passes();
  [[nodiscard]] double Figure();
  [[nodiscard]] double RailPeak() const;
  void LowerThePeak();
  void SaveEnergy();
  void SetPaths(const std::vector<AxisPaths>& paths);

  const PlanRequest& request_;
  const PlanOptions& options_;
  const Layout& layout_;
  Objective objective_;  // of the passes now
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
  std::vector<std::uint32_t> order_;  // of the units that may change, the most energy first
  DrivePowers powers_;
  std::vector<std::uint32_t> rail_;         // by unit
  std::vector<std::vector<double>> rails_;  // W by slot
  std::vector<double> total_;               // W by slot
  double limit_W_ = 0;                      // with kLeastPeak
  std::vector<Candidate> candidates_;
  std::vector<double> scratch_;
};

Improver::Improver(const PlanRequest& request, const PlanOptions& options, Plan plan,
                   double within_s)
    : request_(request),
      options_(options),
      layout_(*request.layout),
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
      powers_(options.motor) {
  plain_.notice_s = 0;
  proof_ = Prove(scene_, tracks_, with_notice_);
  const double last_s = within_s_ / (1 - options.clock_error) + options.start_skew_s;
  const auto slots = static_cast<std::size_t>(last_s / kSlotS) + 2;
  std::map<std::uint32_t, std::uint32_t> rails;
  for (const Unit& unit : layout_.units())
    rail_.push_back(
        rails.emplace(unit.rail.value, static_cast<std::uint32_t>(rails.size())).first->second);
  rails_.assign(rails.size(), std::vector<double>(slots, 0));
  total_.assign(slots, 0);
  std::vector<double> energy(scene_.size(), 0);
  for (const UnitPlan& move : plan_.moves) {
    const std::uint32_t i = move.unit.value;
    paths_[i] = move.path;
    fixed_[i] = !request.given.empty() && request.given[i] != 0 ? 1 : 0;
    const Draws draws = DrawsOf(i, move.path);
    energy[i] = Energy(draws);
    Add(i, draws, 1);
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

Draws Improver::DrawsOf(std::uint32_t unit, const AxisPaths& path) {
  const UnitDrive& drive = request_.drives[unit];
  Draws draws;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    for (const Segment& segment : path[k].segments()) {
      const SegmentTime time = TimeOf(segment, drive.axis[k]);
      const double first_s = time.t0_s / (1 + options_.clock_error) - options_.start_skew_s;
      const double last_s = time.t1_s / (1 - options_.clock_error) + options_.start_skew_s;
      const double power_W =
          powers_.Of({AsSent(segment, drive.axis[k]), drive.mode, drive.v_bus_V}).total_W();
      draws.push_back({static_cast<std::size_t>(std::max(0.0, first_s / kSlotS)),
                       static_cast<std::size_t>(last_s / kSlotS), power_W, time.t1_s - time.t0_s});
    }
  return draws;
}

void Improver::Add(std::uint32_t unit, const Draws& draws, double sign) {
  std::vector<double>& rail = rails_[rail_[unit]];
  for (const Draw& draw : draws)
    for (std::size_t n = draw.first; n <= draw.last && n < rail.size(); ++n) {
      rail[n] += sign * draw.power_W;
      total_[n] += sign * draw.power_W;
    }
}

double Improver::Energy(const Draws& draws) {
  double energy_J = 0;
  for (const Draw& draw : draws) energy_J += draw.power_W * draw.lasts_s;
  return energy_J;
}

/// What the unit adds to the figure if it draws so. Pre: its own draws are not in the sums.
double Improver::Cost(std::uint32_t unit, const Draws& draws) {
  if (objective_ == Objective::kLeastEnergy) return Energy(draws);
  const std::vector<double>& rail = rails_[rail_[unit]];
  scratch_.assign(rail.size(), 0);
  std::size_t first = rail.size();
  std::size_t last = 0;
  for (const Draw& draw : draws) {
    first = std::min(first, draw.first);
    last = std::max(last, std::min(draw.last + 1, rail.size()));
    for (std::size_t n = draw.first; n <= draw.last && n < rail.size(); ++n)
      scratch_[n] += draw.power_W;
  }
  const double free_W = objective_ == Objective::kLeastPeak ? limit_W_ : 0;
  double cost = 0;
  for (std::size_t n = first; n < last; ++n) {
    const double with = std::max(rail[n] + scratch_[n] - free_W, 0.0);
    const double without = std::max(rail[n] - free_W, 0.0);
    cost += with * with - without * without;
  }
  return cost;
}

bool Improver::KeepsLimits(std::uint32_t unit, const Draws& draws) {
  if (!options_.power.any()) return true;
  constexpr double kRoundingW = 1e-9;
  Add(unit, draws, 1);
  const std::vector<double>& rail = rails_[rail_[unit]];
  bool kept = true;
  for (const Draw& draw : draws)
    for (std::size_t n = draw.first; n <= draw.last && n < rail.size() && kept; ++n)
      kept = (options_.power.rail_W <= 0 || rail[n] <= options_.power.rail_W + kRoundingW) &&
             (options_.power.total_W <= 0 || total_[n] <= options_.power.total_W + kRoundingW);
  Add(unit, draws, -1);
  return kept;
}

bool Improver::IsClear(std::uint32_t unit, const Track& track) const {
  const ArmGeometry& arm = scene_.arm(unit);
  for (const StandingThing& thing : scene_.standing(unit))
    if (!PassesClearOf(arm, track, thing.capsule, thing.need_mm)) return false;
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

/// With a limit only who runs while it is exceeded can help.
bool Improver::NeedsChange(std::uint32_t unit, const Draws& draws) const {
  if (objective_ != Objective::kLeastPeak) return true;
  const std::vector<double>& rail = rails_[rail_[unit]];
  return std::any_of(draws.begin(), draws.end(), [&](const Draw& draw) {
    for (std::size_t n = draw.first; n <= draw.last && n < rail.size(); ++n)
      if (rail[n] > limit_W_) return true;
    return false;
  });
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
  const Draws before = DrawsOf(unit, paths_[unit]);
  if (!NeedsChange(unit, before)) return false;
  FindCandidates(unit);
  Add(unit, before, -1);
  const double cost_before = Cost(unit, before);
  std::vector<Better> better;
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    const AxisPaths& path = candidates_[c].path;
    if (EndOfPaths(unit, path) > within_s_) continue;
    const double cost = Cost(unit, DrawsOf(unit, path));
    if (cost < cost_before - 1e-9 * std::abs(cost_before)) better.push_back({cost, c});
  }
  std::stable_sort(better.begin(), better.end(),
                   [](const Better& a, const Better& b) { return a.cost < b.cost; });
  bool changed = false;
  for (std::size_t k = 0; k < std::min<std::size_t>(better.size(), kTested) && !changed; ++k) {
    const AxisPaths& path = candidates_[better[k].candidate].path;
    if (!KeepsLimits(unit, DrawsOf(unit, path))) continue;
    Track track(scene_.arm(unit), request_.drives[unit], start_[unit], path);
    if (!IsClear(unit, track)) continue;
    paths_[unit] = path;
    tracks_[unit] = std::move(track);
    changed = true;
  }
  Add(unit, DrawsOf(unit, paths_[unit]), 1);
  return changed;
}

/// Of all units together: what Cost is a unit's part of.
double Improver::Figure() {
  double figure = 0;
  if (objective_ == Objective::kLeastEnergy) {
    for (const std::uint32_t i : order_) figure += Energy(DrawsOf(i, paths_[i]));
    return figure;
  }
  const double free_W = objective_ == Objective::kLeastPeak ? limit_W_ : 0;
  for (const std::vector<double>& rail : rails_)
    for (const double power_W : rail) {
      const double over = std::max(power_W - free_W, 0.0);
      figure += over * over;
    }
  return figure;
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

double Improver::RailPeak() const {
  double peak_W = 0;
  for (const std::vector<double>& rail : rails_)
    peak_W = std::max(peak_W, *std::max_element(rail.begin(), rail.end()));
  return peak_W;
}

void Improver::SetPaths(const std::vector<AxisPaths>& paths) {
  for (const std::uint32_t i : order_) {
    Add(i, DrawsOf(i, paths_[i]), -1);
    paths_[i] = paths[i];
    Add(i, DrawsOf(i, paths_[i]), 1);
    tracks_[i] = Track(scene_.arm(i), request_.drives[i], start_[i], paths_[i]);
  }
}

/// Each trial goes on from the best plan so far.
void Improver::LowerThePeak() {
  double high_W = RailPeak();
  double low_W = 0;
  for (const std::vector<double>& rail : rails_)
    low_W = std::max(
        low_W, std::accumulate(rail.begin(), rail.end(), 0.0) / static_cast<double>(rail.size()));
  std::vector<AxisPaths> best = paths_;
  for (int trial = 0; trial < kLimitTrials; ++trial) {
    limit_W_ = (low_W + high_W) / 2;
    Passes();
    // A trial that fails may still have come down.
    if (const double peak_W = RailPeak(); peak_W < high_W - 1e-9) {
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

/// Who stands in the way of a shorter way loses nothing by another time, but gains nothing either:
/// spreading all over the time moves them.
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
