// Selection from several beginnings, where one may lead astray: with and without steps of single
// units, and with zeros that differ from homing to homing.
#pragma once

#include <cmath>

#include "sim/diagnosis/select.h"

namespace focalfleet::sim {

/// The beginning with the most Merit decides; beginnings that claim more must be clearly better.
/// Post: the model's homing_zero_deg are empty where zeros are the same after each homing.
Selection SelectMultiStart(const Templates& templates, const SelectionRule& rule, Fit* fit);

/// How much zeros differ from homing to homing: rms over the moves, and what it does at the fibre.
struct HomingScatter {
  double rms_deg[2] = {0, 0};
  double um[2] = {0, 0};
  [[nodiscard]] double both_um() const { return std::hypot(um[0], um[1]); }
};
/// Pre: zeros are free.
HomingScatter ScatterOfHomings(const Fit& fit);

}  // namespace focalfleet::sim
