// A campaign holds what was commanded, what was measured, under which conditions, and what the
// model believes of each unit's geometry. Its tables (docs/files.md) are read and written by
// daemon/campaign/.
//
// Rows are sorted by unit, in the order of `units`, and within a unit in the order in which its
// moves were made. Unit u owns the rows first_row[u] .. first_row[u + 1]. Everything is
// structure-of-arrays. A missing value is NaN, in the fibre's place as in a covariate. 5000 units x
// 250 moves x 25 columns are 250 MB.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet::sim {

/// An axis of a unit, as an index into pairs.
enum CampaignAxis : std::size_t { kTheta = 0, kPhi = 1 };

struct CampaignUnit {
  std::uint32_t id = 0;
  std::uint32_t serial = 0;  // hardware that made the moves; 0: not in the table
  double base_x_mm = 0;
  double base_y_mm = 0;
  double arm_mm[2] = {0, 0};
  double zero_deg[2] = {0, 0};
  double gear[2] = {0, 0};  // motor revolutions per output revolution
  double min_deg[2] = {0, 0};
  double max_deg[2] = {0, 0};
  // NaN where the table has no value.
  double rail = 0;
  double rail_slot = 0;
  double bus = 0;
  double bus_slot = 0;
  bool enabled = true;
};

/// A column of numbers beside the moves, by the name that reports use.
struct Covariate {
  std::string name;
  std::vector<double> values;  // Shape: (rows)
};

/// The kinds of space vector modulation that the column `mode` names.
inline constexpr std::array<std::string_view, 3> kDriveModes = {"asymmetric", "five_segment",
                                                                "seven_segment"};

/// A column of words (`mode`): each row has an index into `words`, or -1 where the word is missing.
struct WordColumn {
  std::string name;
  std::vector<std::string> words;
  std::vector<int> values;  // Shape: (rows)
};

struct Campaign {
  std::string name;
  std::vector<CampaignUnit> units;
  // The geometry by which the coordinator turned measured places into angles. Shape: (units), or
  // empty where it is that of `units`.
  std::vector<CampaignUnit> coordinator_units;
  std::vector<std::size_t> first_row;  // Shape: (units + 1)
  std::vector<std::int64_t> move_id;   // Shape: (rows), and so all below
  std::vector<double> from_deg[2];     // where the coordinator believed the axis to be
  std::vector<double> cmd_deg[2];      // where the axis was commanded to go
  std::vector<double> x_mm;            // measured after the move; NaN: not seen
  std::vector<double> y_mm;
  // The steps of x and y as measured, where places have been turned since (place_steps.h).
  std::optional<std::array<double, 2>> steps_mm;
  std::vector<Covariate> covariates;
  std::vector<WordColumn> word_columns;

  [[nodiscard]] std::size_t rows() const { return move_id.size(); }
  /// The values of the covariate, or an empty span where the campaign has no such column.
  [[nodiscard]] std::span<const double> Find(std::string_view covariate) const;
};

/// The rows of one exposure are those with one move_id.
struct Exposures {
  std::vector<std::int64_t> move_id;  // in the order of first appearance in the campaign
  std::vector<std::uint32_t> of_row;  // Shape: (rows)
  [[nodiscard]] std::size_t size() const { return move_id.size(); }
};
Exposures FindExposures(const Campaign& campaign);

/// A campaign is valid where its shapes fit, its angles and arms are finite, and each unit is
/// listed once with one row a move.
/// Errors: kInvalid, names unit and move.
Status Validate(const Campaign& campaign);

/// All units with the rows that are kept, in the order given. A unit without a kept row stays, with
/// no rows.
/// Pre: keep_row.size() == rows.
Campaign Keep(const Campaign& campaign, const std::vector<bool>& keep_row);

/// The place of the fibre by the believed geometry; the formula is in docs/files.md, "Kinematics".
struct PlacePoint {
  double x_mm = 0;
  double y_mm = 0;
};
PlacePoint PlaceOf(const CampaignUnit& unit, double theta_deg, double phi_deg);

}  // namespace focalfleet::sim
