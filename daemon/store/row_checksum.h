// The checksum of a stored row. A disk may return another bit than was written, and most rows with
// a wrong bit are still well formed: a place would be false, and nobody would know. SQLite has no
// checksum of its pages.
#pragma once

#include <sqlite3.h>

#include "protocol/base/result.h"

namespace focalfleet::store_internal {

/// Afterwards SQL of the connection has `row_checksum(value, ...)`, the CRC-32 of the values with
/// their types. The schema of a file may not call it. Errors: kUnavailable.
Status AddRowChecksum(sqlite3* db);

}  // namespace focalfleet::store_internal
