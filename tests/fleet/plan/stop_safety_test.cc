// Whole focal planes that are stopped in mid-motion: all at once, one unit, one bus. Judged by the
// public plan and the independent checker alone.
//
// Every unit runs by a clock of its own within the tolerance that the plan allows for, half of them
// at its corners, and all stops are at true times. A unit that ends by itself at t has its
// followers stopped no later than t + notice, and theirs in turn, as far as `since_s` and `left_s`
// say that they are concerned. Then no pair may be unclear at any time, except those that
// Plan::unnoticed names, and those only as far as it says.
//
// What happens before the first stop is what the plan checker has seen of the whole plan, so each
// draw is walked from just before it; and pairs of which neither was stopped are as planned, so
// only those who were stopped and their neighbours are looked at. One test proves that this finds
// the same as a look at everybody from the start.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <numeric>
#include <set>

#include "protocol/base/rng.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::CheckedRow;
using test::CheckedRows;
using test::CheckedUnit;
using test::CheckedUnits;
using test::CheckOptions;
using test::CheckPlan;
using test::CheckReport;
using test::DrawStartAndTargets;
using test::ExpectSound;
using test::FleetOf;
using test::HexFleet;
using test::PlanningFleet;
using test::TestSeed;

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kBeforeS = 0.1;  // walked before the first stop
constexpr int kInstants = 100;
constexpr int kReplanEvery = 20;  // instants

struct Clock {
  double skew_s = 0;
  double rate = 1;  // own seconds per true second
  [[nodiscard]] double Own(double true_s) const { return (true_s - skew_s) * rate; }
  [[nodiscard]] double True(double own_s) const { return own_s / rate + skew_s; }
};

using Pair = std::pair<std::uint32_t, std::uint32_t>;  // indices, lower first
using Units = std::vector<std::uint32_t>;

struct Unclear {
  std::set<Pair> pairs;
  std::string text;
};

/// A planned fleet, ready to be stopped again and again.
class Stopped {
 public:
  Stopped(PlanningFleet fleet, Plan plan, const PlanOptions& options)
      : fleet_(std::move(fleet)), plan_(std::move(plan)), options_(options) {
    const std::size_t n = fleet_.layout.size();
    units_ = CheckedUnits(fleet_.layout, fleet_.drives, fleet_.start, fleet_.frozen);
    rows_.resize(n);
    for (const CheckedRow& row : CheckedRows(plan_, fleet_.layout, fleet_.drives))
      rows_[IndexOf(row.unit)].push_back(row);
    move_of_.resize(n, nullptr);
    for (const UnitPlan& move : plan_.moves) move_of_[move.unit.value] = &move;
    clocks_.resize(n);
    stops_.resize(n, kNever);
  }

  void DrawClocks(Rng* rng) {
    const auto draw = [&](double most) {
      const double u = rng->Uniform(-1, 1);
      return rng->Uniform() < 0.5 ? std::copysign(most, u) : most * u;
    };
    for (Clock& clock : clocks_)
      clock = {draw(options_.start_skew_s), 1 + draw(options_.clock_error)};
  }
  void SetClock(std::uint32_t i, const Clock& clock) { clocks_[i] = clock; }
  void GoOn() { stops_.assign(stops_.size(), kNever); }
  void StopAt(std::uint32_t i, double true_s) { stops_[i] = true_s; }
  [[nodiscard]] double stop(std::uint32_t i) const { return stops_[i]; }

  [[nodiscard]] bool Moves(std::uint32_t i, double true_s) const {
    return !rows_[i].empty() && BeginOf(i) < true_s && true_s < EndOf(i);
  }
  [[nodiscard]] double EndOf(std::uint32_t i) const {
    double end_s = 0;
    for (const CheckedRow& row : rows_[i]) end_s = std::max(end_s, row.t1_s);
    return clocks_[i].True(end_s);
  }

