// same_moves CANDUMP_LOG DATABASE UNITS_CSV INTERFACE... compares the moves on the buses with those
// in the store, for every unit and in both directions. The log is decoded with protocol/ alone, the
// database read with plain SQL. Interfaces stand in ascending order of bus_id. The exit code is 0
// where they agree.
#include <sqlite3.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "protocol/wire/staged_move.h"
#include "tests/can/bus_story.h"

namespace focalfleet {
namespace {

using test::BusNode;
using test::BusStory;
using test::Listen;
using test::OverheardMove;
using test::OverheardUnit;
using test::ParseCandump;
using Pair = std::array<std::int64_t, kAxisCount>;

// Codes of the store's tables (docs of daemon/store/schema.cc): how an intent ended.
constexpr std::int64_t kEndArrived = 0;

int complaints = 0;

void Complain(const std::string& subject, const std::string& what) {
  ++complaints;
  std::printf("%s: %s\n", subject.c_str(), what.c_str());
}

std::string Text(const Pair& pair) {
  return "(" + std::to_string(pair[0]) + ", " + std::to_string(pair[1]) + ")";
}

std::string ReadFile(const char* path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

// ---- the store

struct Moved {
  std::int64_t unit_id = 0;
  std::int64_t serial = 0;
  std::int64_t move = 0;
  Pair from{};
  Pair to{};
  std::int64_t end = -1;  // -1: open
  Pair stood{};           // position at its end
};

struct StoredPosition {
  std::int64_t low = 0;
  std::int64_t high = 0;
};

using Rows = std::vector<std::vector<std::int64_t>>;

Rows Query(const char* path, const char* sql) {
  sqlite3* raw = nullptr;
  Rows rows;
  if (sqlite3_open_v2(path, &raw, SQLITE_OPEN_READONLY, nullptr) != SQLITE_OK)
    Complain(path, sqlite3_errmsg(raw));
  const std::unique_ptr<sqlite3, int (*)(sqlite3*)> database(raw, sqlite3_close);
  sqlite3_stmt* prepared = nullptr;
  if (sqlite3_prepare_v2(raw, sql, -1, &prepared, nullptr) != SQLITE_OK)
    Complain(path, sqlite3_errmsg(raw));
  const std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement(prepared, sqlite3_finalize);
  while (prepared != nullptr && sqlite3_step(prepared) == SQLITE_ROW) {
    std::vector<std::int64_t> row;
    for (int i = 0; i < sqlite3_column_count(prepared); ++i)
      row.push_back(sqlite3_column_int64(prepared, i));
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<Moved> ReadMoves(const char* path) {
  std::vector<Moved> moves;
  for (const auto& r :
       Query(path,
             "SELECT unit_id, serial, move, theta_from, phi_from, theta_to, phi_to, "
             "ifnull(end, -1), theta_end_low, phi_end_low FROM intent ORDER BY entry"))
    moves.push_back({r[0], r[1], r[2], {r[3], r[4]}, {r[5], r[6]}, r[7], {r[8], r[9]}});
  return moves;
}

std::map<std::pair<std::int64_t, std::int64_t>, StoredPosition> ReadStoredPositions(
    const char* path) {
  std::map<std::pair<std::int64_t, std::int64_t>, StoredPosition> out;
  for (const auto& r : Query(path, "SELECT serial, axis, low, high FROM axis_state"))
    out[{r[0], r[1]}] = {r[2], r[3]};
  return out;
}

// ---- units.csv

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

struct Place {
  std::int64_t bus = 0;
  std::int64_t node = 0;
};

std::map<std::int64_t, Place> ReadPlaces(const char* path) {
  std::istringstream in(ReadFile(path));
  std::map<std::int64_t, Place> places;
  std::vector<std::string> head;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    const auto cells = Cells(line);
    if (head.empty()) {
      head = cells;
      continue;
    }
    const auto cell = [&](const char* name) {
      const auto at = std::find(head.begin(), head.end(), name) - head.begin();
      return std::stoll(cells.at(static_cast<std::size_t>(at)));
    };
    places[cell("unit_id")] = {cell("bus_id"), cell("node_id")};
  }
  return places;
}

std::map<std::int64_t, BusNode> OnInterfaces(const std::map<std::int64_t, Place>& places,
                                             const std::vector<std::string>& interfaces) {
  std::set<std::int64_t> buses;
  for (const auto& [unit, place] : places) buses.insert(place.bus);
  if (buses.size() != interfaces.size())
    Complain("units", std::to_string(buses.size()) + " buses, " +
                          std::to_string(interfaces.size()) + " interfaces");
  std::map<std::int64_t, BusNode> out;
  for (const auto& [unit, place] : places) {
    const auto index = std::distance(buses.begin(), buses.find(place.bus));
    if (static_cast<std::size_t>(index) < interfaces.size())
      out[unit] = {interfaces[static_cast<std::size_t>(index)],
                   static_cast<std::uint8_t>(place.node)};
  }
  return out;
}

// ---- the comparison

void CompareMove(const Moved& stored, const OverheardUnit& unit, const OverheardMove& heard) {
  const std::string subject =
      "unit " + std::to_string(stored.unit_id) + " move " + std::to_string(stored.move);
  const auto began = unit.began_at.find(static_cast<std::uint16_t>(stored.move));
  if (heard.confirmed != Answer::kOk) Complain(subject, "started without a confirmed read-back");
  if (heard.confirmed_digest != Digest(heard.staged))
    Complain(subject, "confirmed another move than the segments on the bus");
  if (heard.started_us.empty() || began == unit.began_at.end())
    return Complain(subject, "is in the store, but no start signal reached it armed");
  Pair from{};
  Pair to{};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    from[axis] = began->second[axis].value_or(INT32_MIN);
    to[axis] = from[axis] + heard.Way()[axis];
  }
  if (from != stored.from)
    Complain(subject, "began at " + Text(from) + ", stored " + Text(stored.from));
  if (to != stored.to) Complain(subject, "was sent to " + Text(to) + ", stored " + Text(stored.to));
  if (stored.end != kEndArrived) Complain(subject, "stored end is " + std::to_string(stored.end));
  if (!heard.done) return Complain(subject, "said no `done`");
  const Pair stood{heard.done->position[0], heard.done->position[1]};
  if (heard.done->outcome != Outcome::kArrived) Complain(subject, "`done` says it did not arrive");
  if (stood != to) Complain(subject, "`done` at " + Text(stood) + ", was sent to " + Text(to));
  if (stood != stored.stood)
    Complain(subject, "`done` at " + Text(stood) + ", stored " + Text(stored.stood));
}

using Reported = std::set<std::pair<BusNode, std::uint16_t>>;  // moves that the store has, too

Reported CompareStoreWithBus(const std::vector<Moved>& moves, const BusStory& story,
                             const std::map<std::int64_t, BusNode>& places) {
  Reported reported;
  for (const Moved& stored : moves) {
    const std::string subject = "unit " + std::to_string(stored.unit_id);
    const auto place = places.find(stored.unit_id);
    const auto unit = place == places.end() ? story.units.end() : story.units.find(place->second);
    if (unit == story.units.end()) {
      Complain(subject, "was never heard of on its bus");
      continue;
    }
    if (unit->second.serial.value != stored.serial)
      Complain(subject, "another serial number answered");
    const auto id = static_cast<std::uint16_t>(stored.move);
    const auto heard = unit->second.moves.find(id);
    if (heard == unit->second.moves.end()) {
      Complain(subject, "move " + std::to_string(stored.move) + " was never staged on the bus");
      continue;
    }
    reported.insert({place->second, id});
    CompareMove(stored, unit->second, heard->second);
  }
  return reported;
}

void CompareBusWithStore(const BusStory& story, const Reported& reported) {
  for (const auto& [where, unit] : story.units)
    for (const auto& [id, move] : unit.moves)
      if (!move.started_us.empty() && reported.count({where, id}) == 0)
        Complain(where.first + " node " + std::to_string(where.second),
                 "move " + std::to_string(id) + " was started, and the store does not know it");
}

std::size_t CompareStoredPositions(const char* database, const BusStory& story) {
  const auto stored_positions = ReadStoredPositions(database);
  std::size_t compared = 0;
  for (const auto& [where, unit] : story.units) {
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const auto found =
          stored_positions.find({unit.serial.value, static_cast<std::int64_t>(axis)});
      if (!unit.at[axis]) continue;
      ++compared;
      if (found == stored_positions.end() || found->second.low != *unit.at[axis] ||
          found->second.high != *unit.at[axis])
        Complain(where.first + " node " + std::to_string(where.second),
                 "the store has it elsewhere than it last said on the bus");
    }
  }
  return compared / kAxisCount;
}

int Run(const std::vector<std::string>& arguments) {
  const auto log = ParseCandump(ReadFile(arguments[0].c_str()));
  if (!log) {
    std::printf("%s: %s\n", arguments[0].c_str(), log.error().text.c_str());
    return 1;
  }
  const char* database = arguments[1].c_str();
  const BusStory story = Listen(*log);
  const auto places =
      OnInterfaces(ReadPlaces(arguments[2].c_str()), {arguments.begin() + 3, arguments.end()});
  for (const std::string& malformed : story.malformed) Complain("malformed", malformed);
  if (log->foreign != 0)
    Complain("log", std::to_string(log->foreign) + " frames that are not ours");

  const auto moves = ReadMoves(database);
  const Reported reported = CompareStoreWithBus(moves, story, places);
  CompareBusWithStore(story, reported);
  const std::size_t units_compared = CompareStoredPositions(database, story);
  if (moves.empty()) Complain("store", "no moves at all");
  if (units_compared != places.size())
    Complain("bus", std::to_string(units_compared) + " of " + std::to_string(places.size()) +
                        " units said where they stand");
  for (const auto& [interface, frames] : story.frames)
    std::printf("%s: %llu frames\n", interface.c_str(), static_cast<unsigned long long>(frames));
  std::printf("%zu units, %zu moves in the store, %d disagreements\n", places.size(), moves.size(),
              complaints);
  return complaints == 0 ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int count, char** arguments) {
  if (count < 5) {
    std::fputs("usage: same_moves CANDUMP_LOG DATABASE UNITS_CSV INTERFACE...\n", stderr);
    return 2;
  }
  return focalfleet::Run({arguments + 1, arguments + count});
}
