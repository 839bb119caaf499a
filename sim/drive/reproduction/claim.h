// A claim of paper 1, and the result when it is simulated. A claim holds the paper's numbers as
// printed and the simulation's as computed. The status follows from comparing them, so a motor with
// other parameters gets other statuses.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace focalfleet::sim {

enum class ClaimStatus : std::uint8_t {
  kReproduced,   // every number within the claim's tolerance, without tuning on it
  kOrdering,     // only the order of the numbers agrees
  kFitted,       // a parameter was fitted to this number; the conditions name it
  kDisagrees,    // both numbers are given; the reason is the likely one
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

/// The points of a plot that belongs to claims.
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
