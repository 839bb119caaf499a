#include "sim/drive/tuning/tuning.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "sim/drive/reduced_drive.h"
#include "sim/drive/steady.h"

namespace focalfleet::sim {
namespace {

constexpr int kTableRepeatMax = 255;       // the most that a unit's table holds
constexpr double kCopper_per_K = 0.00393;  // rise of resistance, from 20 degrees Celsius
constexpr int kSettlingCarriers = 30;      // e^-20 at 250 counts

struct Critical {
  int reduced = 0;
  int repeat = 0;
};

std::optional<Critical> FindCritical(Drive::Setting setting, const Modulation& modulation,
                                     const TuningRule& rule, double load_factor) {
  setting.motor.load_Nm *= load_factor;
  const StartTrial trial{.ramp = rule.ramp};
  const auto reduced =
      CriticalRepeat(setting, modulation, trial, DriveLevel::kReduced, kTableRepeatMax);
  if (!reduced) return std::nullopt;
  Critical critical{*reduced, *reduced};
  if (!rule.cross_check) return critical;
  const auto starts = [&](int repeat) {
    Modulation at = modulation;
    at.repeat = repeat;
    return StartsAtWorstLoad(setting, at, trial, DriveLevel::kPwm);
  };
  while (!starts(critical.repeat))
    if (++critical.repeat > kTableRepeatMax) return std::nullopt;
  if (critical.repeat == *reduced)
    while (critical.repeat > 1 && starts(critical.repeat - 1)) --critical.repeat;
  return critical;
}

// The highest current while the field turns once over a blocked rotor.
double BlockedPeak(Drive::Setting setting, Modulation modulation) {
  setting.motor.load_Nm = 1;
  setting.motor.load_variation = 0;
  modulation.repeat = std::min(modulation.repeat, kSettlingCarriers);
  const std::vector<Pattern> table = VectorTable(modulation);
  Drive drive(setting);
  drive.Place(0, 0);
  RunVectors(&drive, modulation, table, -6, 6);
  drive.ResetPeak();
  RunVectors(&drive, modulation, table, 0, modulation.subdivision);
  return drive.peak_A();
}

double Reachable(const Drive::Setting& setting) {
  return 2 * setting.bridge.v_bus_V / (3 * setting.motor.resistance_ohm);
}

// The currents of the setting as it is, at the tuned n.
void MeasureCurrents(const Drive::Setting& setting, const Modulation& modulation, Tuning* tuning) {
  if (const auto state = FindSteadyState(setting, modulation, setting.motor.load_Nm)) {
    const WaveFigures figures = MeasureSteadyWave(setting, modulation, *state);
    tuning->peak_A = figures.peak_A;
    tuning->copper_W = figures.power.copper_W;
  }
  tuning->blocked_peak_A = BlockedPeak(setting, modulation);
  tuning->reachable_A = Reachable(setting);
  tuning->limit_A = tuning->reachable_A * std::numbers::sqrt3 / 2;
  tuning->peak_share = std::max(
      tuning->peak_share, std::max(tuning->peak_A, tuning->blocked_peak_A) / tuning->reachable_A);
}

void FindRepeat(const Drive::Setting& setting, const Modulation& modulation, const TuningRule& rule,
                Tuning* tuning) {
  const auto critical = FindCritical(setting, modulation, rule, 1);
  if (!critical) {
    tuning->outcome = TuningOutcome::kStalls;
    return;
  }
  tuning->critical = critical->repeat;
  tuning->critical_reduced = critical->reduced;
  const auto tuned = FindCritical(setting, modulation, rule, 1 + rule.margin);
  if (!tuned) {
    tuning->outcome = TuningOutcome::kNoMargin;
    return;
  }
  tuning->repeat = std::max(tuned->repeat, critical->repeat);
}

// The temperature at which the copper's losses sustain it. Warmer copper takes less from the same
// voltage, so the steps shrink.
double WindingTemperature(const Drive::Setting& cold, const Modulation& modulation,
                          const TuningRule& rule, Drive::Setting* warm) {
  double celsius = rule.ambient_C;
  for (int k = 0; k < 30; ++k) {
    warm->motor.resistance_ohm = cold.motor.resistance_ohm * (1 + kCopper_per_K * (celsius - 20));
    const auto state = FindSteadyState(*warm, modulation, warm->motor.load_Nm);
    const double copper_W = state ? MeasureSteadyWave(*warm, modulation, *state).power.copper_W : 0;
    const double next = rule.ambient_C + *rule.winding_K_per_W * copper_W;
    const double step = next - celsius;
    celsius += step / 2;  // half a step: a winding far beyond what copper bears would swing
    if (std::abs(step) < 0.01) break;
  }
  return celsius;
}

void MeasureMove(const Drive::Setting& setting, const Modulation& modulation,
                 const TuningRule& rule, Tuning* tuning) {
  const auto vectors =
      std::llround(rule.move_deg / 360 * setting.gearhead.ratio * modulation.subdivision);
  ReducedDrive drive(setting, modulation);
  drive.Place(0, 0);
  const double share = drive.shaft().LoadTorque() / drive.stall_Nm();
  drive.Place(-std::asin(std::min(1.0, share)), 0);
  std::int64_t field = 1;
  for (const Stage& stage : MakeProfile(vectors, modulation, rule.ramp)) {
    drive.RunVectors(field, stage.vectors, stage.repeat);
    field += stage.vectors;
  }
  tuning->move_s = drive.t_s();
  tuning->move_J = drive.supply_J();
}

// The search has shown that n starts the load with the rule's margin, whatever the figure half a
// count lower says.
double MarginAtLeast(const TuningRule& rule, double margin) {
  return std::max(rule.margin, margin);
}

// All parts of a tuning but margin and move, which need no trial of their own in a fleet.
struct Tried {
  Tuning tuning;
  Drive::Setting setting;  // as warm as the winding gets
};
Tried Try(const Drive::Setting& setting, const Modulation& modulation, const TuningRule& rule) {
  Tuning tuning;
  tuning.resistance_ohm = setting.motor.resistance_ohm;
  Drive::Setting now = setting;
  Modulation at = modulation;
  FindRepeat(now, at, rule, &tuning);
  if (tuning.outcome != TuningOutcome::kTuned) return {tuning, now};
  at.repeat = tuning.repeat;
  MeasureCurrents(now, at, &tuning);
  // A warm winding starts a smaller load, so a larger n may be needed; that changes its losses
  // little.
  for (int k = 0; rule.winding_K_per_W && k < 5; ++k) {
    tuning.winding_C = WindingTemperature(setting, at, rule, &now);
    tuning.resistance_ohm = now.motor.resistance_ohm;
    FindRepeat(now, at, rule, &tuning);
    if (tuning.outcome != TuningOutcome::kTuned) return {tuning, now};
    const bool settled = at.repeat == tuning.repeat;
    at.repeat = tuning.repeat;
    MeasureCurrents(now, at, &tuning);
    if (settled) break;
  }
  if (tuning.peak_share > rule.peak_share) tuning.outcome = TuningOutcome::kPeak;
  return {tuning, now};
}

// Where two ascending loads need the same n, all loads between them need it.
class LoadTable {
 public:
  LoadTable(const Drive::Setting& setting, const Modulation& modulation, const TuningRule& rule,
            std::vector<double> loads_Nm, const std::function<void(double)>& progress)
      : setting_(setting),
        modulation_(modulation),
        rule_(rule),
        loads_Nm_(std::move(loads_Nm)),
        known_(loads_Nm_.size()),
        progress_(progress) {}

