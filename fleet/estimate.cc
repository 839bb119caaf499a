#include "fleet/estimate.h"

#include <algorithm>
#include <cstdint>
#include <numbers>
#include <tuple>
#include <utility>

#include "protocol/base/check.h"

namespace focalfleet {
namespace {

int EdgesPerCarrier(WaveMode mode) { return mode == WaveMode::kSevenSegment ? 6 : 4; }

struct Current {
  double d_A = 0;
  double q_A = 0;
};

// The current that a voltage of fixed length drives while the rotor turns at `speed` against a
// torque.
Current SteadyCurrent(const MotorModel& motor, double voltage_V, double speed_rad_per_s,
                      double torque_Nm) {
  const double r = motor.phase_resistance_ohm;
  const double x = speed_rad_per_s * motor.phase_inductance_H;
  const double back_V = speed_rad_per_s * motor.flux_linkage_Wb;
  const double impedance2 = r * r + x * x;
  const double impedance = std::sqrt(impedance2);
  // The voltage equation squared is Z^2 (Id + x E / Z^2)^2 + Z^2 (Iq + r E / Z^2)^2 = V^2: a
  // circle.
  const Current centre{-x * back_V / impedance2, -r * back_V / impedance2};
  const double radius_A = voltage_V / impedance;
  const double wanted_A = torque_Nm / (1.5 * motor.flux_linkage_Wb);
  const double q_A = std::min(wanted_A, centre.q_A + radius_A);
  const double off_A = q_A - centre.q_A;
  return {centre.d_A + std::sqrt(std::max(0.0, radius_A * radius_A - off_A * off_A)), q_A};
}

struct PowerEvent {
  RailId rail;
  double t_s = 0;
  std::int64_t change_nW = 0;
};

std::int64_t Nanowatts(double power_W) {
  return static_cast<std::int64_t>(std::llround(power_W * 1e9));
}

// Steps of the running sum; events ascend in time.
std::vector<PowerStep> StepsOf(std::span<const PowerEvent> events) {
  std::vector<PowerStep> steps;
  std::int64_t sum_nW = 0;
  for (std::size_t k = 0; k < events.size(); ++k) {
    sum_nW += events[k].change_nW;
    const bool more_now = k + 1 < events.size() && events[k + 1].t_s == events[k].t_s;
    const double power_W = static_cast<double>(sum_nW) * 1e-9;
    if (more_now || (!steps.empty() && steps.back().power_W == power_W)) continue;
    steps.push_back({events[k].t_s, power_W});
  }
  return steps;
}

double PeakOf(const std::vector<PowerStep>& steps) {
  double peak_W = 0;
  for (const PowerStep& step : steps) peak_W = std::max(peak_W, step.power_W);
  return peak_W;
}

}  // namespace

MotorPower SteadyPower(const MotorModel& motor, const AxisDrive& drive, WaveMode mode,
                       double v_bus_V) {
  const double speed = 2 * std::numbers::pi / (drive.subdivision * SecondsPerVector(drive));
  const double load_Nm = motor.load_torque_Nm + motor.viscous_Nms * speed;
  const Current current = SteadyCurrent(motor, v_bus_V / std::numbers::sqrt3, speed, load_Nm);
  const double square_A2 = current.d_A * current.d_A + current.q_A * current.q_A;
  const double carrier_Hz = kTimerHz / drive.counter1;
  MotorPower power;
  power.winding_W = 1.5 * motor.phase_resistance_ohm * square_A2;
  power.mechanical_W = std::max(0.0, 1.5 * motor.flux_linkage_Wb * current.q_A * speed);
  power.switching_W = EdgesPerCarrier(mode) * 0.5 * v_bus_V * std::sqrt(square_A2) *
                      (motor.switch_rise_s + motor.switch_fall_s) * carrier_Hz;
  return power;
}

PlanEstimate Estimate(const Plan& plan, const Layout& layout, std::span<const UnitDrive> drives,
                      const MotorModel& motor) {
  FOCALFLEET_CHECK(drives.size() == layout.size());
  PlanEstimate estimate;
  std::vector<PowerEvent> events;
  for (const UnitPlan& move : plan.moves) {
    const RailId rail = layout.unit(move.unit).rail;
    const UnitDrive& drive = drives[move.unit.value];
    for (std::size_t k = 0; k < kAxisCount; ++k)
      for (const Segment& segment : move.path[k].segments()) {
        const SegmentTime time = TimeOf(segment, drive.axis[k]);
        const double power_W =
            SteadyPower(motor, AsSent(segment, drive.axis[k]), move.mode, drive.v_bus_V).total_W();
        events.push_back({rail, time.t0_s, Nanowatts(power_W)});
        events.push_back({rail, time.t1_s, -Nanowatts(power_W)});
        estimate.energy_J += power_W * (time.t1_s - time.t0_s);
        estimate.makespan_s = std::max(estimate.makespan_s, time.t1_s);
      }
  }
  std::sort(events.begin(), events.end(), [](const PowerEvent& a, const PowerEvent& b) {
    return std::tie(a.rail, a.t_s) < std::tie(b.rail, b.t_s);
  });
  for (std::size_t begin = 0, end = 0; begin < events.size(); begin = end) {
    while (end < events.size() && events[end].rail == events[begin].rail) ++end;
    estimate.rails.push_back(
        {events[begin].rail, StepsOf(std::span(events).subspan(begin, end - begin))});
  }
  std::sort(events.begin(), events.end(),
            [](const PowerEvent& a, const PowerEvent& b) { return a.t_s < b.t_s; });
  estimate.total = StepsOf(events);
  estimate.peak_power_W = PeakOf(estimate.total);
  return estimate;
}

}  // namespace focalfleet
