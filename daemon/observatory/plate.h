// Plate is a focal plane with its configuration, state and moves as another project's files
// describe it, on the way into this project's tables. Each project has a room of its own that fills
// a Plate (desi.h, sdss.h, pfs.h, moons.h); WritePlate writes the folder. A row that cannot be
// taken without harm to the others is left out, with its place and reason. A fault that would make
// numbers wrong refuses the file.
#pragma once

#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "daemon/tables/read_table.h"
#include "fleet/hex_layout.h"
#include "fleet/layout.h"
#include "fleet/targets.h"
#include "protocol/base/result.h"

namespace focalfleet::observatory {

inline constexpr double kDegPerRad = 180 / std::numbers::pi;

/// Angles of a unit's two axes, as this project counts them. Units: degrees.
struct AnglesDeg {
  double theta_deg = 0;
  double phi_deg = 0;
};

struct PlateUnit {
  Unit unit;
  std::string name;                        // as the project calls it
  std::map<std::string, std::string> ids;  // its other names, by column of origin.csv
  std::string reason;                      // why it is disabled; empty: it is not
  std::optional<AnglesDeg> stands;         // empty: no file gives it
};

/// A row that was not taken.
struct LeftOut {
  std::string place;  // file and line or row
  std::string unit;   // as the project calls it
  std::string what;   // target, state, move
  std::string reason;
};

struct MeasuredMove {
  std::uint32_t unit = 0;
  std::int64_t move = 0;
  AnglesDeg from;
  AnglesDeg cmd;
  double x_mm = 0;  // NaN, both: it was not seen
  double y_mm = 0;
  double t_s = 0;  // NaN: not known
  bool from_measured = false;
  std::map<std::string, double> more;  // covariates by column; a missing one is not known
};

struct Plate {
  std::vector<PlateUnit> units;
  AnglesDeg parked;  // of units whose angles no file gives
  std::vector<Fiducial> fiducials;
  std::vector<Obstacle> obstacles;
  std::optional<Targets> targets;
  std::vector<MeasuredMove> moves;
  std::vector<LeftOut> left_out;
  std::vector<std::string> notes;  // what was assumed or passed over

  /// Null: no such unit.
  [[nodiscard]] PlateUnit* Find(UnitId id);
  /// The unit that was added with that id of origin.csv; null: none.
  [[nodiscard]] PlateUnit* FindBy(const std::string& column, const std::string& value);
  std::unordered_map<std::string, std::size_t> index = {};  // "column=value" to the unit's place
};

/// The files that a command names; a list may be empty.
struct SourceFiles {
  std::vector<std::string> layout;
  std::vector<std::string> targets;
  std::vector<std::string> state;
  std::vector<std::string> moves;
  std::vector<std::string> fiducials;
  std::vector<std::string> disabled;
  std::vector<std::string> fibre_map;
  std::vector<double> gears;      // empty: of the project; one for both axes, or theta and phi
  double arm_half_width_mm = 0;   // 0: of the layout
  double fiducial_radius_mm = 0;  // above 0: fiducials are obstacles, too
  bool from_camera = false;       // moves begin where the camera saw the fibre
};

// ---- Functions for the rooms of the projects

/// All tables of all files, in their order. Errors: as ReadTables.
Result<std::vector<NamedTable>> ReadAll(const std::vector<std::string>& files);
/// Notes the columns that no reader of these tables asked for, once for all files that have the
/// same ones, and the tables of which nothing was read. Call it when all is read.
void NotePassedOver(std::initializer_list<const std::vector<NamedTable>*> lists, Plate* plate);
/// The first table with all of these columns; null: none.
const NamedTable* WithColumns(const std::vector<NamedTable>& tables,
                              std::initializer_list<std::string_view> columns);
/// The first of the columns that the table has; empty: none of them.
std::string FirstColumnOf(const CsvTable& table, std::initializer_list<std::string_view> columns);
/// Errors: kInvalid: no table has them; names the columns that the first table lacks.
Result<const NamedTable*> Need(const std::vector<NamedTable>& tables,
                               std::initializer_list<std::string_view> columns,
                               const std::string& what);
/// The number in a name such as M04852; empty: it has none, or one beyond 32 bits.
std::optional<std::uint32_t> NumberInName(std::string_view name);
/// A time like 2026-03-03 01:02:03.5+00:00 in seconds since 1970; NaN: no such time.
double SecondsOf(std::string_view time);
/// The first angles within the unit's range with the fibre at that place; empty: out of reach.
std::optional<AnglesDeg> AnglesAt(const Unit& unit, PointFp place);
PointFp FibreOf(const Unit& unit, const AnglesDeg& angles);
/// The angle by whole turns within the range, nearest its middle; as it is where no turn fits.
double TurnedInto(double angle_deg, const AxisGeometry& axis);
void Disable(PlateUnit* unit, const std::string& reason);
/// Adds a unit, or rejects its row: what FaultOf finds, or an id that is there twice.
void AddUnit(PlateUnit unit, CsvRow* row, Plate* plate);
/// Gears and width of the arms as the command gives them; `gear` of both axes where it gives none.
/// Where a project's files have no gear, it is that of the layouts made here.
void SetGears(const SourceFiles& files, double gear, Unit* unit);
/// Disables the units that the tables name by `id_column` or unit_id, with their reasons.
Status TakeDisabled(const std::vector<NamedTable>& tables, const std::string& id_column,
                    Plate* plate);
/// Takes fiducials by columns such as fiducial_id, id; x_mm, xWok; y_mm, yWok. They become
/// obstacles, too, where the files have a radius for them.
Status TakeFiducials(const SourceFiles& files, Plate* plate);
/// Leaves a target out where its unit is disabled or cannot reach it; else takes it.
void TakeTarget(TargetRow target, const NamedTable& table, std::size_t row, PlateUnit* unit,
                Plate* plate);
void LeaveOut(const NamedTable& table, std::size_t row, const std::string& unit, const char* what,
              std::string reason, Plate* plate);

// ---- The folder

/// A robot outside its range cannot be planned: it is disabled, with that reason. A robot
/// that is beyond by no more than a reading may be off stands at the end, and a note says so.
void DisableOutsiders(Plate* plate);

/// Writes units.csv, origin.csv, state.csv, disabled.csv, obstacles.csv, left_out.csv, and those of
/// fiducials.csv, targets.csv and moves.csv that the plate has. Nothing is written where the layout
/// or a table is wrong. Errors: kInvalid as Layout::Create; as WriteFileAtomically.
Status WritePlate(const Plate& plate, const std::string& project, const std::string& folder);

}  // namespace focalfleet::observatory
