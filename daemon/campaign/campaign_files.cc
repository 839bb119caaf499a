#include "daemon/campaign/campaign_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "daemon/campaign/move_order.h"
#include "fleet/files/cell.h"
#include "fleet/files/csv.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/place.h"

namespace focalfleet {
namespace {

using sim::Campaign;
using sim::CampaignUnit;
using sim::kPhi;
using sim::kTheta;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
constexpr IntegerBounds kIdBounds{0, UINT32_MAX - 1};
constexpr IntegerBounds kMoveBounds{0, 1'000'000'000};
constexpr double kAngleMax_deg = 1e6;
constexpr double kPlaceMax_mm = 1e5;
constexpr std::array<std::string_view, 8> kFixedColumns = {
    "unit_id",      "move_id",     "theta_from_deg", "theta_cmd_deg",
    "phi_from_deg", "phi_cmd_deg", "x_mm",           "y_mm"};
constexpr std::string_view kWordColumn = "mode";
constexpr std::array<std::string_view, 2> kFlagColumns = {"rehomed", "from_measured"};
constexpr std::string_view kTimeColumn = "t_s";

// Columns of numbers that docs/files.md names, each with the values that it may have. A word in one
// of them is an error, not another kind of column.
struct CovariateBounds {
  std::string_view column;
  double low;
  double high;
};
constexpr double kFar = 1e300;
constexpr CovariateBounds kKnownCovariates[] = {
    {"t_s", -kFar, kFar},         {"sigma_um", 0, 1e6},       {"frame_id", -kFar, kFar},
    {"temp_C", -200, 300},        {"v_bus_V", 0, 1000},       {"elevation_deg", -90, 180},
    {"rail_id", -kFar, kFar},     {"rail_slot", -kFar, kFar}, {"movers_on_rail", 0, 1e6},
    {"bus_id", -kFar, kFar},      {"bus_slot", -kFar, kFar},  {"delay_s", 0, 1e7},
    {"drive_amplitude", 0, 1000}, {"counter1", -kFar, kFar},  {"repeat", -kFar, kFar},
    {"cycles_theta", 0, kFar},    {"cycles_phi", 0, kFar},
};

double OrMissing(std::optional<std::uint32_t> value) {
  return value ? static_cast<double>(*value) : kMissing;
}

CampaignUnit UnitOf(const Unit& unit, bool has_rail, bool has_bus) {
  CampaignUnit out;
  out.id = unit.id.value;
  out.base_x_mm = unit.base_fp.x_mm;
  out.base_y_mm = unit.base_fp.y_mm;
  for (const Axis axis : kAxes) {
    const AxisGeometry& geometry = unit.axis[Index(axis)];
    out.arm_mm[Index(axis)] = geometry.arm_mm;
    out.zero_deg[Index(axis)] = geometry.zero_deg;
    out.gear[Index(axis)] = geometry.gear;
    out.min_deg[Index(axis)] = geometry.min_deg;
    out.max_deg[Index(axis)] = geometry.max_deg;
  }
  out.rail = has_rail ? static_cast<double>(unit.rail.value) : kMissing;
  out.bus = has_bus && unit.bus != kNoBus ? static_cast<double>(unit.bus.value) : kMissing;
  out.rail_slot = OrMissing(unit.rail_slot);
  out.bus_slot = OrMissing(unit.bus_slot);
  out.enabled = unit.enabled;
  return out;
}

// A row of moves.csv as it stands in the file, before the rows are sorted.
struct MoveRow {
  std::size_t unit = 0;
  std::size_t at = 0;  // row of the table
  std::int64_t move = 0;
  double from_deg[2] = {0, 0};
  double cmd_deg[2] = {0, 0};
  double x_mm = kMissing;
  double y_mm = kMissing;
};

void CheckSize(CsvRow* row, std::string_view column, double value, double size_max) {
  if (std::abs(value) > size_max)
    row->Reject(column, NumberText(value) + " is not within +-" + NumberText(size_max));
}

MoveRow ReadMove(CsvRow* row, const std::unordered_map<std::uint32_t, std::size_t>& unit_of_id,
                 const std::string& units_file) {
  MoveRow move;
  move.at = row->at();
  const auto id = static_cast<std::uint32_t>(row->Integer("unit_id", kIdBounds));
  move.move = row->Integer("move_id", kMoveBounds);
  constexpr std::string_view kFrom[] = {"theta_from_deg", "phi_from_deg"};
  constexpr std::string_view kCmd[] = {"theta_cmd_deg", "phi_cmd_deg"};
  for (const std::size_t axis : {kTheta, kPhi}) {
    move.from_deg[axis] = row->Number(kFrom[axis]);
    move.cmd_deg[axis] = row->Number(kCmd[axis]);
    CheckSize(row, kFrom[axis], move.from_deg[axis], kAngleMax_deg);
    CheckSize(row, kCmd[axis], move.cmd_deg[axis], kAngleMax_deg);
  }
  move.x_mm = row->NumberIfAny("x_mm").value_or(kMissing);
  move.y_mm = row->NumberIfAny("y_mm").value_or(kMissing);
  CheckSize(row, "x_mm", move.x_mm, kPlaceMax_mm);
  CheckSize(row, "y_mm", move.y_mm, kPlaceMax_mm);
  if (std::isnan(move.x_mm) != std::isnan(move.y_mm))
    row->Reject(std::isnan(move.x_mm) ? "x_mm" : "y_mm",
                "the other coordinate is there: both or neither");
  if (row->error()) return move;
  const auto unit = unit_of_id.find(id);
  if (unit == unit_of_id.end())
    row->RejectRow("column unit_id: unit " + std::to_string(id) + " is not in " + units_file,
                   "unknown unit");
  else
    move.unit = unit->second;
  return move;
}

std::string TwiceText(std::uint32_t id, std::int64_t move, int line) {
  return "column move_id: unit " + std::to_string(id) + " has move " + std::to_string(move) +
         " twice, first in " + LineOrRow(line);
}

/// The columns of moves.csv beyond the required ones. Values stand in the order of the file.
class MoreColumns {
 public:
  /// Decides of each column whether it is read: by its name or, where the name is not known, by its
  /// cells.
  explicit MoreColumns(const CsvTable& table) {
    for (std::size_t column = 0; column < table.columns().size(); ++column) {
      const std::string& name = table.known_as(column);
      if (std::ranges::count(kFixedColumns, name) > 0) continue;
      if (name == kWordColumn) {
        modes_ = sim::WordColumn{name, {sim::kDriveModes.begin(), sim::kDriveModes.end()}, {}};
      } else if (IsKnown(name) || ReasonToPassOver(table, column).empty()) {
        covariates_.push_back({name, {}});
      } else {
        passed_over_.push_back(ReasonToPassOver(table, column));
      }
    }
  }

  void Read(CsvRow* row) {
    for (sim::Covariate& covariate : covariates_)
      covariate.values.push_back(ValueOf(row, covariate.name).value_or(kMissing));
    if (modes_) modes_->values.push_back(ModeOf(row));
  }

  /// Adds the columns to `campaign`, with values in the order of `rows`.
  void TakeInto(Campaign* campaign, const std::vector<MoveRow>& rows) {
    const auto in_order = [&](auto* values) {
      auto sorted = *values;
      for (std::size_t k = 0; k < rows.size(); ++k) sorted[k] = (*values)[rows[k].at];
      *values = std::move(sorted);
    };
    for (sim::Covariate& covariate : covariates_) in_order(&covariate.values);
    campaign->covariates = std::move(covariates_);
    if (!modes_) return;
    in_order(&modes_->values);
    campaign->word_columns.push_back(std::move(*modes_));
  }

  /// The values of a numeric column in the order of the file; null where there is no such column.
  [[nodiscard]] const std::vector<double>* Find(std::string_view name) const {
    const auto found = std::ranges::find(covariates_, name, &sim::Covariate::name);
    return found == covariates_.end() ? nullptr : &found->values;
  }
  [[nodiscard]] const std::vector<std::string>& passed_over() const { return passed_over_; }

 private:
  static const CovariateBounds* BoundsOf(std::string_view name) {
    const auto* found = std::ranges::find(kKnownCovariates, name, &CovariateBounds::column);
    return found == std::end(kKnownCovariates) ? nullptr : found;
  }
  static bool IsFlag(std::string_view name) { return std::ranges::count(kFlagColumns, name) > 0; }
  static bool IsKnown(std::string_view name) { return IsFlag(name) || BoundsOf(name) != nullptr; }

  /// Why the column is ignored; empty where all its cells are numbers or flags. For a column of
  /// words the message names the column. Where words stand among numbers one of them may be an
  /// error, so the message names the first word.
  static std::string ReasonToPassOver(const CsvTable& table, std::size_t column) {
    const std::string name = table.Shown(column);
    if (!table.HasName(column)) return name;
    bool any_number = false;
    std::optional<std::size_t> word;
    for (std::size_t k = 0; k < table.size() && !(word && any_number); ++k) {
      const CellKind kind = KindOf(Trimmed(table.cell(k, column)));
      any_number |= kind == CellKind::kNumber;
      if (kind == CellKind::kWord && !word) word = k;
    }
    if (!word) return {};
    if (!any_number) return name;
    return name + " (not all numbers: " + Quoted(table.cell(*word, column)) + " in " +
           LineOrRow(table.line(*word)) + ")";
  }

  static std::optional<double> ValueOf(CsvRow* row, const std::string& name) {
    if (IsFlag(name)) {
      const auto flag = row->FlagIfAny(name);
      return flag ? std::optional<double>(*flag ? 1 : 0) : std::nullopt;
    }
    const CovariateBounds* bounds = BoundsOf(name);
    if (bounds == nullptr) return row->NumberOrFlagIfAny(name);
    const auto value = row->NumberIfAny(name);
    if (value && (*value < bounds->low || *value > bounds->high))
      row->Reject(name, NumberText(*value) + " is not between " + NumberText(bounds->low) +
                            " and " + NumberText(bounds->high));
    return value;
  }

  static int ModeOf(CsvRow* row) {
    if (!row->Has(kWordColumn)) return -1;
    const std::string word = row->Text(kWordColumn);
    const auto* it = std::ranges::find(sim::kDriveModes, word);
    if (it == sim::kDriveModes.end())
      row->Reject(kWordColumn, Quoted(word) + " is not asymmetric, five_segment or seven_segment");
    return static_cast<int>(it - sim::kDriveModes.begin());
  }

  std::vector<sim::Covariate> covariates_;
  std::optional<sim::WordColumn> modes_;
  std::vector<std::string> passed_over_;
};

Result<std::vector<MoveRow>> ReadMoveRows(const CsvTable& table, const UnitsFile& units,
                                          MoreColumns* more) {
  std::unordered_map<std::uint32_t, std::size_t> unit_of_id;
  for (std::size_t u = 0; u < units.units.size(); ++u) unit_of_id[units.units[u].id.value] = u;
  std::vector<MoveRow> rows;
  rows.reserve(table.size());
  std::unordered_map<std::uint64_t, int> line_of;
  line_of.reserve(table.size());
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const MoveRow move = ReadMove(&row, unit_of_id, units.source);
    more->Read(&row);
    if (row.error()) return;
    const std::uint64_t key =
        (std::uint64_t{move.unit} << 32) | static_cast<std::uint64_t>(move.move);
    if (const auto [it, fresh] = line_of.emplace(key, row.line()); !fresh)
      return row.RejectRow(TwiceText(units.units[move.unit].id.value, move.move, it->second),
                           "a move twice");
    rows.push_back(move);
  }));
  if (rows.empty()) return Fail(ErrorCode::kInvalid, table.file() + ": a header, but no moves");
  return rows;
}

