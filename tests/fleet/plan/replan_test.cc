// One unit gets a new way while the others go on. Judged by the independent checker, in true time:
// every unit runs by a clock of its own within the tolerance, the late one starts by a signal that
// is early or late, and what stood when is what the rows say.
#include "fleet/plan/replan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <set>

#include "fleet/estimate.h"
#include "protocol/base/rng.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::CheckedObstacles;
using test::CheckedRow;
using test::CheckedRows;
using test::CheckedUnit;
using test::CheckedUnits;
using test::CheckOptions;
using test::CheckPlan;
using test::CheckReport;
using test::DegreesOf;
using test::DrawStartAndTargets;
using test::FleetOf;
using test::HexFleet;
using test::PlanningFleet;
using test::TestSeed;

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kLateSkewS = 0.040;

struct Clock {
  double skew_s = 0;
  double rate = 1;  // own seconds per true second
  [[nodiscard]] double Own(double true_s) const { return (true_s - skew_s) * rate; }
  [[nodiscard]] double True(double own_s) const { return own_s / rate + skew_s; }
};

using Pair = std::pair<std::uint32_t, std::uint32_t>;  // indices, lower first

/// A configuration under way in true time: who was stopped when, who has a late move.
class UnderWay {
 public:
  UnderWay(PlanningFleet fleet, const PlanOptions& options, Plan plan)
      : fleet_(std::make_shared<const PlanningFleet>(std::move(fleet))),
        options_(options),
        plan_(std::make_shared<const Plan>(std::move(plan))),
        running_(std::make_shared<const RunningPlan>(fleet_->request(), plan_->moves, options)),
        move_of_(fleet_->layout.size(), nullptr) {
    for (const UnitPlan& move : plan_->moves) move_of_[move.unit.value] = &move;
    Reset();
  }

  [[nodiscard]] const PlanningFleet& fleet() const { return *fleet_; }
  [[nodiscard]] const Plan& plan() const { return *plan_; }
  [[nodiscard]] const RunningPlan& running() const { return *running_; }
  [[nodiscard]] std::uint32_t size() const {
    return static_cast<std::uint32_t>(fleet_->layout.size());
  }

  void Reset() {
    clocks_.assign(size(), {});
    stops_.assign(size(), kNever);
    stands_.clear();
    late_.clear();
    extra_.clear();
  }
  /// All within the tolerance, half of them at its corners; or all at one corner.
  void SetClocks(int corner) {
    clocks_.assign(size(),
                   {(corner & 1) != 0 ? options_.start_skew_s : -options_.start_skew_s,
                    1 + ((corner & 2) != 0 ? options_.clock_error : -options_.clock_error)});
  }
  void DrawClocks(Rng* rng, int corner) {
    if (corner > 0) return SetClocks(corner);
    const auto draw = [&](double most) {
      const double u = rng->Uniform(-1, 1);
      return rng->Uniform() < 0.5 ? std::copysign(most, u) : most * u;
    };
    for (Clock& clock : clocks_)
      clock = {draw(options_.start_skew_s), 1 + draw(options_.clock_error)};
  }
  [[nodiscard]] bool Moves(std::uint32_t i, double true_s) const {
    return move_of_[i] != nullptr && true_s < EndOf(i) && true_s < stops_[i];
  }
  [[nodiscard]] double EndOf(std::uint32_t i) const {
    return clocks_[i].True(focalfleet::EndOf(*move_of_[i], fleet_->drives[i]));
  }
  void Stop(std::uint32_t i, double true_s) { stops_[i] = true_s; }
  void GoOn(std::uint32_t i) { stops_[i] = kNever; }

  /// Whoever `first` leads, and theirs, by the plan and by late moves: all stopped as `stop` says
  /// for when the one before ended.
  template <class StopTime>
  void StopFollowers(std::uint32_t first, const StopTime& stop) {
    std::vector<std::uint32_t> open{first};
    while (!open.empty()) {
      const std::uint32_t i = open.back();
      open.pop_back();
      std::vector<UnitPlan::Follower> followers = extra_[i];
      if (const auto late = late_.find(i); late != late_.end()) {
        const auto& own = late->second.move.move.followers;
        followers.insert(followers.end(), own.begin(), own.end());
      } else if (move_of_[i] != nullptr) {
        followers.insert(followers.end(), move_of_[i]->followers.begin(),
                         move_of_[i]->followers.end());
      }
      const double ended_s = StopOf(i);
      for (const UnitPlan::Follower& follower : followers) {
        const std::uint32_t j = follower.unit.value;
        if (ended_s < follower.since_s || ended_s > follower.left_s) continue;
        if (StopOf(j) < kNever) continue;
        if (late_.count(j) != 0) {
          late_[j].stop_s = stop(ended_s);
        } else {
          if (!Moves(j, stop(ended_s))) continue;
          stops_[j] = stop(ended_s);
        }
        open.push_back(j);
      }
    }
  }
  [[nodiscard]] double StopOf(std::uint32_t i) const {
    const auto late = late_.find(i);
    return late != late_.end() ? late->second.stop_s : stops_[i];
  }

