// Planted campaigns and told verdicts for the tests of the diagnosis.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "sim/diagnosis/diagnosis.h"
#include "sim/diagnosis/planted.h"

namespace focalfleet::sim {

inline Campaign Planted(std::vector<PlantedEffect> effects, PlantedOptions options = {}) {
  options.units = options.units == 60 ? 24 : options.units;
  options.effects = std::move(effects);
  auto campaign = PlantCampaign(options);
  EXPECT_TRUE(campaign) << campaign.error().text;
  return *campaign;
}

inline Diagnosis Verdicts(const Campaign& campaign, DiagnoseOptions options = {}) {
  options.with_gain = false;
  return Diagnose(campaign, options);
}

inline std::string Told(const Diagnosis& diagnosis) {
  std::string text(Name(diagnosis.verdict));
  for (const CauseFound& cause : diagnosis.causes) {
    text += "; " + cause.cause + " " + cause.axis + " " + cause.scope + " " +
            std::to_string(cause.amplitude);
    for (const std::string& candidate : cause.candidates) text += " " + candidate;
  }
  for (const UnknownFound& unknown : diagnosis.unknown) text += "; against " + unknown.covariate;
  return text;
}

}  // namespace focalfleet::sim
