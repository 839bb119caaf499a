// Yanny parameter files (.par) of the Sloan surveys: keywords, `typedef struct` and `typedef enum`,
// then rows, each behind the name of its struct. Every struct is a table. The elements of an array
// are columns of their own (`mag_0`, `mag_1`).
#pragma once

#include <string>
#include <string_view>

#include "daemon/tables/source_table.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// True if the text is such a file by its first line or its first definition.
bool IsYanny(std::string_view text);

/// Errors: kInvalid with name:line: a definition that does not end, a row with too many or too few
/// values, no struct.
Result<SourceFile> ReadYannySource(std::string_view text, const std::string& name);

}  // namespace focalfleet
