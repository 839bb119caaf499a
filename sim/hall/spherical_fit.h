// The spherical model's coefficients from a map at one radius; field_fit.h describes the method.
#pragma once

#include <vector>

#include "sim/hall/field_fit.h"

namespace focalfleet::sim {

struct SphericalFit {
  std::vector<SphericalTerm> terms;
  double noise_T = 0;
  bool all_orders = false;
};

/// Pre: the map is not empty and not all zero.
SphericalFit FitSpherical(const FieldMap& map);

}  // namespace focalfleet::sim
