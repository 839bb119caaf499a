#include "tests/bench/bare_store.h"

#include <sqlite3.h>
#include <stddef.h>

int bare_store_open(struct bare_store* store, const char* path) {
  int code = sqlite3_open_v2(
      path, &store->db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, NULL);
  if (code != SQLITE_OK) return code;
  code = sqlite3_exec(store->db,
                      "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;"
                      "CREATE TABLE axis_state(serial INTEGER NOT NULL, axis INTEGER NOT NULL, "
                      "witness INTEGER NOT NULL, low INTEGER NOT NULL, high INTEGER NOT NULL, "
                      "vector INTEGER, turns INTEGER, subdivision INTEGER NOT NULL, "
                      "move INTEGER NOT NULL, origin INTEGER NOT NULL, at_ns INTEGER NOT NULL, "
                      "PRIMARY KEY(serial, axis)) STRICT, WITHOUT ROWID",
                      NULL, NULL, NULL);
  if (code != SQLITE_OK) return code;
  return sqlite3_prepare_v2(store->db,
                            "INSERT OR REPLACE INTO axis_state VALUES(?,?,?,?,?,?,?,?,?,?,?)", -1,
                            &store->upsert, NULL);
}

int bare_store_update(struct bare_store* store, uint32_t serials, int32_t k, int64_t now_ns) {
  sqlite3_stmt* s = store->upsert;
  int code = sqlite3_exec(store->db, "BEGIN IMMEDIATE", NULL, NULL, NULL);
  for (uint32_t serial = 1; serial <= serials && code == SQLITE_OK; ++serial) {
    for (int axis = 0; axis < 2 && code == SQLITE_OK; ++axis) {
      sqlite3_bind_int64(s, 1, serial);
      sqlite3_bind_int64(s, 2, axis);
      sqlite3_bind_int64(s, 3, 3);
      sqlite3_bind_int64(s, 4, k);
      sqlite3_bind_int64(s, 5, k);
      sqlite3_bind_int64(s, 6, k % 96);
      sqlite3_bind_int64(s, 7, k / 96);
      sqlite3_bind_int64(s, 8, 96);
      sqlite3_bind_int64(s, 9, k & 0xffff);
      sqlite3_bind_int64(s, 10, 4);
      sqlite3_bind_int64(s, 11, now_ns);
      code = sqlite3_step(s) == SQLITE_DONE ? SQLITE_OK : SQLITE_ERROR;
      sqlite3_reset(s);
    }
  }
  if (code != SQLITE_OK) return code;
  return sqlite3_exec(store->db, "COMMIT", NULL, NULL, NULL);
}

void bare_store_close(struct bare_store* store) {
  sqlite3_finalize(store->upsert);
  sqlite3_close(store->db);
}
