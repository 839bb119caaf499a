// CAMPAIGN.csv lists the moves that a campaign is to make: `move_id, unit_id, theta_deg, phi_deg`,
// one row for each unit that is sent. Moves are made in the order of their numbers. A unit that a
// move does not name stays where it is.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/layout.h"
#include "fleet/targets.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct ListedMove {
  std::int64_t id = 0;
  std::vector<TargetRow> rows;
};

struct MoveList {
  std::vector<ListedMove> moves;             // ascending by id
  std::vector<std::string> ignored_columns;  // not known
};
/// The list in `text`.
/// Errors: kInvalid with file:line: a column is missing or there is nothing to do; of all rows: a
/// value is missing, a unit stands twice in one move, or the layout does not have the unit.
Result<MoveList> ReadMoveList(std::string_view text, std::string file, const Layout& layout);
std::string WriteMoveList(const std::vector<ListedMove>& moves);

enum class CampaignKind : std::uint8_t {
  kSurvey,      // random configurations, as in a night
  kArcs,        // one axis after the other over its range and back, all units in parallel
  kDiagnostic,  // arcs, a ladder of reversals on each axis, shares of units, repeats
};
inline constexpr const char* kCampaignKindNames[] = {"survey", "arcs", "diagnostic"};

struct MakeMovesOptions {
  CampaignKind kind = CampaignKind::kDiagnostic;
  std::size_t moves = 24;
  std::uint64_t seed = 1;
};
/// A list of moves. In arcs and ladders all units stand alike, as translated copies of each other,
/// so no unit comes near another. Each unit is kept within the ranges of its own axes.
/// Errors: as DrawConfiguration's.
Result<std::vector<ListedMove>> MakeMoves(const Layout& layout,
                                          const std::vector<UnitDrive>& drives,
                                          const MakeMovesOptions& options);

}  // namespace focalfleet
