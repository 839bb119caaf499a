// The claims of each unit on the spots near it, and their odds. Against "the unit is dark and the
// spot is dust", a spot at d from a place with covariance S has the odds
//
//   share * n(d) / (missing share * dust per mm^2),   n = 0.95 N(0, S) + 0.05 N(0, 16 S)
//
// The wide part is there because real blind errors have tails.
#pragma once

#include <optional>
#include <vector>

#include "fleet/camera/identify.h"
#include "fleet/camera/mapping.h"

namespace focalfleet {

struct ClaimSearch {
  const IdentificationRequest* request = nullptr;
  const IdentifyOptions* options = nullptr;
  const MappedSpots* spots = nullptr;
  const SpotGrid* grid = nullptr;  // over spots->at_fp
};

/// Shares and densities that turn into odds.
struct Odds {
  double dust_per_mm2 = 0;
  double dark_and_dust = 0;  // missing share * dust_per_mm2
  static Odds Of(const Layout& layout, const IdentifyOptions& options);
};

struct Claims {
  std::vector<Claim> all;         // sorted by unit
  std::uint32_t units = 0;        // units with a place where they would be
  std::uint32_t recognised = 0;   // of these: with a spot there
  std::uint32_t stray_spots = 0;  // spots that are neither fiducials nor claimed
};

/// The claims of all units on the free spots near them. Cost: O(n).
Claims FindClaims(const ClaimSearch& search);

/// A place where the unit would be now for one reason, with the covariance. A unit that does not
/// move has one such place.
struct ExpectedPlace {
  PlaceKind kind = PlaceKind::kExpected;
  PointFp at_fp;
  CovarianceFp covariance;
  double share = 0;
};
void PlacesOf(const Unit& unit, const UnitExpectation& expectation, const IdentifyOptions& options,
              std::vector<ExpectedPlace>* places);

/// Claims of `units` on free spots anywhere in their patrol area, evenly over it.
std::vector<Claim> FindStrays(const ClaimSearch& search, std::span<const std::uint32_t> units,
                              std::span<const char> is_free);

inline constexpr double kStraySlackMm = 0.1;  // arms and air
/// The point itself, or the nearest one on the rim of the patrol area where the point is beyond the
/// rim by at most `slack_mm`. Empty: farther out.
std::optional<PointFp> InReach(const Unit& unit, PointFp at_fp, double slack_mm);
/// True: the unit's arms lead to the point, or within `slack_mm` of it, within the ranges of both
/// axes.
bool InPatrol(const Unit& unit, PointFp at_fp, double slack_mm);

}  // namespace focalfleet
