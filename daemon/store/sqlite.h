// SQLite's C interface with owners and types: a connection, a prepared statement, its failures as
// errors of this project. No part of SQLite is visible outside daemon/store.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet::store_internal {

/// The error code for a result code of SQLite.
ErrorCode CodeOf(int sqlite_code);

class Statement {
 public:
  Statement() = default;
  Statement(sqlite3* db, sqlite3_stmt* statement) : db_(db), statement_(statement) {}

  void Bind(int parameter, std::int64_t value) {
    sqlite3_bind_int64(statement_.get(), parameter, value);
  }
  void BindReal(int parameter, double value) {  // NaN becomes NULL
    sqlite3_bind_double(statement_.get(), parameter, value);
  }
  /// `text` must live until the statement has run.
  void BindText(int parameter, std::string_view text) {
    sqlite3_bind_text64(statement_.get(), parameter, text.data(), text.size(), SQLITE_STATIC,
                        SQLITE_UTF8);
  }
  void BindNull(int parameter) { sqlite3_bind_null(statement_.get(), parameter); }

  /// The statement has run to its end and can be bound and run again.
  Status Run() {
    const int code = sqlite3_step(statement_.get());
    if (code == SQLITE_DONE) [[likely]] {
      sqlite3_reset(statement_.get());
      return {};
    }
    return Failed(code);
  }

  /// True: a row can be read. False: there is no further row, and the statement is reset.
  Result<bool> Next() {
    const int code = sqlite3_step(statement_.get());
    if (code == SQLITE_ROW) return true;
    if (code == SQLITE_DONE) {
      sqlite3_reset(statement_.get());
      return false;
    }
    return tl::unexpected<Error>(Failed(code).error());
  }

  [[nodiscard]] sqlite3_stmt* get() const { return statement_.get(); }

 private:
  Status Failed(int code);

  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  sqlite3* db_ = nullptr;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

class Connection {
 public:
  enum class Mode : std::uint8_t { kWrite, kRead };

  /// The connection is open. Errors: as CodeOf; the text names the file.
  static Result<std::unique_ptr<Connection>> Open(const std::string& path, Mode mode,
                                                  const char* vfs, int busy_wait_ms);
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  Result<Statement> Prepare(std::string_view sql);
  Status Execute(const char* sql);
  /// The one integer that `sql` yields.
  Result<std::int64_t> Integer(const char* sql);
  /// The first finding of quick_check; empty: none. `table` is one with its indices; empty: all.
  Result<std::string> QuickCheck(std::string_view table = {});
  /// An open transaction is undone, unless there is no memory for that. Call it before a
  /// transaction, too: one that could not be undone is undone then.
  void Rollback();

  [[nodiscard]] sqlite3* db() const { return db_.get(); }
  [[nodiscard]] const std::string& path() const { return path_; }
  /// `error` with the file's name before it.
  [[nodiscard]] Error Named(Error error) const;

 private:
  explicit Connection(std::string path) : path_(std::move(path)) {}

  struct Close {
    void operator()(sqlite3* db) const { sqlite3_close_v2(db); }
  };
  std::string path_;
  std::unique_ptr<sqlite3, Close> db_;
  Statement rollback_;  // made beforehand: where memory ends, it could not be made
};

}  // namespace focalfleet::store_internal