  /// Stops whoever may run into those that are stopped, each at `stop(when the other ended)`.
  /// Returns how many.
  template <class StopTime>
  int StopFollowers(const StopTime& stop) {
    std::vector<std::uint32_t> open = StoppedOnes();
    int count = 0;
    while (!open.empty()) {
      const std::uint32_t i = open.back();
      open.pop_back();
      if (move_of_[i] == nullptr || stops_[i] >= EndOf(i)) continue;
      for (const UnitPlan::Follower& follower : move_of_[i]->followers) {
        const std::uint32_t j = follower.unit.value;
        if (stops_[i] < follower.since_s || stops_[i] > follower.left_s) continue;
        const double stop_s = stop(stops_[i]);
        if (stops_[j] < kNever || stop_s >= EndOf(j)) continue;
        stops_[j] = stop_s;
        ++count;
        open.push_back(j);
      }
    }
    return count;
  }

  [[nodiscard]] Units StoppedOnes() const {
    Units stopped;
    for (std::uint32_t i = 0; i < stops_.size(); ++i)
      if (stops_[i] < kNever) stopped.push_back(i);
    return stopped;
  }
  [[nodiscard]] Units Everybody() const {
    Units all(stops_.size());
    std::iota(all.begin(), all.end(), 0u);
    return all;
  }
  [[nodiscard]] Units StoppedAndNeighbours() const {
    std::set<std::uint32_t> concerned;
    for (const std::uint32_t i : StoppedOnes()) {
      concerned.insert(i);
      for (const PositionerIndex j : fleet_.layout.neighbours({i})) concerned.insert(j.value);
    }
    return {concerned.begin(), concerned.end()};
  }

  /// The pairs among `units` that are not clear at some time from `since_s` on. With
  /// `clearance_mm` other than the layout's: those that come nearer than half-widths and that.
  [[nodiscard]] Unclear Check(const Units& units, double since_s, double clearance_mm,
                              double tolerance_mm) const {
    std::vector<CheckedUnit> checked;
    std::vector<CheckedRow> rows;
    for (const std::uint32_t i : units) checked.push_back(Lay(i, since_s, &rows));
    CheckOptions options;
    options.clearance_mm = clearance_mm;
    options.tolerance_mm = tolerance_mm;
    options.start_skew_s = options.clock_error = 0;  // in the rows already
    const CheckReport report = CheckPlan(std::move(checked), rows, {}, options);
    Unclear unclear;
    for (const std::string& fault : report.faults) {
      if (!fault.starts_with("units ")) {
        ADD_FAILURE() << fault;
        continue;
      }
      const auto a = static_cast<std::uint32_t>(std::stoul(fault.substr(6)));
      const auto b = static_cast<std::uint32_t>(std::stoul(fault.substr(fault.find(" and ") + 5)));
      unclear.pairs.insert(std::minmax(IndexOf(a), IndexOf(b)));
      unclear.text += fault + "\n";
    }
    return unclear;
  }
  [[nodiscard]] Unclear Check(const Units& units, double since_s) const {
    return Check(units, since_s, fleet_.layout.clearance_mm(), CheckOptions{}.tolerance_mm);
  }
  [[nodiscard]] bool Touches(const Pair& pair, double since_s) const {
    return !Check({pair.first, pair.second}, since_s, 1e-9, 0).pairs.empty();
  }

  /// True where the plan itself says that these stops come too late for this pair.
  [[nodiscard]] bool IsUnnoticed(const Pair& pair) const {
    return std::any_of(plan_.unnoticed.begin(), plan_.unnoticed.end(), [&](const Unnoticed& u) {
      const std::uint32_t ends = u.ends.value;
      const std::uint32_t follows = u.follower.value;
      return Pair(std::minmax(ends, follows)) == pair && stops_[ends] >= u.at_s &&
             stops_[follows] > stops_[ends] + u.leaves_s;
    });
  }
  /// How long after the one ended at `end_s` the plan allows for the stop of the other.
  [[nodiscard]] double LeftS(std::uint32_t ends, std::uint32_t follows, double end_s) const {
    for (const Unnoticed& u : plan_.unnoticed)
      if (u.ends.value == ends && u.follower.value == follows && end_s >= u.at_s)
        return std::min(u.leaves_s, options_.notice_s);
    return options_.notice_s;
  }
  [[nodiscard]] std::size_t UnnoticedPairs() const {
    std::set<Pair> pairs;
    for (const Unnoticed& u : plan_.unnoticed)
      pairs.insert(std::minmax(u.ends.value, u.follower.value));
    return pairs.size();
  }

