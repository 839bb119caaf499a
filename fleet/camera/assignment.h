// The assignment of spots to units where more than one answer is possible. The claim of a unit on a
// spot has odds against the plainest explanation: the unit is dark and the spot is dust. Claims
// that share a unit or a spot form a group. Groups are small (a unit, a spot; rarely three or
// four) but where many units are lost. Every assignment of a group is therefore counted with its
// weight, and the sums are the exact probabilities of each answer. An answer that is not nearly
// certain is left undecided.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace focalfleet {

inline constexpr std::uint32_t kNoSpot = UINT32_MAX;

/// The reason why a unit would be at a place.
enum class PlaceKind : std::uint8_t {
  kExpected,     // where its move ends
  kBefore,       // where it was: neither axis moved
  kThetaStayed,  // phi has moved, theta has not
  kPhiStayed,    // theta has moved, phi has not
  kAnywhere,     // somewhere in its patrol area
};

struct Claim {
  std::uint32_t unit = 0;
  std::uint32_t spot = 0;
  PlaceKind kind = PlaceKind::kExpected;
  double log_odds = 0;  // against: unit dark and spot dust
};

struct Decision {
  std::uint32_t unit = 0;
  std::uint32_t spot = kNoSpot;  // the likeliest answer; kNoSpot: none of them
  PlaceKind kind = PlaceKind::kExpected;
  double doubt = 0;        // probability that the right answer is another spot (or none)
  double kind_doubt = 0;   // given the spot, probability that the reason is another
  bool too_large = false;  // too many answers to count; spot and doubts mean nothing
};

/// The decisions, one for each unit that has a claim, ascending by unit. No spot is assigned twice,
/// unless one of the two answers has a doubt of at least a half. Cost: O(claims log claims) for
/// pairs; at most 2e4 assignments are counted for one group.
std::vector<Decision> Assign(std::vector<Claim> claims);

}  // namespace focalfleet
