#include "daemon/campaign/move_list.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "fleet/files/csv.h"
#include "fleet/kinematics.h"
#include "protocol/base/rng.h"

namespace focalfleet {
namespace {

// The margin keeps moves clear of the stops, and leaves room for a unit's own zero angles.
constexpr double kMarginDeg = 3;
constexpr double kLadderDeg[] = {0.1, 0.2, 0.4, 1, 2, 4, 10};

/// The pose of all units in the plate's frame: elbow direction, and phi from stretched.
struct Stance {
  double theta_fp_deg = 0;
  double phi_fp_deg = 150;
};

/// The angles at which the unit comes nearest to the stance.
TargetAngles AnglesFor(const Unit& unit, const Stance& stance) {
  const auto within = [](double deg, const AxisGeometry& axis) {
    return std::clamp(deg, axis.min_deg + kMarginDeg, axis.max_deg - kMarginDeg);
  };
  const AxisGeometry& theta = unit.axis[Index(Axis::kTheta)];
  const AxisGeometry& phi = unit.axis[Index(Axis::kPhi)];
  return {within(stance.theta_fp_deg - theta.zero_deg, theta),
          within(stance.phi_fp_deg - phi.zero_deg, phi)};
}

ListedMove Everybody(const Layout& layout, std::int64_t id, const Stance& stance,
                     std::size_t every = 1, std::size_t first = 0) {
  ListedMove move{.id = id, .rows = {}};
  for (std::size_t n = 0; n < layout.size(); ++n) {
    const Unit& unit = layout.units()[n];
    if (unit.enabled && n % every == first)
      move.rows.push_back({.unit = unit.id, .place = AnglesFor(unit, stance)});
  }
  return move;
}

/// Out and back in equal steps, the axes in turn.
std::vector<Stance> Arcs(std::size_t count) {
  std::vector<Stance> stances;
  const std::size_t each = std::max<std::size_t>(count / 4, 1);
  const auto sweep = [&](double Stance::*axis, double from, double to) {
    for (std::size_t i = 1; i <= each && stances.size() < count; ++i) {
      Stance stance = stances.empty() ? Stance{} : stances.back();
      stance.*axis = from + (to - from) * static_cast<double>(i) / static_cast<double>(each);
      stances.push_back(stance);
    }
  };
  while (stances.size() < count) {
    sweep(&Stance::theta_fp_deg, -150, 150);
    sweep(&Stance::theta_fp_deg, 150, -150);
    sweep(&Stance::phi_fp_deg, 165, 70);
    sweep(&Stance::phi_fp_deg, 70, 165);
  }
  return stances;
}

Result<ListedMove> AtRandom(const Layout& layout, const std::vector<UnitDrive>& drives,
                            std::int64_t id, std::uint64_t seed) {
  const std::vector<std::optional<Pose>> none_fixed(layout.size());
  FOCALFLEET_TRY_ASSIGN(const auto drawn, DrawConfiguration(layout, drives, none_fixed, Rng(seed)));
  ListedMove move{.id = id, .rows = {}};
  for (std::uint32_t n = 0; n < layout.size(); ++n) {
    const Unit& unit = layout.units()[n];
    if (!unit.enabled) continue;
    const AxisAngles angles = AnglesOf(unit, drives[n], drawn[n]);
    move.rows.push_back({.unit = unit.id, .place = TargetAngles{angles.theta_deg, angles.phi_deg}});
  }
  return move;
}

std::vector<ListedMove> Diagnostic(const Layout& layout, std::size_t count) {
  std::vector<ListedMove> moves;
  const auto id = [&] { return static_cast<std::int64_t>(moves.size()) + 1; };
  const std::size_t third = std::max<std::size_t>(count / 3, 4);
  for (const Stance& stance : Arcs(third)) moves.push_back(Everybody(layout, id(), stance));
  // Reversals of growing size on one axis at a time, each followed by the same way back.
  Stance stance{.theta_fp_deg = 20, .phi_fp_deg = 120};
  moves.push_back(Everybody(layout, id(), stance));
  for (std::size_t rung = 0; moves.size() < 2 * third; ++rung) {
    const double step = kLadderDeg[rung / 4 % std::size(kLadderDeg)];
    double Stance::*axis = rung % 2 == 0 ? &Stance::theta_fp_deg : &Stance::phi_fp_deg;
    stance.*axis += rung % 4 < 2 ? step : -step;
    moves.push_back(Everybody(layout, id(), stance));
  }
  // Alternating shares of the units show effects that depend on how many units move at once.
  constexpr std::size_t kEvery[] = {1, 2, 4, 50};
  for (std::size_t i = 0; moves.size() < count; ++i) {
    const std::size_t every = kEvery[i / 2 % std::size(kEvery)];
    stance.theta_fp_deg += i % 2 == 0 ? 30 : -30;
    stance.phi_fp_deg += i % 2 == 0 ? 20 : -20;
    moves.push_back(Everybody(layout, id(), stance, every, i / 8 % every));
  }
  return moves;
}

}  // namespace

Result<MoveList> ReadMoveList(std::string_view text, std::string file, const Layout& layout) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"move_id", "unit_id", "theta_deg", "phi_deg"}));
  std::map<std::int64_t, ListedMove> moves;
  std::set<std::pair<std::int64_t, std::uint32_t>> named;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const std::int64_t id = row.Integer("move_id", {0, INT64_MAX});
    const auto unit = static_cast<std::uint32_t>(row.Integer("unit_id", {0, UINT32_MAX}));
    const TargetAngles angles{row.Number("theta_deg"), row.Number("phi_deg")};
    if (row.error()) return;
    if (!layout.Find(UnitId{unit}))
      return row.RejectRow("there is no unit " + std::to_string(unit), "unknown unit");
    if (!named.insert({id, unit}).second)
      return row.RejectRow(
          "unit " + std::to_string(unit) + " is twice in move " + std::to_string(id),
          "twice in one move");
    ListedMove& move = moves[id];
    move.id = id;
    move.rows.push_back({.unit = UnitId{unit}, .place = angles, .line = row.line()});
  }));
  if (moves.empty()) return Fail(ErrorCode::kInvalid, table.file() + ": a header, but no moves");
  MoveList list;
  list.ignored_columns =
      table.Others({"move_id", "unit_id", "theta_deg", "phi_deg", "drive_amplitude", "delay_s",
                    "elevation_deg", "rehomed", "separates"});
  for (auto& [id, move] : moves) list.moves.push_back(std::move(move));
  return list;
}