  /// Where everybody stands when all have stopped: whole vectors.
  [[nodiscard]] std::vector<Pose> Poses() const {
    std::vector<Pose> poses;
    for (std::uint32_t i = 0; i < stops_.size(); ++i) {
      Pose pose = PlaceOf(fleet_.start[i]);
      if (move_of_[i] != nullptr)
        for (std::size_t k = 0; k < kAxisCount; ++k)
          pose[k] = PositionAt(pose[k], move_of_[i]->path[k], fleet_.drives[i].axis[k],
                               clocks_[i].Own(stops_[i]));
      poses.push_back(pose);
    }
    return poses;
  }

  [[nodiscard]] const PlanningFleet& fleet() const { return fleet_; }
  [[nodiscard]] const Plan& plan() const { return plan_; }
  [[nodiscard]] const PlanOptions& options() const { return options_; }

  [[nodiscard]] std::string Describe(const Pair& pair) const {
    std::string text = "unit indices " + std::to_string(pair.first) + " (stopped at " +
                       std::to_string(stops_[pair.first]) + " s) and " +
                       std::to_string(pair.second) + " (" + std::to_string(stops_[pair.second]) +
                       " s)";
    for (const auto& [i, j] : {pair, Pair{pair.second, pair.first}}) {
      if (move_of_[i] == nullptr) continue;
      for (const UnitPlan::Follower& f : move_of_[i]->followers)
        if (f.unit.value == j)
          text += "; " + std::to_string(j) + " follows " + std::to_string(i) + " since " +
                  std::to_string(f.since_s) + " begins " + std::to_string(f.begins_s) + " left " +
                  std::to_string(f.left_s);
      for (const Unnoticed& u : plan_.unnoticed)
        if (u.ends.value == i && u.follower.value == j)
          text += "; unnoticed from " + std::to_string(u.at_s) + " leaves " +
                  std::to_string(u.leaves_s);
    }
    return text;
  }

 private:
  [[nodiscard]] std::uint32_t IndexOf(std::uint32_t id) const {
    return fleet_.layout.Find(UnitId{id})->value;
  }
  [[nodiscard]] double BeginOf(std::uint32_t i) const {
    double begin_s = kNever;
    for (const CheckedRow& row : rows_[i]) begin_s = std::min(begin_s, row.t0_s);
    return clocks_[i].True(begin_s);
  }
  /// Appends what is left of the rows between `since_s` and the stop, in true time after
  /// `since_s`; returns the unit as it stands at `since_s`.
  [[nodiscard]] CheckedUnit Lay(std::uint32_t i, double since_s,
                                std::vector<CheckedRow>* rows) const {
    CheckedUnit unit = units_[i];
    for (const CheckedRow& row : rows_[i]) {
      const double t0 = clocks_[i].True(row.t0_s);
      const double t1 = clocks_[i].True(row.t1_s);
      const double begin = std::max(t0, since_s);
      const double end = std::min(t1, stops_[i]);
      const auto at = [&](double t) {
        if (t <= t0) return row.from_deg;
        if (t >= t1) return row.to_deg;
        return row.from_deg + (row.to_deg - row.from_deg) * (t - t0) / (t1 - t0);
      };
      double& stands = unit.axis[row.axis].start_deg;
      if (t0 < since_s) stands = at(std::min(since_s, end));
      if (end <= begin) continue;
      rows->push_back({row.unit, row.axis, begin - since_s, end - since_s, at(begin), at(end)});
    }
    return unit;
  }

  PlanningFleet fleet_;
  Plan plan_;
  PlanOptions options_;
  std::vector<CheckedUnit> units_;
  std::vector<std::vector<CheckedRow>> rows_;  // by the units' own clocks
  std::vector<const UnitPlan*> move_of_;
  std::vector<Clock> clocks_;
  std::vector<double> stops_;  // true time
};

/// What came of many stops.
struct Tally {
  int draws = 0;
  int stopped = 0;
  int stopped_most = 0;
  int unclear = 0;    // pairs that the plan does not except
  int touching = 0;   // those among them whose arms meet
  int unnoticed = 0;  // pairs that the plan excepts, and that were not clear
  int unnoticed_touching = 0;

