#include "daemon/simulator/truth_report.h"

#include <cmath>
#include <complex>
#include <limits>
#include <variant>

#include "fleet/files/csv.h"
#include "fleet/files/place.h"
#include "sim/world/mechanism.h"

namespace focalfleet::simulator {
namespace {

std::complex<double> Wanted(const TargetRow& row, const sim::UnitDescription& unit) {
  if (const auto* point = std::get_if<PointFp>(&row.place)) return {point->x_mm, point->y_mm};
  const auto& angles = std::get<TargetAngles>(row.place);
  return sim::FibreAt(sim::BuiltAsDescribed(unit), {angles.theta_deg, angles.phi_deg});
}

}  // namespace

std::string TruthCsv(const sim::World& world) {
  constexpr double kNotYet = std::numeric_limits<double>::quiet_NaN();  // an empty field
  CsvWriter csv({"unit_id", "theta_true_deg", "phi_true_deg", "theta_vectors", "phi_vectors",
                 "theta_true_vectors", "phi_true_vectors", "x_mm", "y_mm", "state", "moves_begun",
                 "last_move", "powered", "interrupted", "begun_twice", "began_s", "clock_error"});
  for (std::size_t row = 0; row < world.units().size(); ++row) {
    const sim::UnitTruth truth = world.Truth(row);
    csv.Integer(truth.id.value)
        .Number(truth.angle_deg[0])
        .Number(truth.angle_deg[1])
        .Integer(truth.applied[0])
        .Integer(truth.applied[1])
        .Number(truth.vectors[0])
        .Number(truth.vectors[1])
        .Number(truth.x_mm)
        .Number(truth.y_mm)
        .Text(Name(truth.state))
        .Integer(truth.moves_begun)
        .Integer(truth.last_move.value)
        .Integer(truth.powered ? 1 : 0)
        .Integer(truth.interrupted ? 1 : 0)
        .Integer(truth.begun_twice)
        .Number(truth.began == kNever ? kNotYet : 1e-9 * static_cast<double>(truth.began.ns))
        .Number(truth.clock_error);
    csv.EndRow();
  }
  return csv.Take();
}

Result<TrueErrors> CompareWithTargets(const sim::World& world, const Targets& targets) {
  TrueErrors errors;
  double sum = 0;
  for (const TargetRow& target : targets.rows) {
    const auto row = world.Find(target.unit);
    if (!row)
      return Fail(ErrorCode::kInvalid, PlaceIn(targets.source, target.line) + ": no unit " +
                                           std::to_string(target.unit.value) + " in this fleet");
    const sim::UnitDescription& unit = world.units()[*row];
    if (!unit.enabled) {
      ++errors.disabled;
      continue;
    }
    const sim::UnitTruth truth = world.Truth(*row);
    const double error_um =
        1000 * std::abs(std::complex<double>(truth.x_mm, truth.y_mm) - Wanted(target, unit));
    ++errors.units;
    sum += error_um * error_um;
    if (error_um > errors.max_um) {
      errors.max_um = error_um;
      errors.worst = target.unit;
    }
  }
  if (errors.units > 0) errors.rms_um = std::sqrt(sum / static_cast<double>(errors.units));
  return errors;
}

}  // namespace focalfleet::simulator
