// All binary tables of a FITS file as SourceTables: numbers, flags (1 and 0), texts. A column of
// short vectors becomes a column an element (`pfiNominal_0`, `pfiNominal_1`). Columns that hold no
// such values (bits, complex numbers, arrays of variable or great length) are passed over.
#pragma once

#include <string>

#include "daemon/tables/source_table.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kInvalid: not FITS, damaged, no binary table, too many rows; the text names `name`.
Result<SourceFile> ReadFitsSource(std::string bytes, const std::string& name);

}  // namespace focalfleet
