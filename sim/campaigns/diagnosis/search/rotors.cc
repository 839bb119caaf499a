#include "sim/campaigns/diagnosis/search/rotors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/angle_errors.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/term_trace.h"
#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/effects/rotor_ways.h"

namespace focalfleet::sim {
namespace {

// The angle errors of a unit's axis, and the conditions that they depend on.
struct RotorRow {
  double error_deg;  // of the axis
  double sigma_deg;
  double motor_deg;  // commanded, without whole turns
  double drive;      // of the move that brought the axis here
};
struct Rotor {
  double gear = 1;
  std::vector<RotorRow> rows;
};

Rotor RotorOf(const Fit& fit, std::size_t unit, std::size_t axis) {
  const UnitTrack track = TrackOf(fit.model, *fit.facts, unit);
  const std::span<const double> drive = track.Column("drive_amplitude");
  // The error of a rotor at rest stays until the axis moves again.
  constexpr std::size_t kNever = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> moved(track.moves, kNever);
  std::size_t last = kNever;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i]) last = kNever;
    if (track.step_deg[axis][i] != 0) last = i;
    moved[i] = last;
  }
  Rotor rotor{.gear = track.unit->gear[axis]};
  const double noise_deg = std::hypot(fit.noise.angle_deg[axis], fit.noise.rest_deg[axis]);
  const double factor = std::max(fit.noise.unit_factor[unit], 1.0);
  for (const AngleRow& row : AngleErrors(fit, track, axis)) {
    const std::size_t at = moved[row.move];
    if (at == kNever) continue;
    rotor.rows.push_back(
        {row.error_deg, factor * std::hypot(row.sigma_deg(1e-3 * fit.noise.place_um), noise_deg),
         360 * HarmonicPhase(track, axis, at, rotor.gear), std::max(drive[at], kDriveLeast)});
  }
  return rotor;
}

// -2 ln L of the rows by a robust density, with a zero of their own.
double CostOf(const Rotor& rotor, const RotorWay& way, double strength, double phase_rad,
              std::vector<double>* left) {
  left->clear();
  double sum = 0, weights = 0;
  for (const RotorRow& row : rotor.rows) {
    const double wave = way.harmonic * row.motor_deg * kRadiansPerDegree + phase_rad;
    const double at_drive = strength / std::pow(row.drive, way.falls);
    const double error = way.error(way.harmonic, wave, at_drive) / kRadiansPerDegree / rotor.gear;
    const double weight = 1 / (row.sigma_deg * row.sigma_deg);
    left->push_back(row.error_deg - error);
    sum += weight * left->back(), weights += weight;
  }
  double cost = 0;
  for (std::size_t k = 0; k < left->size(); ++k) {
    const double off = ((*left)[k] - sum / weights) / rotor.rows[k].sigma_deg;
    cost += 2 * MinusLogDensity(off * off);
  }
  return cost;
}

// The least cost over strength and phase: a grid, then smaller and smaller steps about the best.
double LeastCost(const Rotor& rotor, const RotorWay& way) {
  constexpr double kLow = 0.03, kRatio = 1.5;
  constexpr int kStrengths = 10, kPhases = 24, kHalvings = 6;
  std::vector<double> left;
  double best = std::numeric_limits<double>::infinity(), log_strength = 0, phase = 0;
  const auto look = [&](double log_s, double p) {
    const double cost = CostOf(rotor, way, std::exp(log_s), p, &left);
    if (cost >= best) return false;
    best = cost, log_strength = log_s, phase = p;
    return true;
  };
  for (int s = 0; s < kStrengths; ++s)
    for (int p = 0; p < kPhases; ++p)
      look(std::log(kLow) + s * std::log(kRatio), 2 * std::numbers::pi * p / kPhases);
  double step_log = std::log(kRatio) / 2, step_phase = std::numbers::pi / kPhases;
  for (int halving = 0; halving < kHalvings; ++halving, step_log /= 2, step_phase /= 2)
    for (bool better = true; better;) {
      const double log_s = log_strength, p = phase;
      better = look(log_s + step_log, p) || look(log_s - step_log, p) ||
               look(log_s, p + step_phase) || look(log_s, p - step_phase);
    }
  return best;
}