  std::vector<LoadTuning> Fill() {
    if (loads_Nm_.empty()) return {};
    TryAt(0);
    TryAt(loads_Nm_.size() - 1);
    Between(0, loads_Nm_.size() - 1);
    return std::move(known_);
  }

 private:
  void TryAt(std::size_t k) {
    if (known_[k].load_Nm > 0) return;
    Drive::Setting at = setting_;
    at.motor.load_Nm = loads_Nm_[k];
    const Tried tried = Try(at, modulation_, rule_);
    LoadTuning& known = known_[k];
    known = {.load_Nm = loads_Nm_[k],
             .outcome = tried.tuning.outcome,
             .critical = tried.tuning.critical,
             .repeat = tried.tuning.repeat,
             .peak_share = tried.tuning.peak_share};
    if (known.repeat > 0) {
      Modulation shown = modulation_;
      shown.repeat = known.repeat;
      known.margin = MarginAtLeast(rule_, MarginOf(tried.setting, shown));
      if (rule_.measure_move) {
        Tuning moved;
        MeasureMove(tried.setting, shown, rule_, &moved);
        known.move_s = moved.move_s;
        known.move_J = moved.move_J;
      }
    }
    Done(1);
  }

  void Between(std::size_t low, std::size_t high) {
    if (high - low < 2) return;
    const LoadTuning a = known_[low];
    const LoadTuning b = known_[high];
    if (a.outcome == b.outcome && a.critical == b.critical && a.repeat == b.repeat) {
      for (std::size_t k = low + 1; k < high; ++k) {
        known_[k] = a;
        known_[k].load_Nm = loads_Nm_[k];
        // The load that n just starts is the same for all of them.
        known_[k].margin = MarginAtLeast(rule_, (1 + a.margin) * a.load_Nm / loads_Nm_[k] - 1);
        known_[k].peak_share = std::max(a.peak_share, b.peak_share);
        const double share = (loads_Nm_[k] - a.load_Nm) / (b.load_Nm - a.load_Nm);
        known_[k].move_J = a.move_J + share * (b.move_J - a.move_J);
      }
      Done(high - low - 1);
      return;
    }
    const std::size_t middle = (low + high) / 2;
    TryAt(middle);
    Between(low, middle);
    Between(middle, high);
  }

