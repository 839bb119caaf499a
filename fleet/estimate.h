// How long a plan takes and what it draws, by the formulas of paper 1: the time of a move is its
// vectors times V_counter2 / f_clk; the power of a motor is winding loss, mechanical power (eq. 7)
// and switching loss by wave mode. Summed over the motors that run, per supply rail and in total,
// it is a curve over the plan.
#pragma once

#include <cmath>
#include <cstdlib>
#include <span>
#include <vector>

#include "fleet/drive.h"
#include "fleet/layout.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

/// A segment's drive: its own repeat, the rest as tuned.
constexpr AxisDrive AsSent(const Segment& segment, const AxisDrive& tuned) {
  return {tuned.counter1, segment.repeat, tuned.subdivision};
}

/// When a segment runs, by the unit's nominal clock. Units: s after the start signal.
struct SegmentTime {
  double t0_s = 0;
  double t1_s = 0;
};
inline SegmentTime TimeOf(const Segment& segment, const AxisDrive& tuned) {
  // Divided, not multiplied: gives the double nearest to the decimal time, which prints short.
  const double t0_s = segment.start_ticks / 1e4;
  return {t0_s, t0_s + std::abs(segment.delta) * SecondsPerVector(AsSent(segment, tuned))};
}

/// The motor and bridge that an estimate assumes (paper 1; flux and load: fitted to its
/// critical n of 37).
struct MotorModel {
  double phase_resistance_ohm = 14.85;
  double phase_inductance_H = 37e-6;
  double flux_linkage_Wb = 0.15e-3;
  double load_torque_Nm = 4.07e-6;  // at the motor shaft
  double viscous_Nms = 1e-8;
  double switch_rise_s = 10e-9;
  double switch_fall_s = 10e-9;
};

/// Electrical power of one motor in steady rotation, by cause. Units: W.
struct MotorPower {
  double winding_W = 0;
  double mechanical_W = 0;
  double switching_W = 0;
  [[nodiscard]] double total_W() const { return winding_W + mechanical_W + switching_W; }
};
/// Power of a motor that turns steadily in step with its field. The bus gives a voltage vector of
/// fixed length V = v_bus / sqrt(3), the largest fundamental of linear SVPWM, that turns at
/// w = 2 pi / (subdivision * time of a vector):
///
///   torque     T = load + viscous * w,  Iq = T / (1.5 flux)
///   voltage    V^2 = (r Id - w L Iq)^2 + (r Iq + w L Id + w flux)^2
///   winding    1.5 r (Id^2 + Iq^2)
///   mechanical T w
///   switching  edges * 0.5 v_bus |I| (rise + fall) * carrier
///
/// Of the two Id the larger one holds: the rotor lags the field. In the open loop the current thus
/// hardly depends on the load; what the load does not take heats the winding. Where no Id is real
/// the field cannot pull the load, and Iq is what it can pull at most. Switching is an upper bound:
/// every edge of the three legs in a carrier period (4 asymmetric, 4 five-segment, 6 seven-segment)
/// is charged with both times and with the amplitude.
/// Source: paper 1 eqs. 5 to 7 with Ld = Lq = L and one pole pair. Cost: O(1).
MotorPower SteadyPower(const MotorModel& motor, const AxisDrive& drive, WaveMode mode,
                       double v_bus_V);

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
};

/// Shape: `drives` (n). Powers are summed as whole nanowatts, so every curve ends at exactly 0 and
/// does not depend on the order of its moves. Cost: O(s log s) for s segments.
PlanEstimate Estimate(const Plan& plan, const Layout& layout, std::span<const UnitDrive> drives,
                      const MotorModel& motor);

}  // namespace focalfleet
