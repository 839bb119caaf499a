// A number at the end of a file that was cut short would be taken for another. Tables of text
// therefore end their last line.
#pragma once

#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kInvalid, with file and line: the text does not end with a newline. An empty one does.
Status CheckLastLine(std::string_view text, const std::string& file);

}  // namespace focalfleet
