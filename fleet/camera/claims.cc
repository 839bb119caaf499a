#include "fleet/camera/claims.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

constexpr double kWideShare = 0.05;    // share of blind errors in the wide part
constexpr double kWideVariances = 16;  // variance of the wide part, times that of the narrow one
constexpr double kFarVariances = 200;  // variance of a rare large error, times the expected one

double Density(double squared_sigmas, const CovarianceFp& covariance, double sigma_mm) {
  const double xx = covariance.xx + sigma_mm * sigma_mm;
  const double yy = covariance.yy + sigma_mm * sigma_mm;
  const double root = std::sqrt(xx * yy - covariance.xy * covariance.xy);
  return ((1 - kWideShare) * std::exp(-squared_sigmas / 2) +
          kWideShare / kWideVariances * std::exp(-squared_sigmas / 2 / kWideVariances)) /
         (2 * std::numbers::pi * root);
}

double PatrolAreaMm2(const Unit& unit) {
  const PatrolLimits limits = PatrolOf(unit);
  return std::numbers::pi * (limits.max_mm * limits.max_mm - limits.min_mm * limits.min_mm);
}

CovarianceFp CovarianceOf(double sigma_mm) { return {sigma_mm * sigma_mm, 0, sigma_mm * sigma_mm}; }

}  // namespace

Odds Odds::Of(const Layout& layout, const IdentifyOptions& options) {
  // The area of one unit on a hexagonal lattice; for other plates it is right within a factor.
  const double cell_mm2 = layout.pitch_mm() * layout.pitch_mm() * std::numbers::sqrt3 / 2;
  const double dust = options.shares.dust / cell_mm2;
  return {dust, options.shares.missing * dust};
}

void PlacesOf(const Unit& unit, const UnitExpectation& expectation, const IdentifyOptions& options,
              std::vector<ExpectedPlace>* places) {
  places->clear();
  const CovarianceFp as_before =
      CovarianceOf(std::hypot(expectation.before_sigma_mm, options.still_sigma_mm));
  const double as_reported =
      1 - options.shares.did_not_move - options.shares.strayed - options.shares.missing;
  if (expectation.lost) {
    if (expectation.expected_fp)
      places->push_back({PlaceKind::kExpected, *expectation.expected_fp,
                         CovarianceAt(unit, *expectation.commanded, expectation.blind),
                         options.shares.lost_report_right});
    return;
  }
  if (!expectation.moved) {
    if (expectation.before_fp)
      places->push_back({PlaceKind::kExpected, *expectation.before_fp, as_before, as_reported});
    return;
  }
  if (expectation.before_fp)
    places->push_back(
        {PlaceKind::kBefore, *expectation.before_fp, as_before, options.shares.did_not_move});
  if (!expectation.expected_fp) return;
  const auto at = [&](const AxisAngles& angles) {
    return CovarianceAt(unit, angles, expectation.blind);
  };
  const auto& commanded = expectation.commanded;
  places->push_back({PlaceKind::kExpected, *expectation.expected_fp,
                     commanded ? at(*commanded) : CovarianceOf(expectation.blind.place_sigma_mm),
                     as_reported});
  if (!commanded || !expectation.before) return;
  const AxisAngles only_phi{expectation.before->theta_deg, commanded->phi_deg};
  const AxisAngles only_theta{commanded->theta_deg, expectation.before->phi_deg};
  const double share = options.shares.one_axis_stayed / 2;
  places->push_back({PlaceKind::kThetaStayed, FibreAt(unit, only_phi), at(only_phi), share});
  places->push_back({PlaceKind::kPhiStayed, FibreAt(unit, only_theta), at(only_theta), share});
}

namespace {

// Adds other explanations of a spot where one axis or both may have stayed. The unit may have
// strayed there, or its move ended far from its end by a rare large error. A stay has to be
// likelier than these.
void AddOtherReasons(const ClaimSearch& search, std::uint32_t unit, std::size_t begin,
                     const std::vector<ExpectedPlace>& places, double dark_and_dust,
                     std::vector<Claim>* all) {
  const IdentifyOptions& options = *search.options;
  const std::size_t end = all->size();
  for (std::size_t k = begin; k < end; ++k) {
    const std::uint32_t spot = (*all)[k].spot;
    if ((*all)[k].kind == PlaceKind::kExpected) continue;
    double density = options.shares.strayed / PatrolAreaMm2(search.request->layout->unit({unit}));
    for (const ExpectedPlace& place : places) {
      if (place.kind != PlaceKind::kExpected) continue;
      const CovarianceFp far{place.covariance.xx * kFarVariances,
                             place.covariance.xy * kFarVariances,
                             place.covariance.yy * kFarVariances};
      const double squared = SquaredSigmas(place.at_fp, search.spots->at_fp[spot], far, 0);
      density += options.shares.strayed * Density(squared, far, 0);
    }
    all->push_back({unit, spot, PlaceKind::kAnywhere, std::log(density / dark_and_dust)});
  }
}

}  // namespace