  /// Where those stand that were stopped: what a coordinator is told.
  void Settle() {
    for (std::uint32_t i = 0; i < size(); ++i)
      if (stops_[i] < kNever && late_.count(i) == 0) stands_[i] = PoseAt(i, stops_[i]);
  }
  [[nodiscard]] std::vector<Deviation> Deviations() const {
    std::vector<Deviation> deviations;
    for (const auto& [i, pose] : stands_)
      if (late_.count(i) == 0)
        deviations.push_back({{i}, Exactly(Witness::kReported, pose), std::nullopt});
    for (const auto& [i, late] : late_) deviations.push_back({{i}, {}, late.move});
    return deviations;
  }
  [[nodiscard]] Pose PoseAt(std::uint32_t i, double true_s) const {
    Pose pose = PlaceOf(fleet_->start[i]);
    for (std::size_t k = 0; k < kAxisCount && move_of_[i] != nullptr; ++k)
      pose[k] = PositionAt(pose[k], move_of_[i]->path[k], fleet_->drives[i].axis[k],
                           clocks_[i].Own(true_s));
    return pose;
  }
  [[nodiscard]] Pose PlannedEnd(std::uint32_t i) const { return move_of_[i]->to; }
  [[nodiscard]] Pose EndPose(std::uint32_t i) const {
    if (const auto it = stands_.find(i); it != stands_.end()) return it->second;
    return move_of_[i] != nullptr ? move_of_[i]->to : PlaceOf(fleet_->start[i]);
  }
  /// Whether the planner knows a way while all others are where they end.
  [[nodiscard]] bool HasStaticWay(const ReplanQuestion& question) const {
    PlanningFleet then = *fleet_;
    for (std::uint32_t i = 0; i < size(); ++i) {
      then.start[i] = Exactly(Witness::kReported, EndPose(i));
      then.frozen[i] = 1;
      then.targets[i].reset();
    }
    const std::uint32_t unit = question.unit.value;
    then.start[unit] = Exactly(Witness::kReported, question.from);
    then.frozen[unit] = 0;
    then.targets[unit] = question.to;
    const auto plan = MakePlan(then.request(), {.fixed = true});
    return plan && plan->unserved.empty();
  }
  void Go(const LateMove& move, const Clock& clock) {
    const std::uint32_t i = move.move.unit.value;
    late_[i] = {move, clock, kNever};
    for (const LateMove::Leader& leader : move.leaders)
      extra_[leader.unit.value].push_back(leader.follower);
  }
  void SetLateClock(std::uint32_t i, const Clock& clock) { late_[i].clock = clock; }
  void StopLate(std::uint32_t i, double true_s) { late_[i].stop_s = true_s; }
  [[nodiscard]] const LateMove& late(std::uint32_t i) const { return late_.at(i).move; }

  /// A place where `unit` is clear of where everybody else ends.
  [[nodiscard]] std::optional<Pose> DrawTarget(std::uint32_t unit, const Rng& rng) const {
    std::vector<std::optional<Pose>> standing(size());
    for (std::uint32_t i = 0; i < size(); ++i)
      if (i != unit) standing[i] = EndPose(i);
    const auto drawn = DrawConfiguration(fleet_->layout, fleet_->drives, standing, rng);
    if (!drawn) return std::nullopt;
    return (*drawn)[unit];
  }

