// Files of this folder that pages carry, as CMake has built them in (embedded.cc.in).
#pragma once

#include <string_view>

namespace focalfleet::report {

extern const std::string_view kPlanPageStyle;
extern const std::string_view kPlanPageBody;
extern const std::string_view kPlanPageScript;

}  // namespace focalfleet::report
