// These are the files that `focalfleet diagnose` writes for programs. The file report.json holds
// the fields of docs/diagnosis.md. The file model.toml holds the extended model: the fitted
// geometry, and every accepted effect with its amplitudes, their uncertainty and the campaign they
// came from.
//
// A number that is not known is null in the report and absent from the model. ReadModelFile reads
// every model.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "protocol/base/result.h"
#include "sim/campaigns/diagnosis/decide/diagnosis.h"

namespace focalfleet {

struct ReportNames {
  std::string sha256;  // of moves.csv and units.csv
  std::string model_before = "nominal";
  std::string model_after = "extended";
  std::string campaign;
  /// Rival causes of each cause in the model before, by cause. The diagnosis does not ask again for
  /// what that model explains.
  std::map<std::string, std::vector<std::string>> candidates_before;
};

nlohmann::json ReportJson(const sim::Diagnosis& diagnosis, const ReportNames& names);

std::string WriteModel(const sim::Diagnosis& diagnosis, const ReportNames& names,
                       const sim::Campaign& campaign);

/// units_by_class.csv: a row a unit and axis.
std::string WriteUnitsByClass(const sim::Diagnosis& diagnosis);

/// `value` for human readers, with the given number of decimals or significant digits; "?" where it
/// is not known.
std::string Decimals(double value, int decimals);
std::string Significant(double value, int digits);

}  // namespace focalfleet
