// Who has which spot, where more than one answer is possible. A claim says how likely a spot is a
// unit's against the plainest story: the unit is dark and the spot is dust. Claims that share a
// unit or a spot hang together; what hangs together is small (a unit, a spot; rarely three or
// four), so every assignment of it is counted with its weight and the sums are the exact
// probabilities of each answer. What is not nearly certain is left undecided.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace focalfleet {

inline constexpr std::uint32_t kNoSpot = UINT32_MAX;

/// Why a unit would be there.
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
  double doubt = 0;        // probability that the spot is another (or none)
  double kind_doubt = 0;   // given the spot, that the reason is another
  bool too_large = false;  // too many answers to be counted; spot and doubt mean nothing
};

/// One decision for each unit that claims, ascending by unit. No spot is given twice, unless one of
/// the two answers has a doubt of at least a half.
/// Cost: O(claims log claims) for pairs; at most 2e4 assignments are counted for what hangs
/// together.
std::vector<Decision> Assign(std::vector<Claim> claims);

}  // namespace focalfleet