Claims FindClaims(const ClaimSearch& search) {
  const Layout& layout = *search.request->layout;
  const IdentifyOptions& options = *search.options;
  const Odds odds = Odds::Of(layout, options);
  Claims claims;
  std::vector<char> claimed(search.spots->at_fp.size(), 0);
  std::vector<ExpectedPlace> places;
  double map_sigma_mm_max = 0;
  for (const double sigma : search.spots->sigma_mm)
    map_sigma_mm_max = std::max(map_sigma_mm_max, sigma);
  const double far_mm2 =
      map_sigma_mm_max * map_sigma_mm_max + options.centroid_sigma_mm * options.centroid_sigma_mm;
  for (std::uint32_t i = 0; i < layout.size(); ++i) {
    PlacesOf(layout.unit({i}), search.request->expectations[i], options, &places);
    const std::size_t before = claims.all.size();
    for (const ExpectedPlace& place : places) {
      const double radius_mm =
          std::sqrt(options.gate_squared_sigmas * (LargestVariance(place.covariance) + far_mm2));
      search.grid->ForNear(place.at_fp, radius_mm, [&](std::uint32_t spot, double) {
        if (search.spots->is_fiducial[spot]) return;
        const double sigma_mm = std::hypot(options.centroid_sigma_mm, search.spots->sigma_mm[spot]);
        const double squared =
            SquaredSigmas(place.at_fp, search.spots->at_fp[spot], place.covariance, sigma_mm);
        if (squared > options.gate_squared_sigmas) return;
        claims.all.push_back({i, spot, place.kind,
                              std::log(place.share * Density(squared, place.covariance, sigma_mm) /
                                       odds.dark_and_dust)});
        claimed[spot] = 1;
      });
    }
    // A lost unit is no evidence for or against the expected field.
    if (places.empty() || search.request->expectations[i].lost) continue;
    AddOtherReasons(search, i, before, places, odds.dark_and_dust, &claims.all);
    ++claims.units;
    if (claims.all.size() > before) ++claims.recognised;
  }
  for (std::size_t spot = 0; spot < claimed.size(); ++spot)
    if (claimed[spot] == 0 && !search.spots->is_fiducial[spot]) ++claims.stray_spots;
  return claims;
}

namespace {

/// True: some pose of the unit within its box puts the fibre there.
bool IsWithin(const Unit& unit, PointFp at_fp, const UnitExpectation& expectation) {
  if (!expectation.within) return true;
  const auto inside = InReach(unit, at_fp, kStraySlackMm);
  if (!inside) return false;
  const std::vector<AxisAngles> poses = AnglesFor(unit, *inside);
  return std::ranges::any_of(
      poses, [&](const AxisAngles& angles) { return expectation.within->Holds(angles); });
}

}  // namespace

std::vector<Claim> FindStrays(const ClaimSearch& search, std::span<const std::uint32_t> units,
                              std::span<const char> is_free) {
  const Layout& layout = *search.request->layout;
  const Odds odds = Odds::Of(layout, *search.options);
  std::vector<Claim> strays;
  for (const std::uint32_t i : units) {
    const Unit& unit = layout.unit({i});
    const UnitExpectation& expectation = search.request->expectations[i];
    // A unit without a place is somewhere: where it reports, or anywhere.
    const double share = !expectation.lost          ? search.options->shares.strayed
                         : !expectation.expected_fp ? 1
                                                    : 1 - search.options->shares.lost_report_right;
    const double log_odds = std::log(share / PatrolAreaMm2(unit) / odds.dark_and_dust);
    const double reach_mm = PatrolOf(unit).max_mm + kStraySlackMm;
    search.grid->ForNear(unit.base_fp, reach_mm, [&](std::uint32_t spot, double) {
      if (is_free[spot] != 0 && InPatrol(unit, search.spots->at_fp[spot], kStraySlackMm) &&
          IsWithin(unit, search.spots->at_fp[spot], expectation))
        strays.push_back({i, spot, PlaceKind::kAnywhere, log_odds});
    });
  }
  return strays;
}

std::optional<PointFp> InReach(const Unit& unit, PointFp at_fp, double slack_mm) {
  const double distance_mm = DistanceMm(unit.base_fp, at_fp);
  const PatrolLimits limits = PatrolOf(unit);
  if (distance_mm < limits.min_mm - slack_mm || distance_mm > limits.max_mm + slack_mm)
    return std::nullopt;
  const double inside_mm = std::clamp(distance_mm, limits.min_mm, limits.max_mm);
  if (inside_mm == distance_mm || distance_mm == 0) return at_fp;
  const double scale = inside_mm / distance_mm;
  return PointFp{unit.base_fp.x_mm + (at_fp.x_mm - unit.base_fp.x_mm) * scale,
                 unit.base_fp.y_mm + (at_fp.y_mm - unit.base_fp.y_mm) * scale};
}

bool InPatrol(const Unit& unit, PointFp at_fp, double slack_mm) {
  const auto inside = InReach(unit, at_fp, slack_mm);
  if (!inside) return false;
  // A theta that goes all round excludes no direction.
  if (unit.theta().max_deg - unit.theta().min_deg >= 360) return true;
  if (DistanceMm(unit.base_fp, at_fp) <= slack_mm) return true;
  return !AnglesFor(unit, *inside).empty();
}

}  // namespace focalfleet