// Rows sorted by unit, and for each unit in the order in which its moves were made.
std::vector<MoveRow> InOrder(const std::vector<MoveRow>& rows, const MoreColumns& more,
                             TableNotes* notes) {
  const std::vector<double>* times_s = more.Find(kTimeColumn);
  std::vector<MoveKey> keys;
  keys.reserve(rows.size());
  for (const MoveRow& row : rows)
    keys.push_back({.unit = row.unit,
                    .move = row.move,
                    .t_s = times_s == nullptr ? kMissing : (*times_s)[row.at]});
  const MoveOrder order = OrderMoves(std::move(keys));
  if (notes != nullptr) notes->rows_out_of_order = order.out_of_order;
  std::vector<MoveRow> sorted;
  sorted.reserve(rows.size());
  for (const std::size_t row : order.rows) sorted.push_back(rows[row]);
  return sorted;
}

void TakeRows(const std::vector<MoveRow>& rows, const UnitsFile& units, bool has_rail, bool has_bus,
              Campaign* campaign) {
  std::optional<std::size_t> unit;
  for (const MoveRow& row : rows) {
    if (unit != row.unit) {
      campaign->units.push_back(UnitOf(units.units[row.unit], has_rail, has_bus));
      campaign->first_row.push_back(campaign->move_id.size());
      unit = row.unit;
    }
    campaign->move_id.push_back(row.move);
    for (const std::size_t axis : {kTheta, kPhi}) {
      campaign->from_deg[axis].push_back(row.from_deg[axis]);
      campaign->cmd_deg[axis].push_back(row.cmd_deg[axis]);
    }
    campaign->x_mm.push_back(row.x_mm);
    campaign->y_mm.push_back(row.y_mm);
  }
  campaign->first_row.push_back(campaign->move_id.size());
}

