// The model of the simulated joints' field, fitted to a map of their magnets as an instrument maker
// would measure it.
#pragma once

#include "daemon/hall/field_model_file.h"
#include "sim/hall/field_fit.h"
#include "sim/hall/spine.h"

namespace focalfleet::testing {

inline HallModelFile FittedSpineModel() {
  constexpr int kStepDeg = 4;
  const sim::SpineJoints joints({});
  sim::FieldMap map;
  for (int theta = 0; theta <= 180; theta += kStepDeg)
    for (int phi = 0; phi < 360; phi += kStepDeg)
      map.push_back({theta * sim::kRadPerDeg, phi * sim::kRadPerDeg,
                     joints.Field_T(theta * sim::kRadPerDeg, phi * sim::kRadPerDeg)});
  HallModelFile model;
  model.name = "joints";
  model.field = sim::FitField(map, sim::FieldKind::kSpherical)->parameters;
  return model;
}

}  // namespace focalfleet::testing