  /// The pairs with one of `units` that are not clear at some time from `since_s` on, when all
  /// that stand by then have settled.
  [[nodiscard]] std::set<Pair> Unclear(const std::set<std::uint32_t>& units, double since_s,
                                       std::string* text) const {
    std::set<std::uint32_t> near = units;
    for (const std::uint32_t i : units)
      for (const PositionerIndex j : fleet_->layout.neighbours({i})) near.insert(j.value);
    const auto all = CheckedUnits(fleet_->layout, fleet_->drives, fleet_->start, fleet_->frozen);
    std::vector<CheckedUnit> checked;
    std::vector<CheckedRow> rows;
    for (const std::uint32_t i : near) {
      checked.push_back(all[i]);
      Lay(i, since_s, &checked.back(), &rows);
    }
    CheckOptions options;
    options.clearance_mm = fleet_->layout.clearance_mm();
    options.start_skew_s = options.clock_error = 0;  // in the rows already
    const CheckReport report = CheckPlan(checked, rows, CheckedObstacles(fleet_->layout), options);
    std::set<Pair> unclear;
    for (const std::string& fault : report.faults) {
      if (!fault.starts_with("units ")) {
        ADD_FAILURE() << fault;
        continue;
      }
      const auto index = [&](std::size_t at) {
        return fleet_->layout
            .Find(UnitId{static_cast<std::uint32_t>(std::stoul(fault.substr(at)))})
            ->value;
      };
      const Pair pair = std::minmax(index(6), index(fault.find(" and ") + 5));
      if (units.count(pair.first) + units.count(pair.second) == 0) continue;
      unclear.insert(pair);
      *text += fault + "\n";
    }
    return unclear;
  }
  /// At all corners of the late unit's own clock.
  void ExpectClear(const LateMove& late, double since_s) {
    for (const double skew : {-late.start_skew_s, late.start_skew_s}) {
      for (const double rate : {0.995, 1.005}) {
        Go(late, {skew, rate});
        std::string text;
        EXPECT_TRUE(Unclear({late.move.unit.value}, since_s, &text).empty())
            << "unit index " << late.move.unit.value << " starts at " << late.start_s << " s:\n"
            << text;
      }
    }
  }
  /// Were its start this much beyond its skew.
  bool WouldMeet(const LateMove& late, double since_s, double beyond_s) {
    bool meets = false;
    for (const double skew : {-late.start_skew_s - beyond_s, late.start_skew_s + beyond_s}) {
      Go(late, {skew, 1});
      std::string text;
      meets = meets || !Unclear({late.move.unit.value}, since_s, &text).empty();
    }
    return meets;
  }
  [[nodiscard]] bool IsUnnoticed(const Pair& pair) const {
    const auto is = [&](const Unnoticed& u) {
      return Pair(std::minmax(u.ends.value, u.follower.value)) == pair;
    };
    if (std::any_of(plan_->unnoticed.begin(), plan_->unnoticed.end(), is)) return true;
    return std::any_of(late_.begin(), late_.end(), [&](const auto& entry) {
      const auto& unnoticed = entry.second.move.unnoticed;
      return std::any_of(unnoticed.begin(), unnoticed.end(), is);
    });
  }

 private:
  struct Late {
    LateMove move;
    Clock clock;
    double stop_s = kNever;
  };
  /// What is left of its rows from `since_s` on, in true time after that.
  void Lay(std::uint32_t i, double since_s, CheckedUnit* unit,
           std::vector<CheckedRow>* rows) const {
    const auto lay = [&](const UnitPlan& move, const Clock& clock, double offset_s, double stop_s) {
      Plan one;
      one.moves.push_back(move);
      for (const CheckedRow& row : CheckedRows(one, fleet_->layout, fleet_->drives)) {
        const double t0 = offset_s + clock.True(row.t0_s);
        const double t1 = offset_s + clock.True(row.t1_s);
        const double begin = std::max(t0, since_s);
        const double end = std::min(t1, stop_s);
        const auto at = [&](double t) {
          if (t <= t0) return row.from_deg;
          if (t >= t1) return row.to_deg;
          return row.from_deg + (row.to_deg - row.from_deg) * (t - t0) / (t1 - t0);
        };
        if (t0 < since_s) unit->axis[row.axis].start_deg = at(std::min(since_s, end));
        if (end <= begin) continue;
        rows->push_back({row.unit, row.axis, begin - since_s, end - since_s, at(begin), at(end)});
      }
    };
    if (const auto stands = stands_.find(i); stands != stands_.end()) {
      for (std::size_t k = 0; k < kAxisCount; ++k)
        unit->axis[k].start_deg =
            DegreesOf(stands->second[k], fleet_->layout.unit({i}), fleet_->drives[i], k);
    } else if (move_of_[i] != nullptr && late_.count(i) == 0) {
      lay(*move_of_[i], clocks_[i], 0, stops_[i]);
    } else if (move_of_[i] != nullptr) {  // had arrived
      lay(*move_of_[i], clocks_[i], 0, kNever);
    }
    if (const auto late = late_.find(i); late != late_.end())
      lay(late->second.move.move, late->second.clock, late->second.move.start_s,
          late->second.stop_s);
  }