  void Count(const Stopped& fleet, int followers, double since_s) {
    ++draws;
    stopped += followers;
    stopped_most = std::max(stopped_most, followers);
    const Unclear found = fleet.Check(fleet.StoppedAndNeighbours(), since_s);
    for (const Pair& pair : found.pairs) {
      const bool touches = fleet.Touches(pair, since_s);
      if (fleet.IsUnnoticed(pair)) {
        ++unnoticed;
        unnoticed_touching += touches ? 1 : 0;
        continue;
      }
      ++unclear;
      touching += touches ? 1 : 0;
      if (unclear <= 5)
        std::printf("%s: %s\n%s", touches ? "TOUCH" : "UNCLEAR", fleet.Describe(pair).c_str(),
                    found.text.c_str());
    }
  }
  void Print(const char* what) const {
    std::printf(
        "%s: %d stops, %.2f followers stopped on average, %d at most; pairs unclear %d, touching "
        "%d; of unnoticed pairs unclear %d, touching %d\n",
        what, draws, static_cast<double>(stopped) / std::max(draws, 1), stopped_most, unclear,
        touching, unnoticed, unnoticed_touching);
  }
};

/// From where all stand now everybody gets to the target that it had.
void ExpectANewPlan(const Stopped& fleet, double t_s) {
  PlanningFleet again = fleet.fleet();
  again.StandAt(fleet.Poses());
  const auto plan = MakePlan(again.request(), {.lead_apart = true});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty()) << "stopped at " << t_s << " s";
  if (plan->too_near.empty()) ExpectSound(again, *plan);
  std::printf("replanned from a stop at %.2f s: %zu moves, %zu unserved, makespan %.2f s%s\n", t_s,
              plan->moves.size(), plan->unserved.size(), plan->makespan_s,
              plan->too_near.empty() ? "" : ", pairs led apart");
}

class StopSafety : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    seed_ = TestSeed(static_cast<std::uint64_t>(GetParam()));
    PlanningFleet fleet = FleetOf(Plate(), {});
    ASSERT_NO_FATAL_FAILURE(DrawStartAndTargets(&fleet, seed_));
    const PlanOptions options = Options();
    auto plan = MakePlan(fleet.request(), options);
    ASSERT_TRUE(plan) << plan.error().text;
    EXPECT_TRUE(plan->unserved.empty()) << plan->unserved.size() << " units";
    fleet_.emplace(std::move(fleet), std::move(*plan), options);
  }
  [[nodiscard]] virtual PlanOptions Options() const { return {}; }
  [[nodiscard]] virtual std::vector<Unit> Plate() const { return MakeHexLayout({.count = 5000}); }
  [[nodiscard]] double DrawInstant(Rng* rng) const {
    return rng->Uniform(0, fleet_->plan().makespan_s);
  }

  std::uint64_t seed_ = 0;
  std::optional<Stopped> fleet_;
};

TEST_P(StopSafety, FewPairsAreUnnoticed) {
  FOCALFLEET_TRACE_SEED(seed_);
  const Plan& plan = fleet_->plan();
  std::size_t followers = 0;
  for (const UnitPlan& move : plan.moves) followers += move.followers.size();
  const double share = static_cast<double>(fleet_->UnnoticedPairs()) / plan.crossings;
  std::printf(
      "FOCALFLEET_SEED=%llu makespan %.2f s bound %.2f s crossings %u followers %zu unnoticed %zu "
      "entries %zu pairs share %.2f %%\n",
      static_cast<unsigned long long>(seed_), plan.makespan_s, plan.bound_s, plan.crossings,
      followers, plan.unnoticed.size(), fleet_->UnnoticedPairs(), share * 100);
  EXPECT_GT(plan.crossings, 0u);
  EXPECT_LE(share, 0.02);
}

