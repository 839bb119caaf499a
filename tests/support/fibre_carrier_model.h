// The model of the simulated joints' field, fitted to a map of their magnets as the maker of an
// instrument would measure it.
#pragma once

#include "daemon/hall/field_model_file.h"
#include "sim/hall/fibre_carrier.h"
#include "sim/hall/field_fit.h"

namespace focalfleet::test {

inline HallModelFile FittedFibreCarrierModel() {
  constexpr int kStepDeg = 4;
  const sim::FibreCarrierJoints joints({});
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

}  // namespace focalfleet::test