  std::shared_ptr<const PlanningFleet> fleet_;
  PlanOptions options_;
  std::shared_ptr<const Plan> plan_;
  std::shared_ptr<const RunningPlan> running_;
  std::vector<const UnitPlan*> move_of_;
  std::vector<Clock> clocks_;
  std::vector<double> stops_;  // true time, of the planned move
  std::map<std::uint32_t, Pose> stands_;
  std::map<std::uint32_t, Late> late_;
  std::map<std::uint32_t, std::vector<UnitPlan::Follower>> extra_;
};

std::optional<UnderWay> Begun(std::uint32_t count, std::uint64_t seed, PlanOptions options = {}) {
  PlanningFleet fleet = HexFleet(count);
  DrawStartAndTargets(&fleet, seed);
  // Some have nothing to do yet: their targets come later.
  Rng rng = Rng::Stream(seed, "idle");
  std::vector<std::optional<Pose>> standing(count);
  for (std::uint32_t i = 0; i < count; ++i)
    if (rng.Below(12) == 0) standing[i] = PlaceOf(fleet.start[i]);
  const auto to =
      DrawConfiguration(fleet.layout, fleet.drives, standing, Rng::Stream(seed, "targets"));
  EXPECT_TRUE(to);
  if (!to) return std::nullopt;
  for (std::uint32_t i = 0; i < count; ++i) {
    fleet.targets[i].reset();
    if (!standing[i]) fleet.targets[i] = (*to)[i];
  }
  auto plan = MakePlan(fleet.request(), options);
  EXPECT_TRUE(plan) << plan.error().text;
  if (!plan) return std::nullopt;
  return std::optional<UnderWay>(std::in_place, std::move(fleet), options, std::move(*plan));
}

/// One unit, moving or not, is stopped with those that follow it; and perhaps a neighbour has
/// failed, of which only an interval is known.
struct Draw {
  std::uint32_t unit = 0;
  std::optional<std::uint32_t> failed;
  ReplanQuestion question;
  std::vector<Deviation> deviations;
};

std::optional<Draw> DrawQuestion(UnderWay* fleet, Rng* rng, int corner) {
  fleet->Reset();
  fleet->DrawClocks(rng, corner);
  Draw draw;
  draw.unit = static_cast<std::uint32_t>(rng->Below(fleet->size()));
  const double t_s = rng->Uniform(0, fleet->plan().makespan_s);
  const auto stop = [&](std::uint32_t i) {
    if (!fleet->Moves(i, t_s)) return false;
    fleet->Stop(i, t_s);
    fleet->StopFollowers(i, [&](double) { return rng->Uniform(t_s, t_s + 1); });
    return true;
  };
  stop(draw.unit);
  const auto near = fleet->fleet().layout.neighbours({draw.unit});
  const std::uint32_t other = near[rng->Below(near.size())].value;
  if (rng->Below(3) == 0 && fleet->StopOf(other) == kNever && stop(other)) draw.failed = other;
  fleet->Settle();
  draw.deviations = fleet->Deviations();
  if (draw.failed) {
    const Pose stands = fleet->EndPose(*draw.failed);
    for (Deviation& deviation : draw.deviations)
      if (deviation.unit.value == *draw.failed)
        for (std::size_t k = 0; k < kAxisCount; ++k) {
          const auto slack = [&] { return static_cast<std::int32_t>(rng->Below(400)); };
          deviation.stands[k] = {Witness::kInterval, stands[k] - slack(), stands[k] + slack()};
        }
  }
  const auto target = fleet->DrawTarget(draw.unit, Rng::Stream(rng->Bits(), "target"));
  if (!target) return std::nullopt;
  Pose from = fleet->EndPose(draw.unit);
  if (fleet->StopOf(draw.unit) == kNever) from = fleet->PoseAt(draw.unit, t_s + 1);
  draw.question = {.unit = {draw.unit},
                   .from = from,
                   .to = *target,
                   .now_s = t_s + 1.1,
                   .start_s = t_s + 1.1 + rng->Uniform(0.2, 3),
                   .start_skew_s = kLateSkewS};
  return draw;
}

