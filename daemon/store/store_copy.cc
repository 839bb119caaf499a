#include "daemon/store/store_copy.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "daemon/store/cells.h"
#include "daemon/store/lock_file.h"
#include "daemon/store/schema.h"
#include "daemon/store/sqlite.h"
#include "daemon/store/store_health.h"

namespace focalfleet {

using namespace store_internal;

namespace {

tl::unexpected<Error> FailSystem(const std::string& path, const char* what, int error) {
  return Fail(error == ENOSPC || error == EDQUOT ? ErrorCode::kFull : ErrorCode::kUnavailable,
              path + ": " + what + ": " + std::strerror(error));
}

Status CheckFree(const std::string& path) {
  for (const char* const suffix : {"", "-wal", "-journal"}) {
    std::error_code error;
    if (std::filesystem::symlink_status(path + suffix, error).type() !=
        std::filesystem::file_type::not_found)
      return Fail(ErrorCode::kRefused, path + suffix + " is there already: move it aside first");
  }
  return {};
}

/// Bytes that were written there stay after a power cut.
Status Sync(const std::string& path, int flags) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | flags);
  if (descriptor < 0) return FailSystem(path, "open", errno);
  const int failed = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  if (failed != 0) return FailSystem(path, "sync", failed);
  return {};
}

std::string FolderOf(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path();
  return folder.empty() ? "." : folder;
}

Status SyncFolder(const std::string& path) { return Sync(FolderOf(path), O_DIRECTORY); }

/// The file belongs to whom its folder belongs to, with its rights: a daemon that is another user
/// than the one who restores can write it.
Status GiveToFolder(const std::string& path) {
  struct stat folder {};
  if (::stat(FolderOf(path).c_str(), &folder) != 0)
    return FailSystem(FolderOf(path), "status", errno);
  // The folder's owner may have put a link there, to a file that he may not have.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (descriptor < 0) return FailSystem(path, "open", errno);
  struct stat file {};
  int failed = ::fstat(descriptor, &file) == 0 ? 0 : errno;
  if (failed == 0 && (!S_ISREG(file.st_mode) || file.st_nlink != 1)) failed = EMLINK;
  if (failed == 0 && ::geteuid() == 0 && ::fchown(descriptor, folder.st_uid, folder.st_gid) != 0)
    failed = errno;
  if (failed == 0 && (::geteuid() == 0 || ::geteuid() == file.st_uid) &&
      ::fchmod(descriptor, folder.st_mode & 0666) != 0)
    failed = errno;
  ::close(descriptor);
  if (failed != 0) return FailSystem(path, "give to the owner of the folder", failed);
  return {};
}

/// Copies all pages in one read transaction. In smaller pieces, each commit of the daemon would
/// begin the copy anew.
Status CopyPages(Connection& from, Connection& to) {
  sqlite3_backup* const backup = sqlite3_backup_init(to.db(), "main", from.db(), "main");
  if (backup != nullptr) {
    sqlite3_backup_step(backup, -1);
    sqlite3_backup_finish(backup);
  }
  const int code = sqlite3_errcode(to.db());
  if (code == SQLITE_OK) return {};
  return tl::unexpected<Error>(to.Named({CodeOf(code), sqlite3_errmsg(to.db())}));
}

/// Units may still hold moves that were numbered since the backup. Half of all numbers, which are 1
/// to 65535, lie between those of the backup and the next one.
constexpr const char* kLeapMoves =
    "UPDATE meta SET value = (value + 32766) % 65535 + 1, checksum = row_checksum(key, "
    "(value + 32766) % 65535 + 1) WHERE key = 'next_move'";

Status MakeReady(Connection& store) {
  const std::span<const char* const> steps = Migrations();
  FOCALFLEET_TRY_ASSIGN(const std::int32_t version,
                        InspectSchema(store, static_cast<std::int32_t>(steps.size())));
  FOCALFLEET_TRY(Migrate(store, version, steps));
  return store.Execute(kLeapMoves);
}

using Afterwards = Status (*)(Connection& copy);

Status Copy(const std::string& from, const std::string& to, Afterwards afterwards,
            const StoreOptions& options) {
  FOCALFLEET_TRY(InspectHeader(from, static_cast<std::int32_t>(Migrations().size())));
  const auto wait_ms = static_cast<int>(options.busy_wait.count());
  {
    FOCALFLEET_TRY_ASSIGN(const auto source,
                          Connection::Open(from, Connection::Mode::kRead, options.vfs, wait_ms));
    FOCALFLEET_TRY_ASSIGN(const auto target,
                          Connection::Open(to, Connection::Mode::kWrite, options.vfs, wait_ms));
    FOCALFLEET_TRY(CopyPages(*source, *target));
    // A backup is one file, whatever program copies it on.
    FOCALFLEET_TRY(target->Execute("PRAGMA journal_mode = DELETE"));
  }
  FOCALFLEET_TRY(CheckStore(to, options));
  if (afterwards != nullptr) {
    // The change sets checksums anew. A wrong value that was not found before would look right.
    FOCALFLEET_TRY_ASSIGN(const auto target,
                          Connection::Open(to, Connection::Mode::kWrite, options.vfs, wait_ms));
    FOCALFLEET_TRY(afterwards(*target));
  }
  if (afterwards != nullptr) FOCALFLEET_TRY(CheckStore(to, options));
  if (afterwards != nullptr) FOCALFLEET_TRY(GiveToFolder(to));
  return Sync(to, 0);
}

Status CopyAtOnce(const std::string& from, const std::string& to, Afterwards afterwards,
                  const StoreOptions& options) {
  FOCALFLEET_TRY(CheckFree(to));
  const std::string part = to + ".part";
  const auto clear = [&part] {
    for (const char* const suffix : {"", "-wal", "-shm", "-journal"})
      ::unlink((part + suffix).c_str());
  };
  clear();
  Status done = Copy(from, part, afterwards, options);
  // A link, unlike a rename, replaces nothing that came in the meantime.
  if (done && ::link(part.c_str(), to.c_str()) != 0) done = FailSystem(to, "link", errno);
  clear();
  if (done) done = SyncFolder(to);
  return done;
}

}  // namespace

Result<StoreHealth> CheckStore(const std::string& path, const StoreOptions& options) {
  FOCALFLEET_TRY_ASSIGN(StoreHealth health, InspectHealth(path, options));
  if (!health.flaw.empty()) return Fail(ErrorCode::kInvalid, "store " + path + ": " + health.flaw);
  if (health.version == 0) return Fail(ErrorCode::kInvalid, "store " + path + ": nothing is in it");
  // Older schemas lack columns; the daemon carries them over before it loads.
  if (health.version < health.version_expected) return health;
  FOCALFLEET_TRY_ASSIGN(const auto connection,
                        Connection::Open(path, Connection::Mode::kRead, options.vfs,
                                         static_cast<int>(options.busy_wait.count())));
  FOCALFLEET_TRY(LoadFleet(*connection));
  return health;
}

Status BackUpStore(const std::string& from, const std::string& to, const StoreOptions& options) {
  return CopyAtOnce(from, to, nullptr, options);
}

Status RestoreStore(const std::string& backup, const std::string& store,
                    const StoreOptions& options) {
  FOCALFLEET_TRY_ASSIGN(const auto lock, LockFile::Acquire(store + ".lock"));
  FOCALFLEET_TRY(GiveToFolder(store + ".lock"));
  return CopyAtOnce(backup, store, MakeReady, options);
}

}  // namespace focalfleet
