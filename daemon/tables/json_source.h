// Tables in JSON: a list of objects, an object of such lists, an object of columns (`{"unit_id":
// [1, 2], "x_mm": [0.5, 1.5]}`), the form `{"columns": [...], "data": [[...]]}` of pandas, or an
// object of objects by name, whose names become the column `key`. Members of a nested object are
// columns `outer.inner`.
#pragma once

#include <string>
#include <string_view>

#include "daemon/tables/source_table.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kInvalid: not JSON (with the byte), or no table in it; the text names `name`.
Result<SourceFile> ReadJsonSource(std::string_view text, const std::string& name);

}  // namespace focalfleet