void ExpectEndsAt(const LateMove& late, const ReplanQuestion& question) {
  EXPECT_EQ(late.move.unit, question.unit);
  EXPECT_EQ(late.move.from, question.from);
  EXPECT_EQ(late.move.to, question.to);
  Pose at = question.from;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    for (const Segment& segment : late.move.path[k].segments()) at[k] += segment.delta;
  EXPECT_EQ(at, question.to);
  EXPECT_GE(late.start_s, question.start_s - 1e-9);
  EXPECT_LT(late.start_s, question.start_s + 1e-3);
}

constexpr std::uint64_t kSeeds = 8;
constexpr int kDraws = 60;

TEST(Replan, IsClearOfAllOthersForEverySkewAndClock) {
  int asked = 0;
  int served = 0;
  int failed = 0;
  int collides = 0;
  for (std::uint64_t k = 0; k < kSeeds; ++k) {
    const std::uint64_t seed = TestSeed(700 + k);
    FOCALFLEET_TRACE_SEED(seed);
    // Notice covers much of what clocks need: every other plate goes without.
    const PlanOptions options{.notice_s = k % 2 == 0 ? 1.0 : 0.0};
    auto fleet = Begun(300 + static_cast<std::uint32_t>(k) * 25, seed, options);
    ASSERT_TRUE(fleet);
    Rng rng = Rng::Stream(seed, "replan");
    for (int n = 0; n < kDraws; ++n) {
      const auto draw = DrawQuestion(&*fleet, &rng, n % 8 < 4 ? 0 : 1 + n % 3);
      if (!draw) continue;
      const auto late = fleet->running().Replan(draw->question, draw->deviations);
      if (!late && late.error().code == ErrorCode::kInvalid) {
        EXPECT_TRUE(draw->failed) << late.error().text;
        ++collides;
        continue;
      }
      ++asked;
      if (!late) {
        EXPECT_FALSE(fleet->HasStaticWay(draw->question)) << late.error().text;
        continue;
      }
      ++served;
      failed += draw->failed ? 1 : 0;
      ExpectEndsAt(*late, draw->question);
      fleet->ExpectClear(*late, draw->question.now_s);
    }
  }
  std::printf(
      "%d questions, %d served (%d beside a failed unit); %d targets on a failed unit's interval\n",
      asked, served, failed, collides);
  EXPECT_GE(served, asked * 9 / 10);
  EXPECT_GT(failed, 10);
}

bool GoesStraightAtOnce(const LateMove& late) {
  return std::all_of(late.move.path.begin(), late.move.path.end(), [](const AxisPath& path) {
    return path.size() == 0 || (path.size() == 1 && path.segments()[0].start_ticks == 0);
  });
}

/// Its neighbours go from one random configuration to another; it stands.
std::optional<UnderWay> BegunAround(std::uint32_t unit, std::uint64_t seed) {
  PlanningFleet fleet = HexFleet(7);
  DrawStartAndTargets(&fleet, seed);
  std::vector<std::optional<Pose>> standing(fleet.layout.size());
  standing[unit] = PlaceOf(fleet.start[unit]);
  const auto to =
      DrawConfiguration(fleet.layout, fleet.drives, standing, Rng::Stream(seed, "targets"));
  if (!to) return std::nullopt;
  fleet.targets.assign(to->begin(), to->end());
  fleet.targets[unit].reset();
  const PlanOptions options{.fixed = true, .notice_s = 0};
  auto plan = MakePlan(fleet.request(), options);
  if (!plan || !plan->unserved.empty()) return std::nullopt;
  return std::optional<UnderWay>(std::in_place, std::move(fleet), options, std::move(*plan));
}

// The straight way opens or closes while somebody passes: at that moment the tolerance of clocks
// and skews is all that keeps the two apart.
TEST(Replan, HoldsWhereTheStraightWayJustOpensOrCloses) {
  constexpr double kStepS = 0.02;
  int turns = 0;
  int tight = 0;
  for (std::uint64_t k = 0; k < 60; ++k) {
    const std::uint64_t seed = TestSeed(1000 + k);
    FOCALFLEET_TRACE_SEED(seed);
    const std::uint32_t unit = 3;  // has all others around it
    auto fleet = BegunAround(unit, seed);
    if (!fleet) continue;
    const auto target = fleet->DrawTarget(unit, Rng::Stream(seed, "target"));
    ASSERT_TRUE(target);
    ReplanQuestion question{.unit = {unit}, .from = fleet->EndPose(unit), .to = *target};
    std::optional<LateMove> before;
    for (; question.start_s < fleet->plan().makespan_s; question.start_s += kStepS) {
      const auto late = fleet->running().Replan(question, {});
      if (!late) break;
      if (before && GoesStraightAtOnce(*late) != GoesStraightAtOnce(*before)) {
        ++turns;
        const LateMove& clear = GoesStraightAtOnce(*late) ? *late : *before;
        tight += fleet->WouldMeet(clear, 0, 0.5) ? 1 : 0;
        for (int corner = 0; corner < 4; ++corner) {
          fleet->SetClocks(corner);
          fleet->ExpectClear(clear, 0);
        }
      }
      before = *late;
    }
  }
  std::printf("%d times the straight way opens or closes; %d of them are tight\n", turns, tight);
  EXPECT_GT(tight, 5);
}

