// What paper 1 says, and what comes out when it is simulated. A claim holds the paper's numbers as
// they are printed and the simulation's as they came; the status follows from comparing them, so a
// motor with other parameters gets other statuses.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace focalfleet::sim {

enum class ClaimStatus : std::uint8_t {
  kReproduced,   // every number within the claim's tolerance, without tuning on it
  kOrdering,     // only the order of the numbers
  kFitted,       // a parameter was set so that it comes out; the conditions name it
  kDisagrees,    // both numbers stand; the reason is the likely one
  kNotTestable,  // an input, or a sentence without a consequence
};
const char* Name(ClaimStatus status);

struct Claim {
  std::string id;
  std::string text;
  std::vector<double> paper;  // as printed; empty: an order, or nothing to compare with
  std::vector<double> simulated;
  std::string unit;
  std::string conditions;
  ClaimStatus status = ClaimStatus::kNotTestable;
  std::string reason;  // of a disagreement or a fit; else empty
};

/// Points of a plot that belongs to claims.
struct ClaimCurve {
  std::string figure;  // curves of one figure share axes
  std::string name;
  std::vector<double> x;
  std::vector<double> y;
};

struct Reproduction {
  std::vector<Claim> claims;
  std::vector<ClaimCurve> curves;
};

}  // namespace focalfleet::sim