  void Done(std::size_t count) {
    done_ += count;
    if (progress_) progress_(static_cast<double>(done_) / static_cast<double>(loads_Nm_.size()));
  }

  Drive::Setting setting_;
  Modulation modulation_;
  TuningRule rule_;
  std::vector<double> loads_Nm_;  // ascending, all different
  std::vector<LoadTuning> known_;
  const std::function<void(double)>& progress_;
  std::size_t done_ = 0;
};

// Without ramp, temperature and PWM level, an n and the load that it starts determine the tuning;
// no trial for each load is needed. A motor that pulls its load has lower peaks than a blocked one.
// Its back-EMF never exceeds what the lag gives (V sin(lag) >= flux w).
std::vector<LoadTuning> TuneByCriticalLoads(const Drive::Setting& setting,
                                            const Modulation& modulation, const TuningRule& rule,
                                            const std::vector<double>& loads_Nm,
                                            const std::function<void(double)>& progress) {
  CriticalLoads critical_loads(setting, modulation);
  std::map<int, double> blocked_share;
  const auto at = [&](int repeat) {
    Modulation shown = modulation;
    shown.repeat = repeat;
    return shown;
  };
  const auto vectors =
      std::llround(rule.move_deg / 360 * setting.gearhead.ratio * modulation.subdivision);
  std::vector<LoadTuning> tunings;
  tunings.reserve(loads_Nm.size());
  for (const double load_Nm : loads_Nm) {
    LoadTuning tuning{.load_Nm = load_Nm};
    const auto critical = critical_loads.RepeatFor(load_Nm);
    const auto repeat = critical_loads.RepeatFor(load_Nm * (1 + rule.margin));
    tuning.outcome = !critical ? TuningOutcome::kStalls
                     : !repeat ? TuningOutcome::kNoMargin
                               : TuningOutcome::kTuned;
    if (critical) tuning.critical = *critical;
    if (critical && repeat) {
      tuning.repeat = *repeat;
      // The load is taken half a count on the safe side.
      const double holds_Nm =
          *repeat > 1 ? (critical_loads.Of(*repeat) + critical_loads.Of(*repeat - 1)) / 2
                      : critical_loads.Of(*repeat);
      tuning.margin = MarginAtLeast(rule, holds_Nm / load_Nm - 1);
      const int settled = std::min(*repeat, kSettlingCarriers);
      if (!blocked_share.contains(settled))
        blocked_share[settled] = BlockedPeak(setting, at(settled)) / Reachable(setting);
      tuning.peak_share = blocked_share[settled];
      if (tuning.peak_share > rule.peak_share) tuning.outcome = TuningOutcome::kPeak;
    }
    tunings.push_back(tuning);
    if (progress)
      progress(static_cast<double>(tunings.size()) / static_cast<double>(loads_Nm.size()));
  }
  if (!rule.measure_move) return tunings;
  // Loads ascend, so those of one n are neighbours; between the ends the power is linear.
  for (std::size_t first = 0, last = 0; first < tunings.size(); first = last + 1) {
    const int repeat = tunings[first].repeat;
    last = first;
    while (last + 1 < tunings.size() && tunings[last + 1].repeat == repeat) ++last;
    if (repeat == 0) continue;
    const double move_s = static_cast<double>(vectors) * at(repeat).vector_s();
    const double low_W = critical_loads.Supply_W(repeat, tunings[first].load_Nm);
    const double high_W =
        last == first ? low_W : critical_loads.Supply_W(repeat, tunings[last].load_Nm);
    for (std::size_t k = first; k <= last; ++k) {
      const double share = last == first ? 0
                                         : (tunings[k].load_Nm - tunings[first].load_Nm) /
                                               (tunings[last].load_Nm - tunings[first].load_Nm);
      tunings[k].move_s = move_s;
      tunings[k].move_J = move_s * (low_W + share * (high_W - low_W));
    }
  }
  return tunings;
}

double RoundedUp(double load_Nm) {
  const double step = std::pow(10, std::floor(std::log10(load_Nm)) - 3);
  return std::ceil(load_Nm / step * (1 - 1e-12)) * step;
}

}  // namespace

const char* Name(TuningOutcome outcome) {
  constexpr const char* kNames[] = {"tuned", "stalls", "no_margin", "peak"};
  return kNames[static_cast<std::size_t>(outcome)];
}

Tuning Tune(const Drive::Setting& setting, const Modulation& modulation, const TuningRule& rule) {
  Tried tried = Try(setting, modulation, rule);
  Tuning& tuning = tried.tuning;
  if (tuning.repeat == 0) return tuning;
  Modulation at = modulation;
  at.repeat = tuning.repeat;
  // With a ramp the margin is only known to be at least the one asked for.
  if (rule.ramp.stages > 0) {
    tuning.margin = rule.margin;
  } else if (setting.motor.load_Nm > 0) {
    tuning.margin = MarginAtLeast(rule, MarginOf(tried.setting, at));
  }
  MeasureMove(tried.setting, at, rule, &tuning);
  return tuning;
}

std::vector<LoadTuning> TuneLoads(const Drive::Setting& setting, const Modulation& modulation,
                                  const TuningRule& rule, std::span<const double> loads_Nm,
                                  const std::function<void(double)>& progress) {
  std::vector<double> sorted;
  sorted.reserve(loads_Nm.size());
  for (const double load : loads_Nm) sorted.push_back(RoundedUp(load));
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  const bool each_alone = rule.cross_check || rule.ramp.stages > 0 || rule.winding_K_per_W;
  const std::vector<LoadTuning> table =
      each_alone ? LoadTable(setting, modulation, rule, sorted, progress).Fill()
                 : TuneByCriticalLoads(setting, modulation, rule, sorted, progress);
  std::vector<LoadTuning> tunings;
  tunings.reserve(loads_Nm.size());
  for (const double load : loads_Nm) {
    const auto at = std::lower_bound(sorted.begin(), sorted.end(), RoundedUp(load));
    tunings.push_back(table[static_cast<std::size_t>(at - sorted.begin())]);
  }
  return tunings;
}

double MarginOf(const Drive::Setting& setting, const Modulation& modulation) {
  return LoadOfCriticalRepeat(setting, modulation, modulation.repeat) / setting.motor.load_Nm - 1;
}

}  // namespace focalfleet::sim