bool IsOfRotor(const ModelTerm& term, std::size_t axis) {
  return HasRotorWays(term.form.effect->cause) && AxisIndex(term.form) == axis;
}

// The term of the axis with the largest effect; kNoTerm: it has none.
std::size_t StrongestOfAxis(const Fit& fit, std::size_t axis, std::vector<double>* square_um2) {
  std::size_t strongest = kNoTerm;
  double most_um = 0;
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    if (!IsOfRotor(fit.model.terms[t], axis)) continue;
    TermTrace trace = TraceOf(fit, fit.model.terms[t]);
    if (strongest != kNoTerm && trace.rms_um <= most_um) continue;
    strongest = t, most_um = trace.rms_um, *square_um2 = std::move(trace.square_um2);
  }
  return strongest;
}

// Whether the term turns rotors by so much, electrically.
bool IsFar(const Fit& fit, std::size_t term, double far_deg) {
  const ModelTerm& of = fit.model.terms[term];
  return std::abs(Summarise(of).value) * MedianGear(fit.model, AxisIndex(of.form)) >= far_deg;
}

// The best way of a cause, the same for all units, and its cost.
struct BestWay {
  const RotorWay* way = nullptr;
  double cost = std::numeric_limits<double>::infinity();
};
BestWay BestWayOf(std::string_view cause, const std::vector<Rotor>& rotors,
                  const ParallelFor& parallel) {
  const std::span<const RotorWay> ways = RotorWays();
  const std::size_t count = rotors.size();
  std::vector<double> cost(ways.size() * count);
  parallel(cost.size(), [&](std::size_t k) {
    if (ways[k / count].cause == cause) cost[k] = LeastCost(rotors[k % count], ways[k / count]);
  });
  BestWay best;
  for (std::size_t k = 0; k < ways.size(); ++k) {
    if (ways[k].cause != cause) continue;
    const auto from = cost.begin() + static_cast<std::ptrdiff_t>(k * count);
    const double sum = std::accumulate(from, from + static_cast<std::ptrdiff_t>(count), 0.0);
    if (sum < best.cost) best = {&ways[k], sum};
  }
  return best;
}

// The rotors that are turned most.
std::vector<Rotor> TakeRotors(const Fit& fit, std::size_t axis,
                              const std::vector<double>& square_um2) {
  constexpr std::size_t kMost = 24;
  Fit without = fit;
  std::erase_if(without.model.terms, [&](const ModelTerm& term) { return IsOfRotor(term, axis); });
  UpdateResiduals(&without);
  std::vector<std::size_t> units;
  for (std::size_t unit = 0; unit < square_um2.size(); ++unit)
    if (square_um2[unit] > 0) units.push_back(unit);
  std::ranges::stable_sort(units, std::ranges::greater{},
                           [&](std::size_t unit) { return square_um2[unit]; });
  units.resize(std::min(units.size(), kMost));
  std::vector<Rotor> rotors;
  for (const std::size_t unit : units) rotors.push_back(RotorOf(without, unit, axis));
  return rotors;
}

// Whether one way is clearly better: beyond chance, and by a quarter of what it leaves itself above
// noise. The excess is no scatter but a misfit. A detent of order 1 and a circle beside the origin
// are one curve.
bool IsClear(const BestWay& a, const BestWay& b, const std::vector<Rotor>& rotors) {
  constexpr double kOfNormal = 1.15;    // mean of 2 MinusLogDensity of a normal number's square
  constexpr double kClearly = 15;       // -2 ln L
  constexpr double kDispersionMax = 2;  // rows far from either way do not separate the two
  constexpr double kOfMisfit = 0.25;
  if (a.way->harmonic == 1 && b.way->harmonic == 1) return false;
  double rows = 0;
  for (const Rotor& rotor : rotors) rows += static_cast<double>(rotor.rows.size());
  const double of_noise = kOfNormal * rows, least = std::min(a.cost, b.cost);
  const double dispersion = std::max(1.0, least / of_noise);
  const double misfit = std::max(least - of_noise, 0.0);
  return dispersion <= kDispersionMax &&
         std::abs(a.cost - b.cost) >= std::max(kClearly * dispersion, kOfMisfit * misfit);
}

