// Examine makes all checks, in the order in which a person would mend what they find.
#pragma once

#include <vector>

#include "daemon/doctor/check.h"

namespace focalfleet::doctor {

struct Facts;

std::vector<Check> Examine(const Facts& facts);

}  // namespace focalfleet::doctor