// Whoever ends early from then on, the late unit or one of its neighbours: with their followers
// stopped in time all pairs are clear, but those that were named.
TEST(Replan, KeepsStopSafety) {
  int draws = 0;
  int unnoticed = 0;
  int matters = 0;
  for (std::uint64_t k = 0; k < kSeeds; ++k) {
    const std::uint64_t seed = TestSeed(720 + k);
    FOCALFLEET_TRACE_SEED(seed);
    auto fleet = Begun(331, seed);
    ASSERT_TRUE(fleet);
    Rng rng = Rng::Stream(seed, "replan");
    for (int n = 0; n < kDraws; ++n) {
      const auto draw = DrawQuestion(&*fleet, &rng, n % 8 < 4 ? 0 : 1 + n % 3);
      if (!draw || draw->failed) continue;
      const auto late = fleet->running().Replan(draw->question, draw->deviations);
      if (!late) continue;
      fleet->Go(*late, {});
      std::vector<std::uint32_t> candidates{draw->unit, draw->unit};
      for (const PositionerIndex j : fleet->fleet().layout.neighbours({draw->unit}))
        if (fleet->Moves(j.value, draw->question.now_s)) candidates.push_back(j.value);
      for (const std::uint32_t ends : candidates) {
        UnderWay then = *fleet;
        const double sign = rng.Below(2) == 0 ? 1 : -1;
        then.SetLateClock(draw->unit, {sign * kLateSkewS, 1 - sign * 0.005});
        const double until_s = ends == draw->unit ? late->end_s : then.EndOf(ends);
        const double t_s = rng.Uniform(draw->question.now_s, until_s);
        ends == draw->unit ? then.StopLate(ends, t_s) : then.Stop(ends, t_s);
        const std::set<std::uint32_t> concerned{draw->unit, ends};
        std::string text;
        matters += then.Unclear(concerned, draw->question.now_s, &text).empty() ? 0 : 1;
        const bool latest = rng.Below(2) == 0;
        then.StopFollowers(ends,
                           [&](double) { return latest ? t_s + 1 : rng.Uniform(t_s, t_s + 1); });
        text.clear();
        ++draws;
        for (const Pair& pair : then.Unclear(concerned, draw->question.now_s, &text)) {
          const bool named = then.IsUnnoticed(pair);
          unnoticed += named ? 1 : 0;
          EXPECT_TRUE(named) << "late unit index " << draw->unit << ", " << ends << " ends at "
                             << t_s << " s:\n"
                             << text;
        }
      }
    }
  }
  std::printf("%d early ends, %d of them matter; %d unclear pairs, named as unnoticed\n", draws,
              matters, unnoticed);
  EXPECT_GT(matters, 20) << "the stops made no difference, the test proves nothing";
}

