// The tables of the store, as a list of steps from each version to the next one. A step is one
// transaction that also raises user_version, so a crash between two steps leaves a store of an
// existing version. A released step is never edited.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "daemon/store/sqlite.h"
#include "protocol/base/result.h"

namespace focalfleet::store_internal {

inline constexpr std::int32_t kApplicationId = 0x46464c54;  // "FFLT" in the file's header

/// The steps: entry i is the SQL that makes version i + 1 out of version i.
std::span<const char* const> Migrations();

/// The file is a store, by its first page, or it is absent or empty. The check works without
/// SQLite, so it changes neither the file nor its WAL. Errors: kInvalid: not a store of ours;
/// kNewer: user_version above `version_max`.
Status InspectHeader(const std::string& path, std::int32_t version_max);

/// The same check by SQLite, which also reads the WAL. The result is the store's version.
Result<std::int32_t> InspectSchema(Connection& connection, std::int32_t version_max);

/// The store has version steps.size(). Errors: those of SQLite; the store then has an earlier
/// version, complete.
Status Migrate(Connection& connection, std::int32_t version, std::span<const char* const> steps);

}  // namespace focalfleet::store_internal