TEST_P(StopSafety, AllStopAtOnce) {
  constexpr double kStopSkewS = 0.020;
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop all");
  Tally at_once;
  Tally skewed;
  int late = 0;
  for (int draw = 0; draw < kInstants; ++draw) {
    const double t_s = DrawInstant(&rng);
    fleet_->DrawClocks(&rng);
    for (const bool with_skew : {false, true}) {
      for (const std::uint32_t i : fleet_->Everybody())
        fleet_->StopAt(i, t_s + (with_skew ? rng.Uniform(-kStopSkewS, kStopSkewS) : 0));
      (with_skew ? skewed : at_once).Count(*fleet_, 0, std::max(t_s - kBeforeS, -kBeforeS));
    }
    if (draw % kReplanEvery == 0) ExpectANewPlan(*fleet_, t_s);
    // Not at once: every other unit goes on for long.
    if (draw < 3) {
      for (const std::uint32_t i : fleet_->Everybody())
        if (i % 2 == 0) fleet_->StopAt(i, t_s + 10);
      late += static_cast<int>(fleet_->Check(fleet_->Everybody(), t_s).pairs.size());
    }
  }
  at_once.Print("all at once");
  skewed.Print("all within the skew");
  EXPECT_EQ(at_once.unclear, 0);
  EXPECT_EQ(at_once.unnoticed, 0);
  EXPECT_EQ(skewed.unclear, 0);
  EXPECT_GT(late, 0) << "no stop matters, the test proves nothing";
}

/// One way to stop, over and over: with followers stopped as late as is allowed, with followers
/// stopped some time before, and with nobody stopped.
template <class First>
void StopAgainAndAgain(Stopped* fleet, Rng* rng, const First& first) {
  Tally latest;
  Tally earlier;
  Tally ignored;
  for (int draw = 0; draw < kInstants; ++draw) {
    fleet->DrawClocks(rng);
    const double t_s = rng->Uniform(0, fleet->plan().makespan_s);
    const Units ends = first(t_s);
    if (ends.empty()) continue;
    const double notice_s = fleet->options().notice_s;
    for (Tally* tally : {&latest, &earlier, &ignored}) {
      fleet->GoOn();
      for (const std::uint32_t i : ends) fleet->StopAt(i, t_s);
      int followers = 0;
      if (tally == &latest)
        followers = fleet->StopFollowers([&](double) { return t_s + notice_s; });
      if (tally == &earlier)
        followers = fleet->StopFollowers(
            [&](double ended_s) { return rng->Uniform(ended_s, t_s + notice_s); });
      const bool silent = tally == &ignored;
      if (silent) {
        ++ignored.draws;
        ignored.unclear += static_cast<int>(
            fleet->Check(fleet->StoppedAndNeighbours(), t_s - kBeforeS).pairs.size());
      } else {
        tally->Count(*fleet, followers, t_s - kBeforeS);
        if (tally == &latest && draw % kReplanEvery == 0) ExpectANewPlan(*fleet, t_s);
      }
    }
  }
  latest.Print("followers at the last moment");
  earlier.Print("followers some time before");
  std::printf("nobody is stopped: %d unclear pairs in %d draws\n", ignored.unclear, ignored.draws);
  EXPECT_GT(latest.draws, kInstants / 2);
  EXPECT_EQ(latest.unclear, 0);
  EXPECT_EQ(earlier.unclear, 0);
  EXPECT_GT(ignored.unclear, 0) << "the stops made no difference, the test proves nothing";
}

TEST_P(StopSafety, OneUnitEndsEarly) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop one");
  StopAgainAndAgain(&*fleet_, &rng, [&](double t_s) {
    Units moving;
    for (const std::uint32_t i : fleet_->Everybody())
      if (fleet_->Moves(i, t_s)) moving.push_back(i);
    return moving.empty() ? Units{} : Units{moving[rng.Below(moving.size())]};
  });
}

TEST_P(StopSafety, ABusEndsEarly) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop bus");
  StopAgainAndAgain(&*fleet_, &rng, [&](double t_s) {
    const auto buses = fleet_->fleet().layout.buses();
    const BusId bus = buses[rng.Below(buses.size())];
    Units moving;
    for (const std::uint32_t i : fleet_->Everybody())
      if (fleet_->fleet().layout.unit({i}).bus == bus && fleet_->Moves(i, t_s)) moving.push_back(i);
    return moving;
  });
}

// Each follower of each unit by itself, with the two clocks as far apart as they may be.
struct SingleStops {
  int draws = 0;
  int stopped = 0;
  int matters = 0;    // unclear without the stop
  int unclear = 0;    // with the stop after the time that the plan leaves
  int unnoticed = 0;  // with the stop after the notice, where the plan leaves less
  int not_named = 0;  // with the stop after the notice, where the plan says that this is in time
};

