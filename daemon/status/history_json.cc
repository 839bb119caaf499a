#include "daemon/status/history_json.h"

#include <cmath>
#include <string>
#include <utility>

#include "daemon/clock/wall_time.h"
#include "daemon/status/status_json.h"

namespace focalfleet {
Json HistoryJson(const std::vector<ConfigurationHistory>& configurations) {
  Json rows = Json::array();
  for (const auto& [row, began, changed] : configurations)
    rows.push_back({{"id", row.id},
                    {"source", row.source},
                    {"state", Name(row.state)},
                    {"began", ToIso8601(began)},
                    {"changed", ToIso8601(changed)},
                    {"targeted", row.counts.targeted},
                    {"arrived", row.counts.arrived},
                    {"refused", row.counts.refused},
                    {"failed", row.counts.failed},
                    {"stopped", row.counts.stopped},
                    {"unmeasured", row.counts.unmeasured},
                    {"makespan_predicted_s", Number(row.makespan_predicted_s)},
                    {"makespan_s", Number(row.makespan_s)},
                    {"energy_J", Number(row.energy_J)},
                    {"peak_power_W", Number(row.peak_power_W)},
                    {"start_skew_s", Number(row.start_skew_s)},
                    {"start_skew_bound_s", Number(row.start_skew_bound_s)}});
  return rows;
}

Json HistoryJson(const std::vector<MeasurementHistory>& measurements) {
  Json rows = Json::array();
  for (const auto& [row, at, moved_since] : measurements) {
    Json json = {{"unit_id", row.unit.value},
                 {"configuration", row.configuration},
                 {"status", Name(row.status)},
                 {"source", Name(row.source)},
                 {"x_mm", row.x_mm},
                 {"y_mm", row.y_mm},
                 {"sigma_um", SigmaUm(row.covariance)},
                 {"var_x_mm2", row.covariance.xx},
                 {"cov_xy_mm2", row.covariance.xy},
                 {"var_y_mm2", row.covariance.yy},
                 {"target_id", row.target_id},
                 {"delay_s", row.delay_s ? Json(*row.delay_s) : Json()},
                 {"target_x_mm", row.target_fp ? Json(row.target_fp->x_mm) : Json()},
                 {"target_y_mm", row.target_fp ? Json(row.target_fp->y_mm) : Json()},
                 {"error_um", row.error_um ? Json(*row.error_um) : Json()},
                 {"moved_since", moved_since},
                 {"other_unit_id", row.other ? Json(row.other->value) : Json()},
                 {"orientation", row.carrier ? FibreCarrierJson(*row.carrier) : Json()},
                 {"at", ToIso8601(at)}};
    rows.push_back(std::move(json));
  }
  return rows;
}
Json HistoryJson(const std::vector<MoveHistory>& moves) {
  Json rows = Json::array();
  for (const MoveHistory& move : moves) {
    Json row = {{"began", ToIso8601(move.began)},
                {"ended", move.ended ? Json(ToIso8601(*move.ended)) : Json(nullptr)},
                {"end", move.end ? Json(Name(*move.end)) : Json("open")},
                {"configuration", move.configuration},
                {"unit_id", move.unit.value},
                {"serial", move.serial.value},
                {"move", move.move.value}};
    for (const Axis axis : kAxes) {
      const std::size_t a = Index(axis);
      const std::string name = Name(axis);
      row[name + "_from_vectors"] = move.from[a];
      row[name + "_to_vectors"] = move.to[a];
      if (!move.ended_at) continue;
      row[name + "_witness"] = Name((*move.ended_at)[a].witness);
      row[name + "_low_vectors"] = (*move.ended_at)[a].low;
      row[name + "_high_vectors"] = (*move.ended_at)[a].high;
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

Json HistoryJson(const std::vector<UnitMeasured>& measured) {
  Json rows = Json::array();
  for (const UnitMeasured& one : measured)
    rows.push_back({{"configuration", one.configuration},
                    {"exposure", one.exposure},
                    {"status", Name(one.status)},
                    {"error_um", one.error_um ? Json(*one.error_um) : Json()},
                    {"at", ToIso8601(one.at)}});
  return rows;
}

Json HistoryJson(const std::vector<ParameterHistory>& parameters) {
  Json rows = Json::array();
  for (const auto& [row, at] : parameters)
    rows.push_back({{"axis", Name(row.axis)},
                    {"parameter", Name(row.parameter)},
                    {"value", row.value},
                    {"origin", Name(row.origin)},
                    {"serial", row.serial.value},
                    {"at", ToIso8601(at)}});
  return rows;
}

Json HistoryJson(const std::vector<TuningHistory>& tunings) {
  Json rows = Json::array();
  for (const auto& [row, at] : tunings)
    rows.push_back({{"axis", Name(row.axis)},
                    {"critical", row.critical},
                    {"repeat", row.repeat},
                    {"margin", row.margin},
                    {"load_uNm", row.load_uNm},
                    {"v_bus_V", row.v_bus_V},
                    {"counter1", row.counter1},
                    {"subdivision", row.subdivision},
                    {"mode", Name(row.mode)},
                    {"origin", Name(row.origin)},
                    {"serial", row.serial.value},
                    {"at", ToIso8601(at)}});
  return rows;
}

Json HistoryJson(const std::vector<AlarmHistory>& alarms) {
  Json rows = Json::array();
  for (const auto& [row, at] : alarms)
    rows.push_back({{"at", ToIso8601(at)},
                    {"id", row.id},
                    {"severity", Name(row.severity)},
                    {"name", Name(row.name)},
                    {"unit_id", row.unit ? Json(row.unit->value) : Json(nullptr)},
                    {"bus_id", row.bus ? Json(row.bus->value) : Json(nullptr)},
                    {"text", row.text}});
  return rows;
}

Json HistoryJson(const std::vector<UnitHistory>& units) {
  Json rows = Json::array();
  for (const UnitHistory& unit : units)
    rows.push_back({{"at", ToIso8601(unit.at)},
                    {"unit_id", unit.unit.value},
                    {"serial", unit.serial.value},
                    {"enabled", unit.enabled},
                    {"reason", unit.reason}});
  return rows;
}

}  // namespace focalfleet