std::string WriteMoveList(const std::vector<ListedMove>& moves) {
  CsvWriter csv({"move_id", "unit_id", "theta_deg", "phi_deg"});
  for (const ListedMove& move : moves)
    for (const TargetRow& row : move.rows) {
      const auto& angles = std::get<TargetAngles>(row.place);
      csv.Integer(move.id).Integer(row.unit.value).Number(angles.theta_deg).Number(angles.phi_deg);
      csv.EndRow();
    }
  return csv.Take();
}

Result<std::vector<ListedMove>> MakeMoves(const Layout& layout,
                                          const std::vector<UnitDrive>& drives,
                                          const MakeMovesOptions& options) {
  std::vector<ListedMove> moves;
  if (options.kind == CampaignKind::kDiagnostic) {
    moves = Diagnostic(layout, options.moves);
  } else if (options.kind == CampaignKind::kArcs) {
    for (const Stance& stance : Arcs(options.moves))
      moves.push_back(Everybody(layout, static_cast<std::int64_t>(moves.size()) + 1, stance));
  } else {
    for (std::size_t i = 0; i < options.moves; ++i) {
      FOCALFLEET_TRY_ASSIGN(
          ListedMove move,
          AtRandom(layout, drives, static_cast<std::int64_t>(i) + 1, options.seed + i));
      moves.push_back(std::move(move));
    }
  }
  return moves;
}

}  // namespace focalfleet