void StopEveryFollower(Stopped* fleet, Rng* rng, int times) {
  const PlanOptions& options = fleet->options();
  SingleStops count;
  for (const UnitPlan& move : fleet->plan().moves) {
    const std::uint32_t i = move.unit.value;
    for (const UnitPlan::Follower& follower : move.followers) {
      const std::uint32_t j = follower.unit.value;
      for (int n = 0; n < times; ++n) {
        const double sign = n % 2 == 0 ? 1 : -1;
        fleet->GoOn();
        fleet->SetClock(i, {sign * options.start_skew_s, 1 - sign * options.clock_error});
        fleet->SetClock(j, {-sign * options.start_skew_s, 1 + sign * options.clock_error});
        // Before since and after left it is nobody's concern: that is to be seen too.
        // A stop before `begins_s` cannot come too late, so most are tried where it comes later.
        const bool early = rng->Uniform() < 0.25;
        const double late_s = std::max(follower.since_s, follower.begins_s - options.notice_s);
        const double t_s =
            rng->Uniform(early ? follower.since_s - 1 : late_s, follower.left_s + (early ? 1 : 0));
        if (t_s < 0 || !fleet->Moves(i, t_s)) continue;
        ++count.draws;
        const auto unclear_with = [&](double stop_s) {
          fleet->StopAt(i, t_s);
          fleet->StopAt(j, stop_s);
          return !fleet->Check({i, j}, t_s - kBeforeS).pairs.empty();
        };
        const bool concerned = t_s >= follower.since_s && t_s <= follower.left_s;
        count.stopped += concerned ? 1 : 0;
        if (!unclear_with(kNever)) continue;
        ++count.matters;
        const double left_s = fleet->LeftS(i, j, t_s);
        if (!concerned || unclear_with(t_s + left_s)) {
          if (++count.unclear <= 5)
            std::printf("UNCLEAR %s\n", fleet->Describe(std::minmax(i, j)).c_str());
        }
        if (concerned && unclear_with(t_s + options.notice_s))
          ++(left_s < options.notice_s ? count.unnoticed : count.not_named);
      }
    }
  }
  std::printf(
      "every follower: %d draws, %d stops, %d unclear without; unclear with the stop in the time "
      "that is left %d; with the stop after the notice %d named, %d not\n",
      count.draws, count.stopped, count.matters, count.unclear, count.unnoticed, count.not_named);
  EXPECT_EQ(count.unclear, 0);
  EXPECT_EQ(count.not_named, 0);
  EXPECT_GT(count.matters, 0) << "the stops made no difference, the test proves nothing";
}

TEST_P(StopSafety, EveryFollowerIsStoppedInTime) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop pairs");
  StopEveryFollower(&*fleet_, &rng, 16);
}
INSTANTIATE_TEST_SUITE_P(Seeds, StopSafety, ::testing::Range(1, 4));

class StopSafetyOnce : public StopSafety {};

// With followers ignored, so that there is something to find.
TEST_P(StopSafetyOnce, ALookAtTheNeighboursFindsWhatALookAtAllFinds) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "restricted");
  const auto buses = fleet_->fleet().layout.buses();
  std::size_t found = 0;
  for (int draw = 0; draw < 3; ++draw) {
    fleet_->DrawClocks(&rng);
    fleet_->GoOn();
    const double t_s = rng.Uniform(0.2, 0.8) * fleet_->plan().makespan_s;
    const BusId bus = buses[rng.Below(buses.size())];
    for (const std::uint32_t i : fleet_->Everybody())
      if (fleet_->fleet().layout.unit({i}).bus == bus) fleet_->StopAt(i, t_s);
    const Unclear near = fleet_->Check(fleet_->StoppedAndNeighbours(), t_s - kBeforeS);
    const Unclear all = fleet_->Check(fleet_->Everybody(), -kBeforeS);
    EXPECT_EQ(near.pairs, all.pairs) << near.text << "---\n" << all.text;
    found += all.pairs.size();
  }
  std::printf("the same %zu unclear pairs by both looks\n", found);
  EXPECT_GT(found, 0u) << "nothing was found, the test proves nothing";
}

