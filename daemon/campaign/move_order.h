// OrderMoves gives the order in which the moves of a table were made (docs/files.md). The moves of
// one unit are ordered by `t_s` where it is given, else by `move_id`. Rows may stand in any order,
// as rows from a database do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace focalfleet {

/// The part of a row of moves.csv that decides its place in time.
struct MoveKey {
  std::size_t unit = 0;
  std::int64_t move = 0;
  double t_s = 0;  // NaN: not given
};

struct MoveOrder {
  std::vector<std::size_t> rows;  // by unit; the rows of one unit in the order of its moves
  std::size_t out_of_order = 0;   // rows that stand behind a later move of their unit
};

/// The order of `keys`. A row without a time takes the time of its exposure, if another row gives
/// it, else that of the unit's previous move by number. Equal times are ordered by number.
/// Pre: a unit has each move at most once.
MoveOrder OrderMoves(std::vector<MoveKey> keys);

}  // namespace focalfleet