// Removes the axis' other waves of either cause beside the term at `at`: they are misfits of its
// shape. Returns the term's index afterwards.
std::size_t LeaveAlone(std::size_t at, Fit* fit, Selection* selection) {
  const std::size_t axis = AxisIndex(fit->model.terms[at].form);
  for (std::size_t t = fit->model.terms.size(); t-- > 0;) {
    if (t == at || !IsOfRotor(fit->model.terms[t], axis)) continue;
    fit->model.terms.erase(fit->model.terms.begin() + static_cast<std::ptrdiff_t>(t));
    selection->accepted.erase(selection->accepted.begin() + static_cast<std::ptrdiff_t>(t));
    if (t < at) --at;
  }
  return at;
}

// Exchanges the term for the bent wave of another cause in the same units, with rivals of its own.
// False where these data have no such wave.
bool Exchange(const Templates& templates, const SelectionRule& rule, const RotorWay& way,
              std::size_t at, Fit* fit, Selection* selection) {
  const EffectAxis axis = fit->model.terms[at].form.axis;
  const Templates forms = ListTemplates(*FindEffect(way.cause), *fit->facts);
  const Template* bent = nullptr;
  for (const Template& form : forms)
    if (form.axis == axis && form.shape == way.harmonic &&
        (bent == nullptr || form.columns > bent->columns))
      bent = &form;
  if (bent == nullptr) return false;
  at = LeaveAlone(at, fit, selection);
  ModelTerm& term = fit->model.terms[at];
  const std::size_t groups = term.groups();
  term.form = *bent;
  term.amplitude.assign(groups * bent->columns, 0);
  term.sigma.assign(groups * bent->columns, 0);
  FitAnew(fit);
  selection->accepted[at].rivals = FindRivals(templates, rule, *fit, at);
  return true;
}

}  // namespace

double MedianGear(const CampaignModel& model, std::size_t axis) {
  std::vector<double> gears;
  for (const CampaignUnit& unit : model.units) gears.push_back(unit.gear[axis]);
  return Median(std::move(gears));
}

void SettleRotors(const Templates& templates, const SelectionRule& rule,
                  const std::vector<std::string>& left_out, Fit* fit, Selection* selection) {
  constexpr double kFar_deg = 8;  // electrical: a smaller turn is a sine by either cause
  if (!fit->facts->Has("drive_amplitude")) return;
  const std::span<const std::string_view> causes = RotorWayCauses();
  for (const std::string_view name : causes)
    if (std::ranges::find(left_out, name) != left_out.end()) return;
  for (const std::size_t axis : {std::size_t{kTheta}, std::size_t{kPhi}}) {
    std::vector<double> square_um2;
    const std::size_t at = StrongestOfAxis(*fit, axis, &square_um2);
    if (at == kNoTerm || !IsFar(*fit, at, kFar_deg)) continue;
    const std::vector<Rotor> rotors = TakeRotors(*fit, axis, square_um2);
    std::vector<BestWay> best;
    for (const std::string_view cause : causes)
      best.push_back(BestWayOf(cause, rotors, fit->parallel));
    std::ranges::stable_sort(best, {}, &BestWay::cost);
    if (!IsClear(best[0], best[1], rotors)) continue;
    const RotorWay& way = *best[0].way;
    if (fit->model.terms[at].form.effect->cause != way.cause &&
        !Exchange(templates, rule, way, at, fit, selection))
      continue;
    for (std::size_t t = 0; t < fit->model.terms.size(); ++t)
      if (IsOfRotor(fit->model.terms[t], axis) &&
          fit->model.terms[t].form.effect->cause == way.cause)
        std::erase_if(selection->accepted[t].rivals,
                      [](const Rival& rival) { return HasRotorWays(rival.cause); });
  }
}

}  // namespace focalfleet::sim
