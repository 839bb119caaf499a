// Closed loop: before each move the camera saw where the fibre stood, and the coordinator began
// from there. The beginning has in it already all that an effect did up to then. The effect
// therefore enters as the difference of its error after the move and its error as the move began.
//
// Both errors are of one track that has each move's beginning as a move of no length before it,
// with the conditions of the exposure in which it was seen. An effect runs along that track as
// along any other. A shift of places or arms misleads the coordinator as the move begins: the
// coordinator turns the axes by the angles that such a shift looks like.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "sim/campaigns/effects/track.h"

namespace focalfleet::sim {

struct PoseErrors;

/// The track of moves and their beginnings: move k is its move 2k + 1, and begins at 2k.
struct BegunTrack {
  UnitTrack track;
  std::vector<double> cmd_deg[2], from_deg[2], step_deg[2];
  std::vector<char> restarts;
  std::vector<std::size_t> row;
  // The angles by which each move began elsewhere than the coordinator believed, who inferred them
  // by the geometry of units.csv. Shape: (moves); 0 where the loop was open.
  std::array<std::vector<double>, 2> begin_error_deg;
  mutable std::map<std::string, std::vector<double>, std::less<>> columns;  // as they are asked for
};

std::shared_ptr<const BegunTrack> MakeBegunTrack(const UnitTrack& track);

/// Adds errors after the moves less those as they began. Shapes: along (2 moves), errors (moves).
/// Moves whose loop was open have the error after the move alone.
void AddDifferences(const UnitTrack& track, const PoseErrors& along, PoseErrors* errors);

/// The angles that a shift of the fibre looks like, degrees. Elbow: to the base; reach: to the
/// elbow. Near a stretched or folded arm the least angles that come near it.
std::array<double, 2> AnglesOfShift(double elbow_x_mm, double elbow_y_mm, double reach_x_mm,
                                    double reach_y_mm, double shift_x_mm, double shift_y_mm);

}  // namespace focalfleet::sim
