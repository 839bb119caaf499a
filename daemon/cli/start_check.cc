#include "daemon/cli/start_check.h"

#include <fmt/format.h>

#include <algorithm>

namespace focalfleet::cli {
namespace {

constexpr std::size_t kNamedMax = 5;
// Loads are known to a thousandth. A motor that was tuned without any margin must not fail by this
// rounding.
constexpr double kLoadRounding = 1e-3;

sim::Drive::Setting SettingOf(const MotorModel& motor, double v_bus_V) {
  sim::Drive::Setting setting;
  setting.motor.resistance_ohm = motor.phase_resistance_ohm;
  setting.motor.inductance_H = motor.phase_inductance_H;
  setting.motor.flux_linkage_Wb = motor.flux_linkage_Wb;
  setting.motor.viscous_Nms = motor.viscous_Nms;
  setting.motor.load_Nm = motor.load_torque_Nm;
  setting.bridge = {.v_bus_V = v_bus_V,
                    .rise_s = motor.switch_rise_s,
                    .fall_s = motor.switch_fall_s,
                    .dead_time_s = motor.dead_time_s};
  return setting;
}

}  // namespace

int StartCheck::CriticalOf(const Key& feed, double load_Nm) {
  const auto known = known_.find({feed, load_Nm});
  if (known != known_.end()) return known->second;
  const auto& [counter1, subdivision, mode, v_bus_V] = feed;
  auto loads = loads_.find(feed);
  if (loads == loads_.end()) {
    const sim::Modulation modulation{
        .counter1 = counter1, .subdivision = subdivision, .mode = mode};
    loads = loads_.emplace(feed, sim::CriticalLoads(SettingOf(motor_, v_bus_V), modulation)).first;
  }
  const auto critical = loads->second.RepeatFor(load_Nm * (1 - kLoadRounding));
  return known_[{feed, load_Nm}] = critical.value_or(0);
}

StartVerdict StartCheck::Of(const Plan& plan, const OfflineFleet& fleet) {
  StartVerdict verdict;
  for (const UnitPlan& move : plan.moves) {
    const UnitDrive& drive = fleet.drives[move.unit.value];
    for (const Axis axis : kAxes) {
      const auto& segments = move.path[Index(axis)].segments();
      if (segments.empty()) continue;
      ++verdict.axes;
      int repeat = segments.front().repeat;
      for (const Segment& segment : segments) repeat = std::min<int>(repeat, segment.repeat);
      const AxisDrive& tuned = drive.axis[Index(axis)];
      const auto& tuning = fleet.TuningOf(move.unit, axis);
      int critical = 0;
      if (tuning && tuning->counter1 == tuned.counter1 &&
          tuning->subdivision == tuned.subdivision && tuning->mode == move.mode &&
          tuning->v_bus_V == drive.v_bus_V) {
        critical = tuning->critical;
      } else {
        const double load_Nm = tuning ? tuning->load_uNm * 1e-6 : motor_.load_torque_Nm;
        critical =
            CriticalOf({tuned.counter1, tuned.subdivision, move.mode, drive.v_bus_V}, load_Nm);
      }
      if (critical > 0 && repeat >= critical) continue;
      verdict.below.push_back({fleet.layout.unit(move.unit).id, axis, repeat, critical});
    }
  }
  return verdict;
}

Json BelowCriticalJson(const StartVerdict& verdict) {
  Json rows = Json::array();
  for (const BelowCritical& one : verdict.below)
    rows.push_back({{"unit_id", one.unit.value},
                    {"axis", Name(one.axis)},
                    {"repeat", one.repeat},
                    {"critical", one.critical > 0 ? Json(one.critical) : Json(nullptr)}});
  return rows;
}

std::string DescribeBelowCritical(const StartVerdict& verdict) {
  if (verdict.below.empty()) return "";
  std::string text = fmt::format(
      "\n  {} of {} axes that move would stall: from rest, n is below the critical n of their load",
      verdict.below.size(), verdict.axes);
  for (std::size_t k = 0; k < std::min(kNamedMax, verdict.below.size()); ++k) {
    const BelowCritical& one = verdict.below[k];
    text += fmt::format("\n    unit {} {}: n {}, critical {}", one.unit.value, Name(one.axis),
                        one.repeat, one.critical > 0 ? std::to_string(one.critical) : "none");
  }
  if (verdict.below.size() > kNamedMax)
    text += fmt::format("\n    and {} more", verdict.below.size() - kNamedMax);
  return text;
}

}  // namespace focalfleet::cli
