// A campaign: what was commanded, what was measured, and under which conditions, with what the
// model believes of each unit's geometry. Plain values; the tables of docs/files.md are read and
// written by daemon/campaign/.
//
// Rows are sorted by unit (in the order of `units`), and stand within a unit in the order in which
// its moves were made: unit u owns the rows first_row[u] .. first_row[u + 1]. Everything is
// structure-of-arrays. A missing value is NaN, in the fibre's place as in a covariate. 5000 units
// x 250 moves x 25 columns are 250 MB.
#pragma once

#include <cstddef>
#include <cstdint>
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
  std::uint32_t serial = 0;  // of the hardware that made the moves; 0: the table does not say
  double base_x_mm = 0;
  double base_y_mm = 0;
  double arm_mm[2] = {0, 0};
  double zero_deg[2] = {0, 0};
  double gear[2] = {0, 0};  // motor revolutions per output revolution
  double min_deg[2] = {0, 0};
  double max_deg[2] = {0, 0};
  // NaN: the table does not say.
  double rail = 0;
  double rail_slot = 0;
  double bus = 0;
  double bus_slot = 0;
  bool enabled = true;
};

/// A column of numbers beside the moves, by the name under which reports call it.
struct Covariate {
  std::string name;
  std::vector<double> values;  // Shape: (rows)
};

/// A column of words (`mode`): per row an index into `words`, or -1 where it is missing.
struct WordColumn {
  std::string name;
  std::vector<std::string> words;
  std::vector<int> values;  // Shape: (rows)
};

struct Campaign {
  std::string name;
  std::vector<CampaignUnit> units;
  std::vector<std::size_t> first_row;  // Shape: (units + 1)
  std::vector<std::int64_t> move_id;   // Shape: (rows), and so all below
  std::vector<double> from_deg[2];     // where the coordinator believed the axis stood
  std::vector<double> cmd_deg[2];      // where it was told to go
  std::vector<double> x_mm;            // measured after the move; NaN: not seen
  std::vector<double> y_mm;
  std::vector<Covariate> covariates;
  std::vector<WordColumn> word_columns;

  [[nodiscard]] std::size_t rows() const { return move_id.size(); }
  /// None: empty.
  [[nodiscard]] std::span<const double> Find(std::string_view covariate) const;
};

/// Rows of one exposure, that is, with one move_id.
struct Exposures {
  std::vector<std::int64_t> move_id;  // ascending by first appearance in the campaign
  std::vector<std::uint32_t> of_row;  // Shape: (rows)
  [[nodiscard]] std::size_t size() const { return move_id.size(); }
};
Exposures FindExposures(const Campaign& campaign);

/// The shapes fit, angles and arms are finite, a unit stands once and has one row a move.
/// Errors: kInvalid, names unit and move.
Status Validate(const Campaign& campaign);

/// Units with their rows, in the order given; for leaving units or moves out.
/// Pre: keep_row.size() == rows. Units without a row left stay, with none.
Campaign Keep(const Campaign& campaign, const std::vector<bool>& keep_row);

/// Where the believed geometry puts the fibre. docs/files.md, "Kinematics".
struct PlacePoint {
  double x_mm = 0;
  double y_mm = 0;
};
PlacePoint PlaceOf(const CampaignUnit& unit, double theta_deg, double phi_deg);

}  // namespace focalfleet::sim
