// The ways in which one unit may go from its start to its target. Both axes move at once or one
// after the other, sooner or later. The arm is folded back on the way as far as that helps.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "fleet/plan/path_search.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/track.h"
#include "protocol/base/limits.h"

namespace focalfleet {

/// A segment cannot begin later: its offset has 24 bits of 100 us.
inline constexpr double kOffsetMaxS = limits::kOffsetTicksMax * 1e-4;

struct Candidate {
  AxisPaths path;
  double end_s = 0;
};

/// Shape and which delays, as positions in the order in which they are tried.
enum class Shape : std::uint8_t {
  kStraight,
  kFolding,  // with the arm folded back on the way
  kSliding,  // folded back along itself: theta turns with phi so that the arm keeps its direction,
             // which gets it out of (or into) a place where it is hooked with another
};
struct CandidateRound {
  Shape shape = Shape::kStraight;
  std::size_t first = 0;
  std::size_t last = 0;
};
/// The order of trial: going straight comes first, folding back helps most often, waiting
/// sometimes.
inline constexpr std::array kCandidateRounds{
    CandidateRound{Shape::kStraight, 0, 2}, CandidateRound{Shape::kFolding, 0, 2},
    CandidateRound{Shape::kSliding, 0, 1},  CandidateRound{Shape::kStraight, 2, 13},
    CandidateRound{Shape::kFolding, 2, 7},  CandidateRound{Shape::kSliding, 2, 3}};

struct CandidateQuestion {
  const Scene* scene = nullptr;
  const UnitDrive* drive = nullptr;
  std::uint32_t unit = 0;
  Pose from{};
  Pose to{};
  double within_s = 0;  // the way ends by then where it can
  CandidateRound round;
};

/// Appends the candidates of the question's round: straight ones first, sooner before later.
void AppendCandidates(const CandidateQuestion& question, std::vector<Candidate>* candidates);

/// Appends candidates leg after leg along a way that was found elsewhere, sooner or later.
void AppendAlong(const CandidateQuestion& question, const Way& way,
                 std::vector<Candidate>* candidates);

/// Appends candidates along `in` into the unit's own cell, across the cell to the end of `out`, and
/// along `out` backwards to the target. The arm folds before or after it crosses the cell, for as
/// long as there is time to spare.
void AppendVia(const CandidateQuestion& question, const Way& in, const Way& out,
               std::vector<Candidate>* candidates);

/// Both axes at once, without delay.
Candidate Straight(const UnitDrive& drive, const Pose& from, const Pose& to);
/// A straight candidate whose axes begin later. Units: s. Shape: (axes).
Candidate Delayed(const UnitDrive& drive, const Candidate& straight,
                  const std::array<double, kAxisCount>& begin_s);

}  // namespace focalfleet
