#include "tests/scenario/plane_judge.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace focalfleet::test {
namespace {

using Point = std::complex<double>;

// At rest the rotor lags its field by 4 vectors of 96; two more are for rounding.
constexpr double kLagVectors = 6;
// A measured offset has the lag of the way before it; the next way may come from the other side.
constexpr double kMeasuredLagVectors = 10;
constexpr DurationNs kLook = Milliseconds(10);
// SectorAgentConfig::confirm_fresh, and a word under way.
constexpr DurationNs kWindow = Milliseconds(110);

double Cross(Point a, Point b) { return a.real() * b.imag() - a.imag() * b.real(); }

double FromSegment(Point p, Point a, Point b) {
  const Point way = b - a;
  const double share =
      std::norm(way) == 0 ? 0 : std::real((p - a) * std::conj(way)) / std::norm(way);
  return std::abs(p - (a + std::clamp(share, 0.0, 1.0) * way));
}

double Between(std::pair<Point, Point> one, std::pair<Point, Point> other) {
  const auto [a, b] = one;
  const auto [c, d] = other;
  if (Cross(b - a, c - a) * Cross(b - a, d - a) < 0 &&
      Cross(d - c, a - c) * Cross(d - c, b - c) < 0)
    return 0;
  return std::min(
      {FromSegment(a, c, d), FromSegment(b, c, d), FromSegment(c, a, b), FromSegment(d, a, b)});
}

}  // namespace

PlaneJudge::PlaneJudge(PlaneInProcess* plane)
    : plane_(*plane),
      begins_(plane->layout().layout().size()),
      moving_(plane->layout().layout().size()),
      given_(plane->layout().sectors()),
      held_(plane->layout().sectors()),
      decided_(plane->layout().sectors(), HostInstant{INT64_MIN / 2}) {
  const auto units = plane_.layout().layout().units();
  for (std::uint32_t i = 0; i < units.size(); ++i)
    for (std::uint32_t j = i + 1; j < units.size(); ++j) {
      const Point apart{units[i].base_fp.x_mm - units[j].base_fp.x_mm,
                        units[i].base_fp.y_mm - units[j].base_fp.y_mm};
      if (std::abs(apart) < units[i].reach_mm() + units[j].reach_mm()) near_.emplace_back(i, j);
    }
}

void PlaneJudge::Broken(const std::string& rule, const std::string& what) {
  broken_.push_back(std::to_string(1e-9 * static_cast<double>(plane_.now().ns)) + " s " + rule +
                    ": " + what);
}

void PlaneJudge::Commanded(std::uint32_t sector, const SectorAgent& agent, const Command& command) {
  if (std::holds_alternative<SectorRound>(command.what)) {
    held_[sector] = RoundOf{agent.accepted(), agent.round()};
  } else if (std::holds_alternative<SectorStartCommand>(command.what)) {
    given_[sector] = held_[sector];
    decided_[sector] = plane_.now();
    ++starts_;
  }
}

void PlaneJudge::Struck(std::optional<std::uint32_t> sector) {
  struck_.emplace_back(plane_.now(), sector);
}

/// A fault struck one of the sectors while they agreed on their last start.
bool PlaneJudge::IsExcused(std::uint32_t a, std::uint32_t b) const {
  if (a == b) return false;
  for (const auto& [at, sector] : struck_) {
    if (sector && *sector != a && *sector != b) continue;
    for (const HostInstant decided : {decided_[a], decided_[b]})
      if (at >= decided - kWindow && at <= decided + kWindow) return true;
  }
  return false;
}

void PlaneJudge::Look() {
  if (plane_.now() < look_at_) return;
  look_at_ = plane_.now() + kLook;
  std::vector<sim::UnitTruth> truths;
  for (std::size_t n = 0; n < plane_.layout().layout().size(); ++n)
    truths.push_back(plane_.world().Truth(n));
  LookAtBegins(truths);
  LookForContact(truths);
}

