// Boards that tell another temperature than they have. A unit's readings are held against the plane
// through those of all others at each exposure. A unit whose readings run with another gain is
// suspect, but no column decides whether it is warmer or its sensor is wrong. The arms and gears
// decide, which go with the true temperature: the campaign is explained by the temperatures as told
// and by those of the plane, and whoever explains it better is believed (diagnose.cc).
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

/// The campaign with the plane's temperature where a sensor is suspect.
struct TrueTemperatures {
  Campaign campaign;
  CampaignFacts facts;  // of `campaign`; where that is, they stay
  std::vector<std::size_t> units;
  Owner owner = Owner::kUnit;  // kRail, kBus: its units, and hardly any other
  double gain = 1;             // median of the suspects': what they tell a kelvin
  double gain_sigma = 0;       // of one of them
  bool are_half = false;       // of those who tell temperatures: as well the other half
};

inline constexpr std::string_view kSensorBias = "sensor_bias";

/// Why nothing can be said of sensors; empty: they are tested.
std::string WhyNoSensorIsTested(const CampaignFacts& facts);

/// nullptr: nobody is suspect. Pre: they are tested.
std::unique_ptr<TrueTemperatures> FindSuspectSensors(const CampaignFacts& facts);

/// Whether the model has a cause that goes with the temperature.
bool ReadsTemperature(const CampaignModel& model);

/// The cause, without its evidence. `fit` is of the plane's temperatures; `as_told`: facts of the
/// campaign as it was. Not `decided`: what goes with the temperature is a candidate, too.
CauseFound SensorCause(const Fit& fit, const TrueTemperatures& truth,
                       const CampaignFacts& as_reported, bool decided);

}  // namespace focalfleet::sim
