// These constants hold files of this folder that pages contain; CMake builds them in
// (embedded.cc.in).
#pragma once

#include <string_view>

namespace focalfleet::report {

extern const std::string_view kPageStyle;
extern const std::string_view kPlotStyle;
extern const std::string_view kPlanPageStyle;
extern const std::string_view kPlanPageBody;
extern const std::string_view kPlanPageScript;

}  // namespace focalfleet::report
