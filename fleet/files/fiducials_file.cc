#include "fleet/files/fiducials_file.h"

#include <cmath>
#include <map>
#include <unordered_map>
#include <utility>

#include "fleet/files/csv.h"
#include "fleet/files/place.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr std::size_t kFiducialsMin = 3;

}  // namespace

Result<std::vector<Fiducial>> ReadFiducials(std::string_view text, std::string file) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"fiducial_id", "x_mm", "y_mm"}));
  std::vector<Fiducial> fiducials;
  std::unordered_map<std::uint32_t, int> line_of;
  std::map<std::pair<double, double>, int> line_at;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    Fiducial fiducial;
    fiducial.id = static_cast<std::uint32_t>(row.Integer("fiducial_id", {0, UINT32_MAX}));
    fiducial.at_fp = {row.Number("x_mm"), row.Number("y_mm")};
    for (const char* column : {"x_mm", "y_mm"})
      if (!row.error() && std::abs(row.Number(column)) > kCoordinateMaxMm)
        row.Reject(column, row.Text(column) + " is not on any plate");
    if (row.error()) return;
    const std::string named = "fiducial " + std::to_string(fiducial.id);
    const auto twice = [&](const std::string& what, int line) {
      row.RejectRow(named + ": " + what + ", first in " + LineOrRow(line), what);
    };
    if (const auto [it, fresh] = line_of.emplace(fiducial.id, row.line()); !fresh)
      return twice("is there twice", it->second);
    const std::pair<double, double> place{fiducial.at_fp.x_mm, fiducial.at_fp.y_mm};
    if (const auto [it, fresh] = line_at.emplace(place, row.line()); !fresh)
      return twice("is where another one is", it->second);
    fiducials.push_back(fiducial);
  }));
  if (fiducials.size() < kFiducialsMin || fiducials.size() > limits::kFiducials)
    return Fail(ErrorCode::kInvalid, table.file() + ": " + std::to_string(fiducials.size()) +
                                         " fiducials are not " + std::to_string(kFiducialsMin) +
                                         " to " + std::to_string(limits::kFiducials));
  return fiducials;
}

std::string WriteFiducials(std::span<const Fiducial> fiducials) {
  CsvWriter csv({"fiducial_id", "x_mm", "y_mm"});
  for (const Fiducial& f : fiducials)
    csv.Integer(f.id).Number(f.at_fp.x_mm).Number(f.at_fp.y_mm).EndRow();
  return csv.Take();
}

}  // namespace focalfleet
