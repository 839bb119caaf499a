// The order in which the moves of a table were made (docs/files.md): of one unit by `t_s` where it
// is given, else by `move_id`. Rows may stand in any order, as those out of a database do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace focalfleet {

/// A row of moves.csv, as far as its place in time goes.
struct MoveKey {
  std::size_t unit = 0;
  std::int64_t move = 0;
  double t_s = 0;  // NaN: not given
};

struct MoveOrder {
  std::vector<std::size_t> rows;  // by unit, and of one unit as its moves were made
  std::size_t out_of_order = 0;   // rows that stand behind a later move of their unit
};

/// A row without a time has that of its exposure, if another row tells it, else that of the unit's
/// move before it by number. Equal times: by number. Pre: a unit has a move once.
MoveOrder OrderMoves(std::vector<MoveKey> keys);

}  // namespace focalfleet
