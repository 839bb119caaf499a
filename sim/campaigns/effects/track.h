// Effects read two things. A UnitTrack is the moves of one unit in their order, with the conditions
// of each. CampaignFacts are the same for the whole campaign. Both are made once from a campaign. A
// track reads the facts' columns without copies.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"
#include "sim/campaigns/campaign/frames.h"

namespace focalfleet::sim {

/// A covariate without gaps. A missing value is that of the exposure's other units where they
/// agree. Else it lies between the unit's own values before and after, and without those it is the
/// median.
struct FilledColumn {
  std::vector<double> values;  // Shape: (rows)
  std::vector<float> rank;     // Shape: (rows): share of the rows below, 0..1
  double low = 0;
  double high = 0;
  double mean = 0;
  double first = 0;
  double missing_share = 0;
  [[nodiscard]] bool varies() const { return high > low; }
};

/// Names of computed columns, which no table has.
inline constexpr std::string_view kCommand[] = {"theta_cmd_deg", "phi_cmd_deg"};
inline constexpr std::string_view kFrom[] = {"theta_from_deg", "phi_from_deg"};
inline constexpr std::string_view kStep[] = {"theta step", "phi step"};
inline constexpr std::string_view kOrder = "move order";
inline constexpr std::string_view kGradientX = "temperature gradient x";
inline constexpr std::string_view kGradientY = "temperature gradient y";
inline constexpr std::string_view kRailMotors = "motors in motion on the rail";  // harness.h
inline constexpr std::string_view kSharedMotors = "motors behind shared harness";
inline constexpr std::string_view kNeighbourTheta = "neighbours' theta motors";
inline constexpr std::string_view kNeighbourPhi = "neighbours' phi motors";
inline constexpr std::string_view kMode = "mode";  // indices of kDriveModes (campaign.h)
// The column exists only where arms come near each other (arm_gap.h).
inline constexpr std::string_view kArmGap = "gap to the next arm";
inline constexpr std::string_view kArmGapSide = "side of the next arm";
inline constexpr double kThickestArm = 0.3;  // of the pitch
/// Least share of the nominal drive that is divided by, so that a column with zeros in it is no
/// division by zero. Planted campaigns drive with 0.6 and more: half and double of it change
/// nothing there.
inline constexpr double kDriveLeast = 0.05;

struct CampaignFacts {
  const Campaign* campaign = nullptr;
  Exposures exposures;
  Frames frames;
  std::map<std::string, FilledColumn, std::less<>> columns;
  std::vector<char> restarts;  // Shape: (rows): the unit's history begins anew here
  // Shape: (rows), or empty where no row is: the loop was closed before the move (closed_loop.h).
  std::vector<char> closed;
  std::vector<double> step_deg[2];  // Shape: (rows): as commanded, wraps of whole turns undone
  // Shape: (units): indices of the first few units within 1.3 pitches; none for units without rows.
  std::vector<std::vector<std::size_t>> neighbours;
  // Where rotors stand at motor angles of 0, deg, by unit_id, as the pull of their neighbours shows
  // it (diagnosis/rotor_phases.h). Empty where that is not known.
  std::map<std::uint32_t, double> rotor_phase_deg[2];
  double radius_mm = 0;     // of the plate: farthest base from the frame's origin; at least 1
  double pitch_mm = 0;      // median distance to the nearest base; 0 with one unit
  std::size_t homings = 0;  // restarts that are not a unit's first row

  [[nodiscard]] const FilledColumn* Find(std::string_view name) const;
  [[nodiscard]] bool Has(std::string_view name) const { return Find(name) != nullptr; }
};

/// The motors of two units near each other in one exposure.
struct PullingPair {
  std::size_t row = 0;   // of the unit
  double angle_rad = 0;  // its motor's angle less the neighbour's, as commanded
  double nearness = 0;   // (pitch / distance)^3
};
/// All moves of the unit that the neighbour was seen with.
std::vector<PullingPair> PullOf(const CampaignFacts& facts, std::size_t unit, std::size_t neighbour,
                                std::size_t axis);

/// Pre: the campaign is valid and outlives the facts.
CampaignFacts MakeFacts(const Campaign& campaign);

struct BegunTrack;

struct UnitTrack {
  const CampaignFacts* facts = nullptr;
  const CampaignUnit* unit = nullptr;  // with the geometry in use
  std::size_t unit_index = 0;          // in the campaign
  std::size_t first_row = 0;
  std::size_t moves = 0;
  std::span<const double> cmd_deg[2];
  std::span<const double> from_deg[2];
  std::span<const double> step_deg[2];
  std::span<const char> restarts;
  // Positions relative to the base at the commanded pose, or at the pose that TurnPoses sets: the
  // elbow, and the fibre relative to the elbow.
  std::vector<double> elbow_x_mm, elbow_y_mm, reach_x_mm, reach_y_mm;
  std::vector<double> fibre_x_mm, fibre_y_mm;  // on the plate

  /// The same moves with their beginnings. nullptr where no loop was closed (closed_loop.h).
  std::shared_ptr<const BegunTrack> beginnings;
  /// Set in the track of beginnings alone.
  BegunTrack* of_beginnings = nullptr;

  /// The campaign's row of a move; of a beginning the row of the exposure that it was seen in.
  [[nodiscard]] std::size_t RowOf(std::size_t move) const;
  /// Whether the move is a beginning: nothing happens between the exposure before and it.
  [[nodiscard]] bool IsBeginning(std::size_t move) const;
  /// Values of a column for this unit's moves. Pre: facts->Has(name).
  [[nodiscard]] std::span<const double> Column(std::string_view name) const;
};

/// The index after the last move of the history (from homing to homing) that `move` belongs to.
std::size_t EndOfHistory(const UnitTrack& track, std::size_t move);

/// The index after the last move that a step of the count in `move` changes: a homing undoes it,
/// and a loop that is closed begins where it has brought the axis.
std::size_t EndOfStep(const UnitTrack& track, std::size_t move);

/// `geometry` is the unit with the geometry to use; its arrays are read as long as the track lives.
UnitTrack MakeTrack(const CampaignFacts& facts, std::size_t unit, const CampaignUnit& geometry);

/// Sets the poses to those commanded.
void TakePoses(UnitTrack* track);

/// Sets the poses of axes that are off their commanded angles by these. Shapes: (moves).
void TurnPoses(const std::span<const double> (&off_deg)[2], UnitTrack* track);

}  // namespace focalfleet::sim
