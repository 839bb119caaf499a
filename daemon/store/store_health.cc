#include "daemon/store/store_health.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstring>

#include "daemon/store/schema.h"
#include "daemon/store/sqlite.h"

namespace focalfleet {

using namespace store_internal;

namespace {

std::uint64_t BytesOf(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

/// The error of the connection's last operation, as a flaw of the file where it is one.
Result<std::string> FlawOf(const Connection& connection, const Error& error) {
  const int code = sqlite3_errcode(connection.db()) & 0xff;
  if (code == SQLITE_CORRUPT || code == SQLITE_NOTADB) return error.text;
  return tl::unexpected<Error>(error);
}

/// The first finding of quick_check; empty: the file is sound.
Result<std::string> FirstFlaw(Connection& connection) {
  auto finding = connection.QuickCheck();
  if (!finding) return FlawOf(connection, finding.error());
  return finding;
}

}  // namespace

Result<StoreHealth> InspectHealth(const std::string& path, const StoreOptions& options) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0)
    return Fail(ErrorCode::kUnavailable, "store " + path + ": " + std::strerror(errno));
  const auto version_max = static_cast<std::int32_t>(Migrations().size());
  FOCALFLEET_TRY(InspectHeader(path, version_max));
  FOCALFLEET_TRY_ASSIGN(const auto connection,
                        Connection::Open(path, Connection::Mode::kRead, options.vfs,
                                         static_cast<int>(options.busy_wait.count())));
  StoreHealth health;
  health.version_expected = version_max;
  health.bytes = BytesOf(path) + BytesOf(path + "-wal");
  FOCALFLEET_TRY_ASSIGN(health.flaw, FirstFlaw(*connection));
  if (!health.flaw.empty()) return health;
  FOCALFLEET_TRY_ASSIGN(health.version, InspectSchema(*connection, version_max));
  if (health.version == 0) return health;
  const auto count = [&](const char* sql) { return connection->Integer(sql); };
  FOCALFLEET_TRY_ASSIGN(const auto motions, count("SELECT coalesce(max(entry), 0) FROM intent"));
  FOCALFLEET_TRY_ASSIGN(const auto configurations, count("SELECT count(*) FROM configuration"));
  FOCALFLEET_TRY_ASSIGN(const auto since,
                        count("SELECT coalesce(min(began_ns), 0) FROM configuration"));
  health.motions = static_cast<std::uint64_t>(motions);
  health.configurations = static_cast<std::uint64_t>(configurations);
  if (configurations > 0) health.since = WallTime{since};
  return health;
}

}  // namespace focalfleet
