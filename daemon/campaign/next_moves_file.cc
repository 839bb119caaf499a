#include "daemon/campaign/next_moves_file.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

/// A column with the value that asks for nothing. NaN: any value is asked for.
struct Condition {
  const char* column;
  double nothing;
  bool is_flag = false;
};
const Condition kConditions[] = {
    {"drive_amplitude", 1}, {"delay_s", 3}, {"elevation_deg", std::nan("")}, {"rehomed", 0, true}};

sim::MoveConditions ConditionsOf(CsvRow* row) {
  sim::MoveConditions conditions;
  if (const auto drive = row->NumberIfAny("drive_amplitude")) conditions.drive_amplitude = *drive;
  if (const auto delay_s = row->NumberIfAny("delay_s")) conditions.delay_s = *delay_s;
  if (const auto elevation = row->NumberIfAny("elevation_deg"))
    conditions.elevation_deg = *elevation;
  conditions.home_first = row->FlagIfAny("rehomed").value_or(conditions.home_first);
  return conditions;
}

bool AreSame(const sim::MoveConditions& a, const sim::MoveConditions& b) {
  const bool both_any = std::isnan(a.elevation_deg) && std::isnan(b.elevation_deg);
  return a.drive_amplitude == b.drive_amplitude && a.delay_s == b.delay_s &&
         (both_any || a.elevation_deg == b.elevation_deg) && a.home_first == b.home_first;
}

}  // namespace

std::string WriteNextMoves(const std::vector<sim::CampaignUnit>& units,
                           const std::vector<sim::ProposedMove>& moves) {
  CsvWriter csv({"move_id", "unit_id", "theta_deg", "phi_deg", "drive_amplitude", "delay_s",
                 "elevation_deg", "rehomed", "separates"});
  const std::vector<sim::PlateMove> spread = sim::SpreadOver(units, moves);
  for (std::size_t m = 0; m < moves.size(); ++m) {
    const sim::MoveConditions& conditions = spread[m].conditions;
    for (std::size_t u = 0; u < units.size(); ++u) {
      const auto& to_deg = spread[m].to_deg[u];
      if (!to_deg) continue;
      csv.Integer(static_cast<std::int64_t>(m + 1)).Integer(units[u].id);
      csv.Number((*to_deg)[sim::kTheta]).Number((*to_deg)[sim::kPhi]);
      csv.Number(conditions.drive_amplitude).Number(conditions.delay_s);
      csv.Number(conditions.elevation_deg).Integer(conditions.home_first ? 1 : 0);
      csv.Text(moves[m].separates).EndRow();
    }
  }
  return csv.Take();
}

Result<std::vector<sim::PlateMove>> ReadNextMoves(std::string_view text, std::string file,
                                                  const std::vector<sim::CampaignUnit>& units) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"move_id", "unit_id", "theta_deg", "phi_deg"}));
  std::map<std::int64_t, std::size_t> place;  // of a unit, by id
  for (std::size_t u = 0; u < units.size(); ++u) place[units[u].id] = u;
  std::map<std::int64_t, sim::PlateMove> moves;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const std::int64_t id = row.Integer("move_id", {0, INT64_MAX});
    const std::int64_t unit = row.Integer("unit_id", {0, UINT32_MAX});
    const std::array<double, 2> to_deg = {row.Number("theta_deg"), row.Number("phi_deg")};
    const sim::MoveConditions conditions = ConditionsOf(&row);
    if (row.error()) return;
    const auto at = place.find(unit);
    if (at == place.end())
      return row.RejectRow(fmt::format("there is no unit {}", unit), "unknown unit");
    const auto [move, fresh] = moves.try_emplace(id);
    if (fresh) {
      move->second.conditions = conditions;
      move->second.to_deg.resize(units.size());
    }
    if (!AreSame(move->second.conditions, conditions))
      return row.RejectRow(fmt::format("move {} has other conditions in a row before", id),
                           "other conditions in one move");
    auto& own = move->second.to_deg[at->second];
    if (own)
      return row.RejectRow(fmt::format("unit {} is twice in move {}", unit, id),
                           "twice in one move");
    own = to_deg;
  }));
  std::vector<sim::PlateMove> list;
  for (auto& [id, move] : moves) list.push_back(std::move(move));
  return list;
}

Result<std::vector<std::string>> ConditionsAsked(std::string_view text, std::string file) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  std::vector<std::string> asked;
  for (const Condition& condition : kConditions) {
    if (!table.Find(condition.column)) continue;
    std::set<std::int64_t> moves;
    FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
      const std::int64_t id = row.Integer("move_id", {0, INT64_MAX});
      const std::optional<double> value = condition.is_flag
                                              ? row.NumberOrFlagIfAny(condition.column)
                                              : row.NumberIfAny(condition.column);
      if (value && *value != condition.nothing) moves.insert(id);
    }));
    if (!moves.empty())
      asked.push_back(fmt::format("{} in {} {}, first in move {}", condition.column, moves.size(),
                                  moves.size() == 1 ? "move" : "moves", *moves.begin()));
  }
  return asked;
}

}  // namespace focalfleet
