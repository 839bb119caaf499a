// HallReport writes the results of a Hall rig's diagnosis: report.json, report.html, the extended
// model, and the poses to make next. The fields of report.json are those of every diagnosis
// (docs/hall.md).
//
// Voltages are converted to sizes at the fibre in two steps. A voltage corresponds to the tilt that
// changes a sensor's voltage as much (rms over sensors and poses). A tilt corresponds to the
// displacement at the end of an arm. Every value in um is therefore a voltage times one number, and
// the report gives both.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "daemon/hall/field_model_file.h"
#include "sim/hall/diagnosis/hall_diagnosis.h"

namespace focalfleet {

struct HallReportNames {
  std::string data;    // name of the data file
  std::string sha256;  // of the data file
  std::string model_before;
  std::string model_after;
  double arm_mm = 8;
  std::size_t rows = 0;
};

nlohmann::json HallReportJson(const sim::HallDiagnosis& diagnosis, const HallReportNames& names);

/// The verdict in one sentence.
std::string HallVerdictSentence(const sim::HallDiagnosis& diagnosis);

std::string HallReportPage(const sim::HallDiagnosis& diagnosis, const sim::HallCampaign& campaign,
                           const HallReportNames& names);

/// The model before, with the effects that the diagnosis found. An effect that the file format
/// cannot hold is a comment at its head.
HallModelFile ExtendedModel(const HallModelFile& before, const sim::HallDiagnosis& diagnosis,
                            const sim::HallCampaign& campaign, const sim::FieldModel& field,
                            const HallReportNames& names);

/// The poses to make next, as CSV: alpha_deg, beta_deg, gamma_deg.
std::string WriteNextPoses(const sim::HallDiagnosis& diagnosis);

}  // namespace focalfleet
