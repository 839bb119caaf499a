#include "daemon/soak/stored_picture.h"

#include <sqlite3.h>

#include <functional>
#include <utility>

namespace focalfleet::soak {
namespace {

bool Each(sqlite3* db, const char* sql, const std::function<void(sqlite3_stmt*)>& row) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(db, sql, -1, &statement, nullptr) != SQLITE_OK) return false;
  int code = SQLITE_ROW;
  while ((code = sqlite3_step(statement)) == SQLITE_ROW) row(statement);
  sqlite3_finalize(statement);
  return code == SQLITE_DONE;
}

std::uint32_t Unsigned(sqlite3_stmt* row, int column) {
  return static_cast<std::uint32_t>(sqlite3_column_int64(row, column));
}

bool ReadAll(sqlite3* db, StoredPicture* out) {
  return Each(db, "SELECT serial, axis, witness, low, high FROM axis_state",
              [&](sqlite3_stmt* row) {
                out->places[Unsigned(row, 0)][Unsigned(row, 1) & 1u] = {
                    sqlite3_column_int(row, 2), sqlite3_column_int64(row, 3),
                    sqlite3_column_int64(row, 4)};
              }) &&
         Each(db,
              "SELECT serial, unit_id, move, theta_low, theta_high, phi_low, phi_high FROM intent "
              "WHERE end IS NULL",
              [&](sqlite3_stmt* row) {
                out->intents[Unsigned(row, 0)] = {
                    Unsigned(row, 1),
                    Unsigned(row, 2),
                    {sqlite3_column_int64(row, 3), sqlite3_column_int64(row, 5)},
                    {sqlite3_column_int64(row, 4), sqlite3_column_int64(row, 6)}};
              }) &&
         Each(db, "SELECT unit_id, serial, enabled FROM unit", [&](sqlite3_stmt* row) {
           out->units[Unsigned(row, 0)] = {Unsigned(row, 1), sqlite3_column_int(row, 2) != 0};
         });
}

}  // namespace

std::optional<StoredPicture> PictureReader::Read(DiskPicture picture, std::string* why) {
  disk_.Load(std::move(picture));
  sqlite3* db = nullptr;
  const int code = sqlite3_open_v2("store.sqlite", &db, SQLITE_OPEN_READWRITE, disk_.name());
  std::optional<StoredPicture> read = StoredPicture{};
  if (code != SQLITE_OK || !ReadAll(db, &*read)) {
    *why = db == nullptr ? "no memory" : sqlite3_errmsg(db);
    read.reset();
  }
  sqlite3_close_v2(db);
  disk_.Load({});  // a picture of a large fleet takes memory
  return read;
}

}  // namespace focalfleet::soak
