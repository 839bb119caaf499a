// What a diagnosis of a Hall rig is handed over as: report.json (docs/hall.md; the fields of every
// diagnosis), report.html, the extended model, and the poses to make next.
//
// Sizes at the fibre: a voltage stands for the tilt that changes a sensor's voltage as much (rms
// over sensors and poses), a tilt for what it moves at the end of an arm. So every um is a
// voltage times one number, and both are told.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "daemon/hall/field_model_file.h"
#include "sim/hall/diagnosis/hall_diagnosis.h"

namespace focalfleet {

struct HallReportNames {
  std::string data;    // file
  std::string sha256;  // of it
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

/// The model with what was found in it; what it cannot hold is a comment at its head.
HallModelFile ExtendedModel(const HallModelFile& before, const sim::HallDiagnosis& diagnosis,
                            const sim::HallCampaign& campaign, const sim::FieldModel& field,
                            const HallReportNames& names);

/// alpha_deg, beta_deg, gamma_deg.
std::string WriteNextPoses(const sim::HallDiagnosis& diagnosis);

}  // namespace focalfleet
