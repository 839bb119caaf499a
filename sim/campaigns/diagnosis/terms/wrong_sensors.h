// Some boards report another temperature than they have. A unit's readings are compared with the
// plane through those of all others at each exposure. A unit whose readings run with another gain
// is suspect. No column decides whether the unit is warmer or its sensor is wrong. The arms and
// gears decide, because they follow the true temperature. The campaign is explained by the reported
// temperatures and by those of the plane, and the better explanation is believed (diagnose.cc).
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {

/// The campaign with the plane's temperature where a sensor is suspect.
struct TrueTemperatures {
  Campaign campaign;
  CampaignFacts facts;  // of `campaign`, whose address they keep
  std::vector<std::size_t> units;
  Owner owner = Owner::kUnit;  // kRail, kBus: its units, and hardly any other
  double gain = 1;             // median of the suspects' readings per kelvin
  double gain_sigma = 0;       // of one of them
  bool are_half = false;       // of the units with readings: the other half may be wrong as well
};

/// The reason why sensors cannot be tested; empty where they are.
std::string WhyNoSensorIsTested(const CampaignFacts& facts);

/// The suspects' temperatures; nullptr where no sensor is suspect. Pre: sensors are tested.
std::unique_ptr<TrueTemperatures> FindSuspectSensors(const CampaignFacts& facts);

/// Whether the model has a cause that goes with the temperature.
bool ReadsTemperature(const CampaignModel& model);

/// The cause, without its evidence. `fit` is of the plane's temperatures, `as_reported` has the
/// facts of the unchanged campaign. Where not `decided`, causes that go with the temperature are
/// candidates, too.
CauseFound SensorCause(const Fit& fit, const TrueTemperatures& truth,
                       const CampaignFacts& as_reported, bool decided);

}  // namespace focalfleet::sim
