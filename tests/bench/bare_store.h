/* bare_store is a bare sqlite3 loop: the store's table and durability, and nothing else. */
#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct sqlite3;
struct sqlite3_stmt;

struct bare_store {
  struct sqlite3* db;
  struct sqlite3_stmt* upsert;
};

/* Returns 0 or an SQLite code. */
int bare_store_open(struct bare_store* store, const char* path);
/* Commits one durable transaction: both axes of serials 1..serials stand at position k. */
int bare_store_update(struct bare_store* store, uint32_t serials, int32_t k, int64_t now_ns);
void bare_store_close(struct bare_store* store);

#ifdef __cplusplus
}
#endif
