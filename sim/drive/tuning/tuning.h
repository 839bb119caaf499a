// Tuning finds the n that a motor needs, always from rest: steady rotation does not show whether a
// load starts. The critical n starts the worst place of the load; the tuned n would start (1 +
// margin) times that load. Both are searched with the reduced drive and then tried at PWM level. A
// tuning is refused where its currents come near the most that the bridge can force through a
// phase. In that range the winding is a resistance across the bus (paper 1's saturation), turning
// or blocked, cold or warm.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "sim/drive/drive.h"
#include "sim/drive/start_study.h"

namespace focalfleet::sim {

struct TuningRule {
  double margin = 0.5;       // of load torque
  double peak_share = 0.95;  // highest current over 2 V / (3 r)
  double move_deg = 300;     // of the output: time and energy are given for it
  Ramp ramp;
  /// The rise of the winding above ambient, K for a watt of copper losses. None: it stays at 20
  /// degrees Celsius.
  std::optional<double> winding_K_per_W;
  double ambient_C = 20;
  bool cross_check = true;    // at PWM level: some seconds
  bool measure_move = false;  // of a fleet's loads, too: a tenth of a second for each n that occurs
};

enum class TuningOutcome : std::uint8_t {
  kTuned,
  kStalls,    // no n starts the load
  kNoMargin,  // some n starts it, none with the margin
  kPeak       // the current is too high
};
const char* Name(TuningOutcome outcome);

struct Tuning {
  TuningOutcome outcome = TuningOutcome::kTuned;
  int critical = 0;
  int critical_reduced = 0;  // by the reduced drive alone
  int repeat = 0;
  double margin = 0;  // of `repeat`, half a count on the safe side; never below the rule's
  double peak_A = 0;  // in steady rotation with the mean load
  double blocked_peak_A = 0;
  double limit_A = 0;      // V / (sqrt3 r), as in paper 1
  double reachable_A = 0;  // 2 V / (3 r)
  double peak_share = 0;   // the higher of both peaks over reachable, cold or warm
  double copper_W = 0;     // in steady rotation
  double winding_C = 20;
  double resistance_ohm = 0;  // at that temperature
  double move_s = 0;  // time of the move and what the supply gives for it, by the reduced drive
  double move_J = 0;
};

/// `modulation.repeat` is ignored. Deterministic.
Tuning Tune(const Drive::Setting& setting, const Modulation& modulation, const TuningRule& rule);

/// The part of a tuning that differs between the loads of a fleet.
struct LoadTuning {
  double load_Nm = 0;
  TuningOutcome outcome = TuningOutcome::kTuned;
  int critical = 0;
  int repeat = 0;
  double margin = 0;
  double peak_share = 0;
  double move_s = 0;  // where the rule measures it; its energy between two loads is linear
  double move_J = 0;
};
/// The tuning, as by Tune, for each of `loads_Nm`, in that order. Loads are rounded up to 0.1 %.
/// Cost: hundredths of a second for each n that occurs. With the cross-check or a winding that
/// warms, each trial takes half a second and more. Where two loads need the same n, those between
/// need it, too, and are not tried. `progress` receives the share that is done.
std::vector<LoadTuning> TuneLoads(const Drive::Setting& setting, const Modulation& modulation,
                                  const TuningRule& rule, std::span<const double> loads_Nm,
                                  const std::function<void(double)>& progress);

/// The torque margin of n = `modulation.repeat`: the share by which the load may grow until n is
/// critical. Pre: the load is not 0.
double MarginOf(const Drive::Setting& setting, const Modulation& modulation);

}  // namespace focalfleet::sim