// A unit and all that were stopped for its sake go on to where they were going, each around those
// before it.
TEST(Replan, SeveralGoOnOneAfterTheOther) {
  int asked = 0;
  int served = 0;
  for (std::uint64_t k = 0; k < kSeeds; ++k) {
    const std::uint64_t seed = TestSeed(740 + k);
    FOCALFLEET_TRACE_SEED(seed);
    auto fleet = Begun(331, seed);
    ASSERT_TRUE(fleet);
    Rng rng = Rng::Stream(seed, "several");
    for (int n = 0; n < 10; ++n) {
      fleet->Reset();
      fleet->DrawClocks(&rng, n % 4);
      const double t_s = rng.Uniform(0, 0.7) * fleet->plan().makespan_s;
      for (int m = 0; m < 6; ++m) {
        const auto i = static_cast<std::uint32_t>(rng.Below(fleet->size()));
        if (!fleet->Moves(i, t_s)) continue;
        fleet->Stop(i, t_s);
        fleet->StopFollowers(i, [&](double) { return t_s + 0.5; });
      }
      fleet->Settle();
      const std::vector<Deviation> deviations = fleet->Deviations();
      std::vector<ReplanQuestion> questions;
      for (const Deviation& deviation : deviations)
        questions.push_back({.unit = deviation.unit,
                             .from = PlaceOf(deviation.stands),
                             .to = fleet->PlannedEnd(deviation.unit.value),
                             .now_s = t_s + 0.6,
                             .start_s = t_s + 2,
                             .start_skew_s = kLateSkewS});
      const auto answers = fleet->running().ReplanAll(questions, deviations);
      ASSERT_EQ(answers.size(), questions.size());
      std::set<std::uint32_t> gone;
      for (std::size_t q = 0; q < answers.size(); ++q) {
        ++asked;
        if (!answers[q]) continue;
        ++served;
        ExpectEndsAt(*answers[q], questions[q]);
        const double sign = rng.Below(2) == 0 ? 1 : -1;
        fleet->Go(*answers[q], {sign * kLateSkewS, 1 - sign * 0.005});
        gone.insert(questions[q].unit.value);
      }
      std::string text;
      EXPECT_TRUE(fleet->Unclear(gone, t_s + 0.6, &text).empty()) << text;
    }
  }
  std::printf("%d stopped units, %d go on within the configuration\n", asked, served);
  EXPECT_GE(served, asked * 9 / 10);
  EXPECT_GT(asked, 200);
}

TEST(Replan, KeepsLimitsOfPower) {
  const std::uint64_t seed = TestSeed(760);
  FOCALFLEET_TRACE_SEED(seed);
  PlanOptions options;
  DrivePowers powers{options.motor};
  // As much as eight motors of a rail take: waiting is needed.
  const double motor_W = powers.Of({AxisDrive{}, WaveMode::kAsymmetric, 1.8}).total_W();
  options.power.total_W = 30.5 * motor_W;
  auto fleet = Begun(61, seed, options);
  ASSERT_TRUE(fleet);
  Rng rng = Rng::Stream(seed, "power");
  const auto runs_of = [&](const AxisPaths& paths, double offset_s, double skew_s,
                           std::map<double, int>* changes) {
    for (const AxisPath& path : paths) {
      for (const Segment& segment : path.segments()) {
        const double t0_s = segment.start_ticks * 1e-4;
        const double t1_s = t0_s + std::abs(segment.delta) * (segment.repeat * 500 / 144e6);
        ++(*changes)[(offset_s + t0_s) / 1.005 - skew_s];
        --(*changes)[(offset_s + t1_s) / 0.995 + skew_s];
      }
    }
  };
  int served = 0;
  int full = 0;
  for (int n = 0; n < 40; ++n) {
    const auto draw = DrawQuestion(&*fleet, &rng, 0);
    if (!draw || draw->failed) continue;
    const auto late = fleet->running().Replan(draw->question, draw->deviations);
    if (!late) continue;
    ++served;
    std::map<double, int> changes;
    for (const UnitPlan& move : fleet->plan().moves)
      if (fleet->StopOf(move.unit.value) == kNever && move.unit.value != draw->unit)
        runs_of(move.path, 0, options.start_skew_s, &changes);
    runs_of(late->move.path, late->start_s, kLateSkewS, &changes);
    int motors = 0;
    int most = 0;
    for (const auto& [t_s, change] : changes) most = std::max(most, motors += change);
    EXPECT_LE(most, 30);
    full += most == 30 ? 1 : 0;
  }
  EXPECT_GT(served, 20);
  EXPECT_GT(full, 5) << "the limit is never reached, the test proves nothing";
}

