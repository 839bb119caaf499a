// The diagnosis of a Hall rig's model from poses with known orientation. The result says which of
// the model's causes is wrong, by how much, and what a corrected model gains. The method is that of
// all diagnosis here. Signatures are the model itself with one parameter switched on. Amplitude and
// phase of the field are unknown beforehand, so they are projected out first. Causes enter one by
// one by evidence (explained chi^2 less ln n a parameter). A gate comes first, which chance passes
// once in a hundred thousand tries. Each entry is followed by a joint nonlinear fit. A cause is
// named alone where every rival that could replace it is worse by 9 or more in 2 ln L. Otherwise
// the whole set is reported. Structure that remains is reported as `unknown`, like an effect
// outside of the causes (outside.h) that explains the readings clearly better.
//
// The noise is that of the residuals when every parameter is free, so it need not be known.
// Readings far from all of that, at the ends of the range or missing are counted and left out.
// Sensors that stand still or are swapped are found before any fit.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "sim/hall/diagnosis/parameters.h"

namespace focalfleet::sim {

struct HallCauseFound {
  std::vector<HallCause> candidates;  // the cause itself first
  std::vector<std::size_t> sensors;   // from 0; empty: the rotor's field
  std::vector<std::size_t> parameters;
  double amplitude = 0;
  std::string amplitude_unit;
  std::array<double, 2> ci95{};
  double size_V = 0;  // rms over the readings that it acts on, free parameters projected out
  double chi2 = 0;    // explained
  double predicted_gain_V = 0;  // in rms over all readings
  std::string text;             // the term and the sensor, in words
};

struct HallUnknown {
  std::string covariate;
  double p_value = 1;
  double rms_V = 0;
};

struct HallSensorTrouble {
  std::string what;  // "stuck", "swapped", "missing"
  std::vector<std::size_t> sensors;
};

struct HallGain {
  double rms_before_V = 0, rms_after_V = 0, mad_before_V = 0, mad_after_V = 0;
  double explained = 0;
  std::string held_out;
};

enum class HallVerdict { kConsistent, kExplained, kAmbiguous, kUnknown, kInsufficient };
const char* Name(HallVerdict verdict);

struct HallDiagnosis {
  HallVerdict verdict = HallVerdict::kInsufficient;
  std::string missing;                 // the missing data, of kInsufficient
  std::vector<HallCauseFound> causes;  // strongest first
  std::vector<HallUnknown> unknown;
  std::vector<std::pair<HallCause, std::string>> not_testable;
  std::vector<HallSensorTrouble> troubles;
  std::map<std::string, std::size_t> outliers;  // readings left out, by reason
  std::size_t outlier_rows = 0;
  HallGain gain;
  double noise_V = 0;
  double sensitivity_V_per_rad = 0;  // of a sensor to a tilt, rms
  Eigen::VectorXd parameters;        // the extended model
  Eigen::VectorXd sd;                // 0 where not fitted
  ParameterLayout layout;
  std::vector<Reading> readings;          // the judged readings
  std::vector<double> before_V, after_V;  // residuals of the readings
  std::vector<Orientation> next_poses;
};

/// Cost: a second or so for 150 poses, because the search is made twice.
HallDiagnosis DiagnoseHall(const HallCampaign& campaign, const HallRig& rig,
                           const FieldModel& field);

}  // namespace focalfleet::sim
