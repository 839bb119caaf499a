// The duration and the power of a plan. The time of a move is its vectors times V_counter2 / f_clk
// (paper 1). The power of a running motor is that of steady rotation (drive_power.h). Summed over
// the running motors, per supply rail and in total, it is a curve over the plan.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "fleet/drive.h"
#include "fleet/drive_power.h"
#include "fleet/layout.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

/// The drive of a segment: its own repeat, the rest as tuned.
constexpr AxisDrive AsSent(const Segment& segment, const AxisDrive& tuned) {
  return {tuned.counter1, segment.repeat, tuned.subdivision};
}

/// The time of a segment, by the unit's nominal clock. Units: s after the start signal.
struct SegmentTime {
  double t0_s = 0;
  double t1_s = 0;
};
inline SegmentTime TimeOf(const Segment& segment, const AxisDrive& tuned) {
  // The division gives the double nearest to the decimal time, which prints short; a product would
  // not.
  const double t0_s = segment.start_ticks / 1e4;
  return {t0_s, t0_s + std::abs(segment.delta) * SecondsPerVector(AsSent(segment, tuned))};
}

/// Power as steps: `power_W` holds from `t_s` to the next step's; the last is 0.
struct PowerStep {
  double t_s = 0;
  double power_W = 0;
};

struct RailCurve {
  RailId rail;
  std::vector<PowerStep> steps;
};

struct PlanEstimate {
  double makespan_s = 0;
  double energy_J = 0;
  double peak_power_W = 0;  // of all rails together
  std::vector<PowerStep> total;
  std::vector<RailCurve> rails;  // ascending by rail
  std::uint32_t stalled_segments = 0;
};

/// Time, power and energy of a plan. Shape: `drives` (n). Powers are summed as whole nanowatts, so
/// every curve ends at exactly 0 and does not depend on the order of its moves. Cost: O(s log s)
/// for s segments, and about 1 ms for each way in which a motor is fed.
PlanEstimate Estimate(const Plan& plan, const Layout& layout, std::span<const UnitDrive> drives,
                      const MotorModel& motor);

// ---- the uncertainty of the figures

/// A value and the limits within which the truth is expected.
struct Banded {
  double nominal = 0;
  double low = 0;
  double high = 0;
};

struct PowerFigures {
  Banded energy_J;
  Banded mean_power_W;  // over the plan's makespan
  Banded peak_power_W;
};
struct RailFigures {
  RailId rail;
  PowerFigures power;
};

/// The spread between motors, and the model's own error. The four corners of load and resistance
/// are computed, each for all motors at once. A corner stands for a cold or a worn fleet, not for a
/// mixture in which errors cancel.
struct EstimateSpread {
  double load = 0.2;            // share of load_torque_Nm, either way
  double resistance = 0.1;      // share; copper makes 10 % in 25 K
  double model_error = 0.02;    // share of power, on top of the corners
  double start_skew_s = 0.020;  // of a unit's start; as PlanOptions has it
  double clock_error = 0.005;   // share of time; as PlanOptions has it
};

struct EstimateFigures {
  Banded makespan_s;
  PowerFigures total;
  std::vector<RailFigures> rails;     // ascending by rail
  bool stalls = false;                // the nominal motor cannot pull its load in some segment
  bool stalls_within_spread = false;  // at least one corner cannot
  PlanEstimate nominal;               // with the curves
};
EstimateFigures EstimateWithSpread(const Plan& plan, const Layout& layout,
                                   std::span<const UnitDrive> drives, const MotorModel& motor,
                                   const EstimateSpread& spread = {});

}  // namespace focalfleet
