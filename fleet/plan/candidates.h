// The ways in which one unit may go from its start to its target: both axes at once or one after
// the other, sooner or later, with the arm folded back on the way as far as it helps.
#pragma once

#include <array>
#include <vector>

#include "fleet/plan/scene.h"
#include "fleet/plan/track.h"

namespace focalfleet {

struct Candidate {
  AxisPaths path;
  double end_s = 0;
};

/// Which delays, as positions in the order in which they are tried.
struct CandidateRound {
  bool folding = false;  // with the arm folded back on the way
  std::size_t first = 0;
  std::size_t last = 0;
};
/// Going straight comes first, folding back helps most often, waiting sometimes.
inline constexpr std::array kCandidateRounds{
    CandidateRound{false, 0, 2}, CandidateRound{true, 0, 2}, CandidateRound{false, 2, 13},
    CandidateRound{true, 2, 7}};

struct CandidateQuestion {
  const Scene* scene = nullptr;
  const UnitDrive* drive = nullptr;
  std::uint32_t unit = 0;
  Pose from{};
  Pose to{};
  double within_s = 0;  // ends by then where it can
  CandidateRound round;
};

/// Straight ones first, sooner before later.
void AppendCandidates(const CandidateQuestion& question, std::vector<Candidate>* candidates);

/// Both axes at once, without delay.
Candidate Straight(const UnitDrive& drive, const Pose& from, const Pose& to);

}  // namespace focalfleet
