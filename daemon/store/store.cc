#include "daemon/store/store.h"

#include <cstdlib>
#include <variant>

#include "daemon/store/audit_rows.h"
#include "daemon/store/cells.h"
#include "daemon/store/lock_file.h"
#include "daemon/store/log_rewrite.h"
#include "daemon/store/pruner.h"
#include "daemon/store/row_writer.h"
#include "daemon/store/schema.h"
#include "daemon/store/sqlite.h"
#include "daemon/store/statements.h"

namespace focalfleet {

using namespace store_internal;

namespace {

/// The path by which all names of this file lock the same lock.
std::string Canonical(const std::string& path) {
  const std::unique_ptr<char, void (*)(void*)> file(realpath(path.c_str(), nullptr), std::free);
  if (file != nullptr) return file.get();
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const std::unique_ptr<char, void (*)(void*)> place(realpath(folder.c_str(), nullptr), std::free);
  if (place == nullptr) return path;
  return std::string(place.get()) + "/" + path.substr(slash == std::string::npos ? 0 : slash + 1);
}

Status SetUp(Connection& connection) {
  const auto version_max = static_cast<std::int32_t>(Migrations().size());
  // Until the file is known to be a store, closing it must not remove its WAL.
  sqlite3_db_config(connection.db(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  FOCALFLEET_TRY_ASSIGN(const std::int32_t version, InspectSchema(connection, version_max));
  sqlite3_db_config(connection.db(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 0, nullptr);
  FOCALFLEET_TRY(connection.Execute("PRAGMA journal_mode = WAL"));
  FOCALFLEET_TRY(connection.Execute("PRAGMA synchronous = FULL"));
  FOCALFLEET_TRY(connection.Execute("PRAGMA journal_size_limit = 16777216"));
  FOCALFLEET_TRY(connection.Execute("PRAGMA cell_size_check = ON"));
  // Without this promise of the file layer, a sync that fails once loses what later commits call
  // durable: the padding of a sector is written after the sync and never again.
  int powersafe = -1;
  sqlite3_file_control(connection.db(), "main", SQLITE_FCNTL_POWERSAFE_OVERWRITE, &powersafe);
  if (powersafe != 1)
    return Fail(ErrorCode::kUnavailable,
                "store " + connection.path() +
                    ": SQLite takes this disk for one that spoils bytes beside those it writes");
  FOCALFLEET_TRY(RewriteLog(connection));
  return Migrate(connection, version, Migrations());
}

}  // namespace

Store::Store() : pruner_(std::make_unique<Pruner>()) {}
Store::~Store() = default;

Result<std::unique_ptr<Store>> Store::Open(const std::string& path, const StoreOptions& options) {
  auto store = std::unique_ptr<Store>(new Store);
  store->path_ = options.vfs_has_files ? path : Canonical(path);
  if (!options.vfs_has_files) {
    // The lock comes first, because opening and closing the file would drop locks that this process
    // may have on it.
    FOCALFLEET_TRY_ASSIGN(store->lock_, LockFile::Acquire(store->path_ + ".lock"));
    FOCALFLEET_TRY(InspectHeader(store->path_, static_cast<std::int32_t>(Migrations().size())));
  }
  FOCALFLEET_TRY_ASSIGN(store->connection_,
                        Connection::Open(store->path_, Connection::Mode::kWrite, options.vfs,
                                         static_cast<int>(options.busy_wait.count())));
  FOCALFLEET_TRY(SetUp(*store->connection_));
  FOCALFLEET_TRY_ASSIGN(store->statements_, PrepareAll(*store->connection_));
  return store;
}

Result<StoredFleet> Store::Load() { return LoadFleet(*connection_); }

Status Store::Reject(Error why) {
  ++counters_.failed;
  return tl::unexpected<Error>(connection_->Named(std::move(why)));
}

Status Store::Rollback(Error why) {
  connection_->Rollback();
  return Reject(std::move(why));
}

Status Store::Commit(std::span<const Row> rows, WallTime now, std::size_t* refused) {
  if (refused != nullptr) *refused = rows.size();
  const auto refuse = [&](std::size_t row, const Error& why) {
    if (refused != nullptr) *refused = row;
    return Error{why.code, Describe(rows[row]) + ": " + why.text};
  };
  if (rows.empty()) return {};
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (const char* const flaw = Flaw(rows[k]))
      return Reject(refuse(k, {ErrorCode::kInvalid, flaw}));
  connection_->Rollback();
  if (auto begun = (*statements_)[Sql::kBegin].Run(); !begun) return Rollback(begun.error());
  RowWriter writer(statements_.get(), now);
  const auto write = [&](std::size_t k) -> Status {
    const Status written = writer.Write(rows[k]);
    if (written || written.error().code != ErrorCode::kInvalid) return written;
    return tl::unexpected<Error>(refuse(k, written.error()));
  };
  bool ends = false;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (const auto* end = std::get_if<IntentEndRow>(&rows[k])) {
      ends = true;
      if (auto noted = writer.NoteEnd(*end); !noted) return Rollback(noted.error());
    } else if (auto written = write(k); !written) {
      return Rollback(written.error());
    }
  }
  for (std::size_t k = 0; ends && k < rows.size(); ++k) {
    if (!std::holds_alternative<IntentEndRow>(rows[k])) continue;
    if (auto written = write(k); !written) return Rollback(written.error());
  }
  if (auto counted = writer.Finish(); !counted) return Rollback(counted.error());
  if (auto done = (*statements_)[Sql::kCommit].Run(); !done) return Rollback(done.error());
  ++counters_.transactions;
  counters_.rows += rows.size();
  return {};
}

Result<WallTime> Store::Newest() {
  FOCALFLEET_TRY_ASSIGN(
      const std::int64_t ns,
      connection_->Integer(
          "SELECT max(coalesce((SELECT max(began_ns, coalesce(ended_ns, 0)) FROM intent ORDER BY "
          "entry DESC LIMIT 1), 0), coalesce((SELECT at_ns FROM alarm ORDER BY id DESC LIMIT 1), "
          "0), coalesce((SELECT changed_ns FROM configuration ORDER BY id DESC LIMIT 1), 0))"));
  return WallTime{ns};
}

Result<AuditHead> Store::LastAudit() { return ReadAuditHead(&(*statements_)[Sql::kAuditHead]); }

Result<Pruned> Store::Prune(WallTime before, std::uint32_t rows_max) {
  const auto fail = [this](const Error& why) {
    pruner_->Restart();
    return tl::unexpected<Error>(Rollback(why).error());
  };
  connection_->Rollback();
  if (auto begun = (*statements_)[Sql::kBegin].Run(); !begun) return fail(begun.error());
  auto pruned = pruner_->Step(*connection_, before, rows_max, &counters_.prune_instructions);
  if (!pruned) return fail(pruned.error());
  if (auto done = (*statements_)[Sql::kCommit].Run(); !done) return fail(done.error());
  return pruned;
}

}  // namespace focalfleet