// Where units stand so dense that they go in an order, no pair is proven with notice: what the plan
// says of the time that is left must hold all the same.
class StopSafetyInOrder : public StopSafety {
 protected:
  [[nodiscard]] std::vector<Unit> Plate() const override { return MakeHexLayout(SdssLike(1000)); }
};

TEST_P(StopSafetyInOrder, EveryFollowerIsStoppedInTimeOrNamed) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "stop pairs");
  const Plan& plan = fleet_->plan();
  std::printf("makespan %.2f s, crossings %u, unnoticed pairs %zu\n", plan.makespan_s,
              plan.crossings, fleet_->UnnoticedPairs());
  StopEveryFollower(&*fleet_, &rng, 16);
}

// In stages a unit may halt unseen, with both axes, and nobody need be stopped before the next one.
class StopSafetyInStages : public StopSafety {
 protected:
  [[nodiscard]] PlanOptions Options() const override { return {.stall_tolerant = true}; }
  /// When any unit may begin the stage after the one of `t_s`, whatever its clock; for ever after
  /// the last. Units: s.
  [[nodiscard]] double NextStage(double t_s) const {
    const auto& stages = fleet_->plan().stages_s;
    const auto next = std::upper_bound(stages.begin(), stages.end(), t_s);
    const PlanOptions& options = fleet_->options();
    return next == stages.end() ? kNever : *next / (1 + options.clock_error) - options.start_skew_s;
  }
};

TEST_P(StopSafetyInStages, AHaltThatNobodySeesTouchesNobody) {
  FOCALFLEET_TRACE_SEED(seed_);
  Rng rng = Rng::Stream(seed_, "halts");
  const Plan& plan = fleet_->plan();
  Tally tally;
  int without_stages = 0;
  for (int draw = 0; draw < kInstants; ++draw) {
    fleet_->DrawClocks(&rng);
    const double t_s = DrawInstant(&rng);
    for (const bool in_stages : {true, false}) {
      fleet_->GoOn();
      if (in_stages)
        for (const std::uint32_t i : fleet_->Everybody()) fleet_->StopAt(i, NextStage(t_s));
      int halted = 0;
      for (const std::uint32_t i : fleet_->Everybody()) {
        if (i % 40 != static_cast<std::uint32_t>(draw % 40) || !fleet_->Moves(i, t_s)) continue;
        fleet_->StopAt(i, t_s);
        ++halted;
      }
      if (halted == 0) break;
      if (in_stages)
        tally.Count(*fleet_, halted, t_s - kBeforeS);
      else
        without_stages += static_cast<int>(
            fleet_->Check(fleet_->StoppedAndNeighbours(), t_s - kBeforeS).pairs.size());
    }
  }
  std::printf("%zu stages, makespan %.2f s, bound %.2f s; ", plan.stages_s.size(), plan.makespan_s,
              plan.bound_s);
  tally.Print("one in forty halts");
  EXPECT_GT(tally.draws, kInstants / 2);
  EXPECT_EQ(tally.unclear + tally.unnoticed, 0);
  EXPECT_GT(without_stages, 0) << "the stages made no difference, the test proves nothing";
}
INSTANTIATE_TEST_SUITE_P(Seeds, StopSafetyInStages, ::testing::Range(1, 3));

TEST(StopTimes, TheTimeThatIsLeftHoldsForBadClocks) {
  PlanningFleet fleet = HexFleet(127);
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    FOCALFLEET_TRACE_SEED(TestSeed(seed));
    ASSERT_NO_FATAL_FAILURE(DrawStartAndTargets(&fleet, TestSeed(seed)));
    for (const bool in_order : {false, true}) {
      const PlanOptions options{.lead_apart = in_order, .clock_error = 0.04};
      auto plan = MakePlan(fleet.request(), options);
      ASSERT_TRUE(plan) << plan.error().text;
      Stopped stopped(fleet, std::move(*plan), options);
      Rng rng = Rng::Stream(TestSeed(seed), "stop pairs");
      StopEveryFollower(&stopped, &rng, 160);
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Seeds, StopSafetyInOrder, ::testing::Values(1));
INSTANTIATE_TEST_SUITE_P(Seeds, StopSafetyOnce, ::testing::Values(1));

}  // namespace
}  // namespace focalfleet
