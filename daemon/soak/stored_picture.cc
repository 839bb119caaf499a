#include "daemon/soak/stored_picture.h"

#include <sqlite3.h>

#include <functional>
#include <utility>

#include "daemon/soak/cell_text.h"

namespace focalfleet::soak {
namespace {

/// A table of which only sameness counts: its key is the first columns.
struct OtherTable {
  const char* name;
  Extent extent;
  int keys;
  const char* sql;
};
constexpr OtherTable kOthers[] = {
    {"axis", Extent::kState, 2,
     "SELECT serial, axis, subdivision, move, origin, offset FROM axis_state"},
    {"open_intent", Extent::kState, 2,
     "SELECT serial, move, unit_id, configuration, theta_from, phi_from, theta_to, phi_to, "
     "theta_low, theta_high, phi_low, phi_high FROM intent WHERE end IS NULL"},
    {"parameter", Extent::kState, 3,
     "SELECT serial, axis, parameter, value, origin FROM parameter"},
    {"tuning", Extent::kState, 2,
     "SELECT serial, axis, critical, repeat, margin, load_uNm, v_bus_V, counter1, subdivision, "
     "mode, origin FROM tuning"},
    {"mute", Extent::kState, 1, "SELECT name, until_ns, since_ns, reason, by FROM mute"},
    {"model", Extent::kState, 1, "SELECT sha256, text FROM model"},
    {"model_change", Extent::kState, 1,
     "SELECT entry, sha256, restores, name, campaign, campaign_sha256, rms_before_um, "
     "rms_after_um FROM model_change"},
    {"next", Extent::kState, 1,
     "SELECT key, value FROM meta WHERE key IN ('next_move', 'next_configuration', 'next_alarm', "
     "'next_exposure')"},
    {"intent_end", Extent::kAll, 3,
     "SELECT serial, move, end, count(*) FROM intent WHERE end IS NOT NULL GROUP BY serial, move, "
     "end"},
    {"configuration", Extent::kAll, 1,
     "SELECT id, source, state, targeted, arrived, refused, failed, stopped, unmeasured, "
     "makespan_predicted_s, makespan_s, energy_J, peak_power_W, start_skew_s, start_skew_bound_s "
     "FROM configuration"},
    {"alarm", Extent::kAll, 1, "SELECT id, severity, unit_id, bus_id, text, name FROM alarm"},
    {"open_alarm", Extent::kAll, 1,
     "SELECT id, severity, unit_id, bus_id, text, name, count, state, first_ns, last_ns, "
     "acknowledged_ns, ended_ns, acknowledged_by FROM open_alarm"},
    {"measurement", Extent::kAll, 2,
     "SELECT exposure, unit_id, serial, configuration, status, other, x_mm, y_mm, theta, phi, "
     "target_x_mm, target_y_mm, error_um, var_x_mm2, cov_xy_mm2, var_y_mm2, target_id, delay_s, "
     "source FROM measurement"},
    {"audit", Extent::kAll, 1,
     "SELECT entry, door, name, role, verb, request, request_bytes, request_sha256, taken, code, "
     "reason, configuration FROM audit"},
};

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

bool ReadMotion(sqlite3* db, StoredPicture* out) {
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
         Each(db, "SELECT unit_id, serial, enabled, reason FROM unit", [&](sqlite3_stmt* row) {
           out->units[Unsigned(row, 0)] = {Unsigned(row, 1), sqlite3_column_int(row, 2) != 0,
                                           CellText(row, 3)};
         });
}

bool ReadOthers(sqlite3* db, Extent extent, StoredPicture* out) {
  for (const OtherTable& table : kOthers) {
    if (table.extent > extent) continue;
    StoredPicture::Table& rows = out->others[table.name];
    const bool read = Each(db, table.sql, [&](sqlite3_stmt* row) {
      std::string key, values;
      for (int column = 0; column < sqlite3_column_count(row); ++column) {
        std::string& text = column < table.keys ? key : values;
        text += CellText(row, column) + '|';
      }
      rows[std::move(key)] = std::move(values);
    });
    if (!read) return false;
  }
  return true;
}

}  // namespace

std::optional<StoredPicture> PictureReader::Read(DiskPicture picture, Extent extent,
                                                 std::string* why) {
  disk_.Load(std::move(picture));
  sqlite3* db = nullptr;
  const int code = sqlite3_open_v2("store.sqlite", &db, SQLITE_OPEN_READWRITE, disk_.name());
  std::optional<StoredPicture> read = StoredPicture{};
  if (code != SQLITE_OK || !ReadMotion(db, &*read) || !ReadOthers(db, extent, &*read)) {
    *why = db == nullptr ? "no memory" : sqlite3_errmsg(db);
    read.reset();
  }
  sqlite3_close_v2(db);
  disk_.Load({});  // a picture of a large fleet takes memory
  return read;
}

}  // namespace focalfleet::soak
