// The tables, and how a store of an earlier version becomes one of this version: a list of steps,
// each one transaction that also raises user_version, so that a crash between two steps leaves a
// store of a version that exists. A step once released is never edited.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "daemon/store/sqlite.h"
#include "protocol/base/result.h"

namespace focalfleet::store_internal {

inline constexpr std::int32_t kApplicationId = 0x46464c54;  // "FFLT", in the file's header

/// SQL that makes version i + 1 out of version i.
std::span<const char* const> Migrations();

/// What a file's first page says, without SQLite and so without any change to it or to its WAL.
/// Errors: kInvalid: not a store of ours; kNewer: user_version above `version_max`. No file, or an
/// empty one, is fine.
Status InspectHeader(const std::string& path, std::int32_t version_max);

/// The same from inside SQLite, which also sees what is still in the WAL. Gives the store's
/// version.
Result<std::int32_t> InspectSchema(Connection& connection, std::int32_t version_max);

/// The store has version steps.size(). Errors: as SQLite's; the store then has an earlier version,
/// whole.
Status Migrate(Connection& connection, std::int32_t version, std::span<const char* const> steps);

}  // namespace focalfleet::store_internal
