#include "daemon/store/sqlite.h"

#include "daemon/store/row_checksum.h"

namespace focalfleet::store_internal {
namespace {

Error ErrorOf(sqlite3* db, int code) {
  const int extended = db == nullptr ? code : sqlite3_extended_errcode(db);
  const char* text = db == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(db);
  return Error{CodeOf(code), std::string(text) + " (SQLite " + std::to_string(extended) + ")"};
}

}  // namespace

ErrorCode CodeOf(int sqlite_code) {
  switch (sqlite_code & 0xff) {
    case SQLITE_FULL:
      return ErrorCode::kFull;
    case SQLITE_NOTADB:
    case SQLITE_CORRUPT:
    case SQLITE_CONSTRAINT:
    case SQLITE_MISMATCH:
    case SQLITE_RANGE:
    case SQLITE_TOOBIG:
    case SQLITE_ERROR:
      return ErrorCode::kInvalid;
    default:
      return ErrorCode::kUnavailable;
  }
}

Status Statement::Failed(int code) {
  Error error = ErrorOf(db_, code);
  // A damaged file refuses good rows, too: no row may be set aside for that.
  const int primary = code & 0xff;
  if (primary == SQLITE_CORRUPT || primary == SQLITE_NOTADB || primary == SQLITE_ERROR)
    error.code = ErrorCode::kUnavailable;
  sqlite3_reset(statement_.get());
  return tl::unexpected<Error>(std::move(error));
}

Result<std::unique_ptr<Connection>> Connection::Open(const std::string& path, Mode mode,
                                                     const char* vfs, int busy_wait_ms) {
  auto connection = std::unique_ptr<Connection>(new Connection(path));
  // A connection is used by one thread at a time, so SQLite need not lock around every bind.
  const int flags =
      SQLITE_OPEN_NOMUTEX |
      (mode == Mode::kWrite ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READONLY);
  sqlite3* db = nullptr;
  const int code = sqlite3_open_v2(path.c_str(), &db, flags, vfs);
  connection->db_.reset(db);
  if (code != SQLITE_OK) {
    return tl::unexpected<Error>(connection->Named(ErrorOf(db, code)));
  }
  sqlite3_busy_timeout(db, busy_wait_ms);
  // The file may come from anywhere, so its schema may not call functions with side effects, and
  // the schema itself may not be written.
  sqlite3_db_config(db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(db, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  if (auto added = AddRowChecksum(db); !added)
    return tl::unexpected<Error>(connection->Named(added.error()));
  FOCALFLEET_TRY_ASSIGN(connection->rollback_, connection->Prepare("ROLLBACK"));
  return connection;
}

Result<Statement> Connection::Prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v3(db(), sql.data(), static_cast<int>(sql.size()),
                                      SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (code != SQLITE_OK) return tl::unexpected<Error>(Named(ErrorOf(db(), code)));
  return Statement(db(), statement);
}

Status Connection::Execute(const char* sql) {
  const int code = sqlite3_exec(db(), sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return tl::unexpected<Error>(Named(ErrorOf(db(), code)));
  return {};
}

Result<std::int64_t> Connection::Integer(const char* sql) {
  FOCALFLEET_TRY_ASSIGN(Statement statement, Prepare(sql));
  const auto row = statement.Next();
  if (!row) return tl::unexpected<Error>(Named(row.error()));
  if (!*row)
    return tl::unexpected<Error>(Named({ErrorCode::kInvalid, std::string(sql) + ": nothing"}));
  return sqlite3_column_int64(statement.get(), 0);
}

Result<std::string> Connection::QuickCheck(std::string_view table) {
  std::string sql = "PRAGMA quick_check";
  if (!table.empty()) sql += "('" + std::string(table) + "')";
  FOCALFLEET_TRY_ASSIGN(Statement check, Prepare(sql));
  const auto row = check.Next();
  if (!row) return tl::unexpected<Error>(Named(row.error()));
  const auto* text = *row ? sqlite3_column_text(check.get(), 0) : nullptr;
  if (text == nullptr) return std::string("quick_check finds nothing to say");
  std::string finding(static_cast<const char*>(static_cast<const void*>(text)));
  // A read that fails is a finding, too, but the file may be sound.
  if (finding.find("unable to get the page") != std::string::npos)
    return tl::unexpected<Error>(Named({ErrorCode::kUnavailable, finding}));
  return finding == "ok" ? std::string() : finding;
}

void Connection::Rollback() {
  // After some errors SQLite has undone the transaction by itself; then this does nothing.
  if (sqlite3_get_autocommit(db()) == 0) static_cast<void>(rollback_.Run());
}

Error Connection::Named(Error error) const {
  error.text = "store " + path_ + ": " + error.text;
  return error;
}

}  // namespace focalfleet::store_internal
