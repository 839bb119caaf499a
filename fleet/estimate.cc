#include "fleet/estimate.h"

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>

#include "protocol/base/check.h"

namespace focalfleet {
namespace {

struct PowerEvent {
  RailId rail;
  double t_s = 0;
  std::int64_t change_nW = 0;
};

std::int64_t Nanowatts(double power_W) {
  return static_cast<std::int64_t>(std::llround(power_W * 1e9));
}

// The running sum as steps; events ascend in time.
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

double EnergyOf(const std::vector<PowerStep>& steps) {
  double energy_J = 0;
  for (std::size_t k = 0; k + 1 < steps.size(); ++k)
    energy_J += steps[k].power_W * (steps[k + 1].t_s - steps[k].t_s);
  return energy_J;
}

double PeakOf(const std::vector<PowerStep>& steps) {
  double peak_W = 0;
  for (const PowerStep& step : steps) peak_W = std::max(peak_W, step.power_W);
  return peak_W;
}

void Widen(Banded* band, double value) {
  band->low = std::min(band->low, value);
  band->high = std::max(band->high, value);
}

void Scale(Banded* band, double factor) {
  band->nominal *= factor;
  band->low *= factor;
  band->high *= factor;
}

PowerFigures FiguresOf(const std::vector<PowerStep>& steps) {
  const double energy_J = EnergyOf(steps);
  const double peak_W = PeakOf(steps);
  return {.energy_J = {energy_J, energy_J, energy_J},
          .mean_power_W = {},
          .peak_power_W = {peak_W, peak_W, peak_W}};
}

void Widen(PowerFigures* figures, const std::vector<PowerStep>& corner) {
  Widen(&figures->energy_J, EnergyOf(corner));
  Widen(&figures->peak_power_W, PeakOf(corner));
}

void Finish(PowerFigures* figures, double makespan_s, double model_error) {
  for (Banded* band : {&figures->energy_J, &figures->peak_power_W}) {
    band->low *= 1 - model_error;
    band->high *= 1 + model_error;
  }
  figures->mean_power_W = figures->energy_J;
  Scale(&figures->mean_power_W, makespan_s > 0 ? 1 / makespan_s : 0);
}

}  // namespace

PlanEstimate Estimate(const Plan& plan, const Layout& layout, std::span<const UnitDrive> drives,
                      const MotorModel& motor) {
  FOCALFLEET_CHECK(drives.size() == layout.size());
  DrivePowers powers(motor);
  PlanEstimate estimate;
  std::vector<PowerEvent> events;
  for (const UnitPlan& move : plan.moves) {
    const RailId rail = layout.unit(move.unit).rail;
    const UnitDrive& drive = drives[move.unit.value];
    for (std::size_t k = 0; k < kAxisCount; ++k)
      for (const Segment& segment : move.path[k].segments()) {
        const SegmentTime time = TimeOf(segment, drive.axis[k]);
        const MotorPower& power =
            powers.Of({AsSent(segment, drive.axis[k]), move.mode, drive.v_bus_V});
        const double power_W = power.total_W();
        estimate.stalled_segments += power.stalled ? 1 : 0;
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

EstimateFigures EstimateWithSpread(const Plan& plan, const Layout& layout,
                                   std::span<const UnitDrive> drives, const MotorModel& motor,
                                   const EstimateSpread& spread) {
  EstimateFigures figures;
  figures.nominal = Estimate(plan, layout, drives, motor);
  const PlanEstimate& nominal = figures.nominal;
  figures.stalls = figures.stalls_within_spread = nominal.stalled_segments > 0;
  figures.total = FiguresOf(nominal.total);
  for (const RailCurve& rail : nominal.rails) {
    figures.rails.push_back({rail.rail, FiguresOf(rail.steps)});
  }
  for (const double load : {1 - spread.load, 1 + spread.load})
    for (const double resistance : {1 - spread.resistance, 1 + spread.resistance}) {
      MotorModel corner = motor;
      corner.load_torque_Nm *= load;
      corner.phase_resistance_ohm *= resistance;
      const PlanEstimate estimate = Estimate(plan, layout, drives, corner);
      figures.stalls_within_spread |= estimate.stalled_segments > 0;
      Widen(&figures.total, estimate.total);
      for (std::size_t k = 0; k < figures.rails.size(); ++k) {
        Widen(&figures.rails[k].power, estimate.rails[k].steps);
      }
    }
  const double makespan_s = nominal.makespan_s;
  const double slack_s = makespan_s > 0 ? spread.start_skew_s + spread.clock_error * makespan_s : 0;
  figures.makespan_s = {makespan_s, std::max(0.0, makespan_s - slack_s), makespan_s + slack_s};
  Finish(&figures.total, makespan_s, spread.model_error);
  for (RailFigures& rail : figures.rails) Finish(&rail.power, makespan_s, spread.model_error);
  return figures;
}

}  // namespace focalfleet