void PlaneJudge::LookAtBegins(const std::vector<sim::UnitTruth>& truths) {
  for (std::uint32_t n = 0; n < truths.size(); ++n) {
    const sim::UnitTruth& truth = truths[n];
    const std::string name = "unit " + std::to_string(truth.id.value);
    if (truth.state != UnitState::kMoving) moving_[n].reset();
    if (truth.moves_begun == begins_[n]) continue;
    begins_[n] = truth.moves_begun;
    ++begun_;
    if (truth.begun_twice != 0) Broken("twice", name + " began a move twice");
    const std::uint32_t sector = plane_.layout().SectorOf({n});
    moving_[n] = given_[sector];
    const auto& stored = plane_.sectors[sector].storage.memory().begun;
    const bool intended = std::any_of(stored.begin(), stored.end(), [&](const IntentRow& row) {
      return row.unit == truth.id && row.move == truth.last_move;
    });
    if (!intended) Broken("start", name + " began without a durable intent");
  }
  for (const auto& [i, j] : near_) {
    const std::uint32_t a = plane_.layout().SectorOf({i});
    const std::uint32_t b = plane_.layout().SectorOf({j});
    if (a == b || !moving_[i] || !moving_[j] || *moving_[i] == *moving_[j]) continue;
    Broken("split", "units " + std::to_string(truths[i].id.value) + " and " +
                        std::to_string(truths[j].id.value) + " move by different rounds");
    moving_[i].reset();
  }
}

void PlaneJudge::LookForContact(const std::vector<sim::UnitTruth>& truths) {
  const auto units = plane_.layout().layout().units();
  std::vector<std::pair<Point, Point>> arms;
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    const double degree = std::numbers::pi / 180;
    const double theta = (truths[n].angle_deg[0] + units[n].axis[0].zero_deg) * degree;
    const double phi = (truths[n].angle_deg[1] + units[n].axis[1].zero_deg) * degree;
    const Point elbow = Point{units[n].base_fp.x_mm, units[n].base_fp.y_mm} +
                        std::polar(units[n].axis[0].arm_mm, theta);
    arms.emplace_back(elbow, elbow + std::polar(units[n].axis[1].arm_mm, theta + phi));
  }
  for (const auto& pair : near_) {
    const auto [i, j] = pair;
    const double apart =
        Between(arms[i], arms[j]) - units[i].arm_half_width_mm - units[j].arm_half_width_mm;
    nearest_mm_ = std::min(nearest_mm_, apart);
    if (apart >= 0) {
      touching_.erase(pair);
    } else if (touching_.insert(pair).second) {
      if (IsExcused(plane_.layout().SectorOf({i}), plane_.layout().SectorOf({j}))) {
        ++excused_;
        continue;
      }
      Broken("contact", "units " + std::to_string(units[i].id.value) + " and " +
                            std::to_string(units[j].id.value) + " touch, " + std::to_string(apart) +
                            " mm");
    }
  }
}

void PlaneJudge::LookAtStores() {
  for (std::uint32_t n = 0; n < plane_.layout().layout().size(); ++n) {
    const PlaneInProcess::Sector& sector = plane_.sectors[plane_.layout().SectorOf({n})];
    const sim::UnitTruth truth = plane_.world().Truth(n);
    const std::string name = "unit " + std::to_string(truth.id.value);
    const auto& intents = sector.storage.memory().fleet.open_intents;
    if (std::any_of(intents.begin(), intents.end(),
                    [&](const IntentRow& row) { return row.unit == truth.id; }))
      Broken("place", name + " has an open intent at rest");
    const VectorRow* row =
        sector.storage.memory().Vector(sector.coordinator->unit(plane_.layout().Local({n})).serial);
    if (row == nullptr) {
      Broken("place", name + " is not stored");
      continue;
    }
    for (const Axis axis : kAxes) {
      const AxisKnowledge& known = row->knowledge[Index(axis)];
      const double at = truth.vectors[Index(axis)];
      const double lag = row->offset == Pose{} ? kLagVectors : kMeasuredLagVectors;
      if (known.witness != Witness::kUnknown && (at < known.low - lag || at > known.high + lag))
        Broken("place", name + " is not where its store has it: " + std::to_string(at) +
                            ", stored " + std::to_string(known.low) + " to " +
                            std::to_string(known.high));
    }
  }
}

void PlaneJudge::LookAtArrivals(const std::vector<std::optional<Pose>>& targets) {
  std::uint32_t there = 0;
  for (std::uint32_t n = 0; n < targets.size(); ++n) {
    const sim::UnitTruth truth = plane_.world().Truth(n);
    bool at = targets[n].has_value();
    const UnitView& view = plane_.unit({n});
    const double lag = view.offset == Pose{} ? kLagVectors : kMeasuredLagVectors;
    for (const Axis axis : kAxes)
      at = at && std::abs(truth.vectors[Index(axis)] - (*targets[n])[Index(axis)]) <= lag;
    there += at ? 1u : 0u;
  }
  const OutcomeCounts& counts = plane_.plane().view().counts;
  if (counts.arrived > there)
    Broken("arrived", std::to_string(counts.arrived) + " are counted, and " +
                          std::to_string(there) + " are there");
}

}  // namespace focalfleet::test