class ReplanErrors : public ::testing::Test {
 protected:
  void SetUp() override {
    fleet_ = Begun(61, 770);
    ASSERT_TRUE(fleet_);
    // A unit in the middle, which has arrived.
    question_ = {.unit = {30},
                 .from = fleet_->EndPose(30),
                 .to = fleet_->EndPose(30),
                 .now_s = fleet_->plan().makespan_s + 1,
                 .start_s = fleet_->plan().makespan_s + 2};
  }
  void Expect(ErrorCode code, const std::string& words) {
    const auto late = fleet_->running().Replan(question_, deviations_);
    ASSERT_FALSE(late);
    EXPECT_EQ(late.error().code, code);
    EXPECT_NE(late.error().text.find(words), std::string::npos) << late.error().text;
  }
  [[nodiscard]] std::string IdOf(std::uint32_t i) const {
    return std::to_string(fleet_->fleet().layout.unit({i}).id.value);
  }
  /// The nearest that a neighbour's arm comes to the unit's, over all of the unit's directions.
  Pose PoseAgainst(std::uint32_t j) {
    const ArmGeometry mine(fleet_->fleet().layout.unit({30}), fleet_->fleet().drives[30]);
    const ArmGeometry theirs(fleet_->fleet().layout.unit({j}), fleet_->fleet().drives[j]);
    Pose nearest{};
    double least_mm = 1e9;
    for (std::int32_t theta = mine.range().low[0]; theta < mine.range().high[0]; theta += 500) {
      for (std::int32_t phi = mine.range().low[1]; phi < mine.range().high[1]; phi += 500) {
        const double d = DistanceMm(mine.At({theta, phi}), theirs.At(fleet_->EndPose(j)));
        if (d < least_mm) {
          least_mm = d;
          nearest = {theta, phi};
        }
      }
    }
    return nearest;
  }

  std::optional<UnderWay> fleet_;
  ReplanQuestion question_;
  std::vector<Deviation> deviations_;
};

TEST_F(ReplanErrors, NamesWhomTheTargetTouches) {
  for (const PositionerIndex j : fleet_->fleet().layout.neighbours({30})) {
    question_.to = PoseAgainst(j.value);
    const auto late = fleet_->running().Replan(question_, deviations_);
    if (late) continue;  // out of its reach
    Expect(ErrorCode::kInvalid, "the target of unit " + IdOf(30) + " and the place where unit " +
                                    IdOf(j.value) + " ends are ");
    return;
  }
  FAIL() << "no neighbour can be touched";
}

TEST_F(ReplanErrors, RefusesWhatMakesNoSense) {
  const ReplanQuestion good = question_;
  question_.to[0] = 1 << 30;
  Expect(ErrorCode::kInvalid, "outside its axes' ranges");
  question_ = good;
  question_.start_s = question_.now_s - 1;
  Expect(ErrorCode::kInvalid, "cannot start then");
  question_ = good;
  question_.start_s = std::nan("");
  Expect(ErrorCode::kInvalid, "cannot start then");
  question_ = good;
  question_.now_s = std::nan("");
  Expect(ErrorCode::kInvalid, "cannot start then");
  question_ = good;
  question_.start_s = 1e9;
  Expect(ErrorCode::kInvalid, "cannot start then");
  question_ = good;
  question_.unit = {1000};
  Expect(ErrorCode::kInvalid, "no such unit");
}

TEST_F(ReplanErrors, NamesWhoIsInTheWay) {
  // It stands where a neighbour's arm is: whatever it does, it begins against that one.
  for (const PositionerIndex j : fleet_->fleet().layout.neighbours({30})) {
    question_.from = PoseAgainst(j.value);
    const auto late = fleet_->running().Replan(question_, deviations_);
    if (late) continue;
    Expect(ErrorCode::kRefused,
           "no way to the target of unit " + IdOf(30) + " was found: unit " + IdOf(j.value));
    return;
  }
  FAIL() << "no neighbour can be touched";
}

TEST_F(ReplanErrors, StaysOutOfWhereAnotherMayBe) {
  // A neighbour may be anywhere: nothing in its reach can be a target.
  int invalid = 0;
  for (const PositionerIndex j : fleet_->fleet().layout.neighbours({30})) {
    deviations_ = {{j, UnitKnowledge{}, std::nullopt}};
    question_.to = PoseAgainst(j.value);
    const auto late = fleet_->running().Replan(question_, deviations_);
    if (late) continue;
    EXPECT_EQ(late.error().code, ErrorCode::kInvalid);
    EXPECT_NE(late.error().text.find("where unit " + IdOf(j.value) + " may stand"),
              std::string::npos)
        << late.error().text;
    ++invalid;
  }
  EXPECT_GT(invalid, 0);
}

TEST_F(ReplanErrors, ADisabledUnitStays) {
  std::vector<Unit> units = MakeHexLayout({.count = 7});
  units[3].enabled = false;
  PlanningFleet fleet = FleetOf(units);
  DrawStartAndTargets(&fleet, 1);
  const RunningPlan running(fleet.request(), {}, {});
  const auto late = running.Replan(
      {.unit = {3}, .from = PlaceOf(fleet.start[3]), .to = PlaceOf(fleet.start[3]), .start_s = 1},
      {});
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::kRefused);
}

}  // namespace
}  // namespace focalfleet