/// Reads which hardware stood at each place, where units.csv gives it.
Status ReadSerials(const CampaignTables& tables, Campaign* campaign) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(tables.units, tables.units_file));
  if (!table.Find("serial")) return {};
  std::unordered_map<std::uint32_t, CampaignUnit*> unit_of;
  for (CampaignUnit& unit : campaign->units) unit_of[unit.id] = &unit;
  return table.ReadRows([&](CsvRow& row) {
    const auto id = static_cast<std::uint32_t>(row.Integer("unit_id", {0, UINT32_MAX}));
    const auto serial = row.IntegerIfAny("serial", {0, UINT32_MAX});
    if (row.error()) return;
    if (const auto unit = unit_of.find(id); unit != unit_of.end())
      unit->second->serial = static_cast<std::uint32_t>(serial.value_or(0));
  });
}

}  // namespace

Result<Campaign> ReadCampaign(const CampaignTables& tables, TableNotes* notes) {
  FOCALFLEET_TRY_ASSIGN(const UnitsFile units, ReadUnits(tables.units, tables.units_file));
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(tables.moves, tables.moves_file));
  FOCALFLEET_TRY(table.Require({"unit_id", "move_id", "theta_from_deg", "theta_cmd_deg",
                                "phi_from_deg", "phi_cmd_deg", "x_mm", "y_mm"}));
  MoreColumns more(table);
  FOCALFLEET_TRY_ASSIGN(const std::vector<MoveRow> as_they_stand,
                        ReadMoveRows(table, units, &more));
  const std::vector<MoveRow> rows = InOrder(as_they_stand, more, notes);
  Campaign campaign;
  campaign.name = tables.name;
  const auto has = [&](std::string_view column) {
    return std::ranges::count(units.columns, column) > 0;
  };
  TakeRows(rows, units, has("rail_id"), has("bus_id"), &campaign);
  FOCALFLEET_TRY(ReadSerials(tables, &campaign));
  if (notes != nullptr) {
    notes->ignored_of_moves = more.passed_over();
    notes->ignored_of_units = units.ignored_columns;
  }
  more.TakeInto(&campaign, rows);
  FOCALFLEET_TRY(Validate(campaign));
  return campaign;
}

