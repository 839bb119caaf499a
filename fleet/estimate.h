// How long a plan takes and what it draws, by the formulas of paper 1: the time of a move is its vectors
// times V_counter2 / f_clk; the power of a motor is winding loss, mechanical power (eq. 7) and switching loss
// by wave mode. Summed over the motors that run, per supply rail and in total, it is a curve over the plan.
#pragma once

#include <span>
#include <vector>

#include "fleet/layout.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

/// The motor and bridge that an estimate assumes (paper 1; flux and load: fitted to its critical n = 37).
struct MotorModel {
  double phase_resistance_ohm = 14.85;
  double phase_inductance_H = 37e-6;
  double flux_linkage_Wb = 0.15e-3;
  double load_torque_Nm = 4.07e-6;       // at the motor shaft
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
MotorPower SteadyPower(const MotorModel& motor, const AxisDrive& drive, WaveMode mode, double v_bus_V);

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

PlanEstimate Estimate(const Plan& plan, const Layout& layout, std::span<const UnitDrive> drives,
                      const MotorModel& motor);

}  // namespace focalfleet
