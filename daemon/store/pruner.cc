#include "daemon/store/pruner.h"

#include <iterator>
#include <utility>
#include <vector>

#include "fleet/records.h"

namespace focalfleet::store_internal {
namespace {

struct Table {
  // Rows after key (?2, ?3), at most ?4: both parts of the key, whether this row and with it all
  // later ones are younger than ?1, and whether it goes.
  const char* look;
  const char* remove;
};

// Keys ascend with time, so that a table is done at its first young row.
constexpr Table kTables[] = {
    // The last homing of a unit stays: a model from before it does not hold for this unit.
    {"SELECT entry, 0, began_ns >= ?1, CASE WHEN end IS NULL OR ended_ns >= ?1 THEN 0 "
     "WHEN end <> 5 THEN 1 ELSE EXISTS(SELECT 1 FROM intent AS later INDEXED BY intent_homed "
     "WHERE later.unit_id = intent.unit_id AND later.end = 5 AND later.entry > intent.entry) END "
     "FROM intent WHERE entry > ?2 AND ?3 IS NOT NULL ORDER BY entry LIMIT ?4",
     "DELETE FROM intent WHERE entry = ?1"},
    // The newest number stays, so that none comes twice.
    {"SELECT id, 0, began_ns >= ?1, changed_ns < ?1 AND state >= 3 AND "
     "id <> (SELECT max(id) FROM configuration) "
     "FROM configuration WHERE id > ?2 AND ?3 IS NOT NULL ORDER BY id LIMIT ?4",
     "DELETE FROM configuration WHERE id = ?1"},
    {"SELECT exposure, unit_id, at_ns >= ?1, at_ns < ?1 FROM measurement "
     "WHERE (exposure, unit_id) > (?2, ?3) ORDER BY exposure, unit_id LIMIT ?4",
     "DELETE FROM measurement WHERE exposure = ?1 AND unit_id = ?2"},
    {"SELECT exposure, unit_id, at_ns >= ?1, at_ns < ?1 FROM orientation "
     "WHERE (exposure, unit_id) > (?2, ?3) ORDER BY exposure, unit_id LIMIT ?4",
     "DELETE FROM orientation WHERE exposure = ?1 AND unit_id = ?2"},
    {"SELECT id, 0, at_ns >= ?1, at_ns < ?1 FROM alarm "
     "WHERE id > ?2 AND ?3 IS NOT NULL ORDER BY id LIMIT ?4",
     "DELETE FROM alarm WHERE id = ?1"},
    {"SELECT id, 0, first_ns >= ?1, last_ns < ?1 AND state = 2 FROM open_alarm "
     "WHERE id > ?2 AND ?3 IS NOT NULL ORDER BY id LIMIT ?4",
     "DELETE FROM open_alarm WHERE id = ?1"},
    // Entries in force stay: who set them, when, and what was measured.
    {"SELECT entry, 0, at_ns >= ?1, CASE WHEN at_ns >= ?1 THEN 0 ELSE NOT EXISTS(SELECT 1 FROM "
     "parameter AS now WHERE now.serial = old.serial AND now.axis = old.axis AND "
     "now.parameter = old.parameter AND now.value = old.value AND now.origin = old.origin AND "
     "now.at_ns = old.at_ns) END FROM parameter_history AS old "
     "WHERE entry > ?2 AND ?3 IS NOT NULL ORDER BY entry LIMIT ?4",
     "DELETE FROM parameter_history WHERE entry = ?1"},
    {"SELECT entry, 0, at_ns >= ?1, CASE WHEN at_ns >= ?1 THEN 0 ELSE NOT EXISTS(SELECT 1 FROM "
     "tuning AS now WHERE now.serial = old.serial AND now.axis = old.axis AND "
     "now.at_ns = old.at_ns) END FROM tuning_history AS old "
     "WHERE entry > ?2 AND ?3 IS NOT NULL ORDER BY entry LIMIT ?4",
     "DELETE FROM tuning_history WHERE entry = ?1"},
    // The next two keep entries since the first model: these say for which units a model holds.
    {"SELECT entry, 0, at_ns >= ?1 OR at_ns >= model.first_ns, 1 FROM axis_history, "
     "(SELECT coalesce(min(at_ns), ?1) AS first_ns FROM model_change) AS model "
     "WHERE entry > ?2 AND ?3 IS NOT NULL ORDER BY entry LIMIT ?4",
     "DELETE FROM axis_history WHERE entry = ?1"},
    // A unit's newest entry stays, which says since when and why it is as it is. The serial number
    // that it had before the first model stays, too: another one since then is another unit. The
    // newest number stays, so that none comes twice.
    {"SELECT entry, 0, at_ns >= ?1 OR at_ns >= model.first_ns, CASE WHEN at_ns >= ?1 THEN 0 "
     "WHEN serial = 0 THEN EXISTS(SELECT 1 FROM unit_history AS later WHERE "
     "later.unit_id = old.unit_id AND later.entry > old.entry) "
     "ELSE EXISTS(SELECT 1 FROM unit_history AS later WHERE later.unit_id = old.unit_id AND "
     "later.entry > old.entry AND later.serial <> 0 AND later.at_ns < model.first_ns) END "
     "FROM unit_history AS old, "
     "(SELECT coalesce(min(at_ns), 9223372036854775807) AS first_ns FROM model_change) AS model "
     "WHERE entry > ?2 AND ?3 IS NOT NULL ORDER BY entry LIMIT ?4",
     "DELETE FROM unit_history WHERE entry = ?1"},
};
static_assert(IntentEnd::kHomed == IntentEnd{5});
static_assert(ConfigurationState::kDone == ConfigurationState{3});

std::uint64_t Instructions(const Statement& statement) {
  return static_cast<std::uint64_t>(
      sqlite3_stmt_status(statement.get(), SQLITE_STMTSTATUS_VM_STEP, 1));
}

}  // namespace

Result<Pruned> Pruner::Step(Connection& connection, WallTime before, std::uint32_t rows_max,
                            std::uint64_t* instructions) {
  Pruned pruned;
  std::uint32_t left = rows_max;
  std::vector<std::pair<std::int64_t, std::int64_t>> old;
  while (left > 0 && table_ < std::size(kTables)) {
    FOCALFLEET_TRY_ASSIGN(Statement look, connection.Prepare(kTables[table_].look));
    look.Bind(1, before.ns);
    look.Bind(2, after_[0]);
    look.Bind(3, after_[1]);
    look.Bind(4, left);
    old.clear();
    bool done = true;  // the table has no further old row
    for (;;) {
      FOCALFLEET_TRY_ASSIGN(const bool is_row, look.Next());
      if (!is_row || sqlite3_column_int64(look.get(), 2) != 0) break;
      after_[0] = sqlite3_column_int64(look.get(), 0);
      after_[1] = sqlite3_column_int64(look.get(), 1);
      if (sqlite3_column_int64(look.get(), 3) != 0) old.emplace_back(after_[0], after_[1]);
      done = --left > 0;
      if (!done) break;
    }
    sqlite3_reset(look.get());
    *instructions += Instructions(look);
    FOCALFLEET_TRY_ASSIGN(Statement remove, connection.Prepare(kTables[table_].remove));
    for (const auto& [first, second] : old) {
      remove.Bind(1, first);
      remove.Bind(2, second);
      FOCALFLEET_TRY(remove.Run());
    }
    *instructions += Instructions(remove);
    pruned.rows += old.size();
    if (!done) break;
    ++table_;
    after_[0] = after_[1] = INT64_MIN;
  }
  pruned.more = table_ < std::size(kTables);
  if (!pruned.more) Restart();
  return pruned;
}

}  // namespace focalfleet::store_internal