std::string WriteMoves(const Campaign& campaign) {
  std::vector<std::string_view> columns(kFixedColumns.begin(), kFixedColumns.end());
  for (const sim::Covariate& covariate : campaign.covariates) columns.push_back(covariate.name);
  for (const sim::WordColumn& column : campaign.word_columns) columns.push_back(column.name);
  CsvWriter csv(columns);
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      csv.Integer(campaign.units[unit].id).Integer(campaign.move_id[row]);
      for (const std::size_t axis : {kTheta, kPhi})
        csv.Number(campaign.from_deg[axis][row]).Number(campaign.cmd_deg[axis][row]);
      csv.Number(campaign.x_mm[row]).Number(campaign.y_mm[row]);
      for (const sim::Covariate& covariate : campaign.covariates) csv.Number(covariate.values[row]);
      for (const sim::WordColumn& column : campaign.word_columns) {
        const int word = column.values[row];
        word < 0 ? csv.Missing() : csv.Text(column.words[static_cast<std::size_t>(word)]);
      }
      csv.EndRow();
    }
  return csv.Take();
}

std::string WriteCampaignUnits(const Campaign& campaign) {
  CsvWriter csv({"unit_id", "base_x_mm", "base_y_mm", "arm_theta_mm", "arm_phi_mm",
                 "theta_zero_deg", "phi_zero_deg", "theta_gear", "phi_gear", "theta_min_deg",
                 "theta_max_deg", "phi_min_deg", "phi_max_deg", "rail_id", "rail_slot", "bus_id",
                 "bus_slot", "enabled", "serial"});
  for (const CampaignUnit& unit : campaign.units) {
    csv.Integer(unit.id).Number(unit.base_x_mm).Number(unit.base_y_mm);
    csv.Number(unit.arm_mm[kTheta]).Number(unit.arm_mm[kPhi]);
    csv.Number(unit.zero_deg[kTheta]).Number(unit.zero_deg[kPhi]);
    csv.Number(unit.gear[kTheta]).Number(unit.gear[kPhi]);
    for (const std::size_t axis : {kTheta, kPhi})
      csv.Number(unit.min_deg[axis]).Number(unit.max_deg[axis]);
    csv.Number(unit.rail).Number(unit.rail_slot).Number(unit.bus).Number(unit.bus_slot);
    csv.Integer(unit.enabled ? 1 : 0);
    unit.serial == 0 ? csv.Missing() : csv.Integer(unit.serial);
    csv.EndRow();
  }
  return csv.Take();
}

}  // namespace focalfleet
