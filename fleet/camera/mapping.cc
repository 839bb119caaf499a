#include "fleet/camera/mapping.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

namespace focalfleet {
namespace {

using Complex = std::complex<double>;

constexpr double kMappingCellMm = 12;
constexpr std::size_t kLightsMax = 400;  // the map's cost grows with the square
/// A spot farther away is not the light of a unit that stands still.
constexpr double kStillSigmas = 6;
/// Fiducials beyond the terms of the polynomial that show the air by themselves.
constexpr std::size_t kFreedomMin = 40;

std::vector<PointFp> SeenBy(const CameraModel& camera, std::span<const Spot> spots,
                            Orientation orientation) {
  const Complex turn = std::polar(1.0, orientation.quarters * std::numbers::pi / 2);
  std::vector<PointFp> seen;
  seen.reserve(spots.size());
  for (const Spot& spot : spots) {
    const PointFp p = PlateOf(camera, spot.x_px, spot.y_px);
    Complex w = Complex(p.x_mm, p.y_mm) * turn;
    if (orientation.mirrored) w = std::conj(w);
    seen.push_back({w.real(), w.imag()});
  }
  return seen;
}

class Mapping {
 public:
  Mapping(const IdentificationRequest& request, const IdentifyOptions& options,
          Identification* result)
      : request_(request), options_(options), map_options_(options.map), result_(*result) {
    map_options_.radius_mm = 1;
    for (const Fiducial& f : request.fiducials)
      map_options_.radius_mm =
          std::max(map_options_.radius_mm, std::hypot(f.at_fp.x_mm, f.at_fp.y_mm));
  }

  tl::expected<MappedSpots, Refusal> Run(Orientation orientation) {
    seen_ = SeenBy(*request_.camera, request_.exposure->spots, orientation);
    const SpotGrid grid(seen_, kMappingCellMm);
    const auto alignment = FindFiducials(request_.fiducials, seen_, grid, options_.bounds);
    if (!alignment)
      return tl::unexpected<Refusal>(
          {RefusalReason::kFewFiducials, "fewer than half of the " +
                                             std::to_string(request_.fiducials.size()) +
                                             " fiducials are near where they should be"});
    if (auto refusal = OutOfBounds(*alignment, options_.bounds))
      return tl::unexpected<Refusal>(std::move(*refusal));
    Align(*alignment);
    const auto fit = FitPolynomial(lights_, map_options_);
    if (auto refusal = Rough(fit ? &*fit : nullptr))
      return tl::unexpected<Refusal>(std::move(*refusal));
    DescribeCamera(*alignment, *fit);
    std::vector<KnownLight> used;
    for (std::size_t k = 0; k < lights_.size(); ++k)
      if (fit->used[k]) used.push_back(lights_[k]);
    const std::size_t fiducials = used.size();
    if (options_.use_still_units) AddStillUnits(*fit, &used);
    // The places of units that stand still are known less well than those of fiducials. The
    // fiducials alone show the air, where they are enough.
    const bool enough = fiducials >= MonomialCount(fit->degree) + kFreedomMin;
    result_.air =
        AirOf(std::span(used).first(enough ? fiducials : used.size()), fit->degree, map_options_);
    const auto map = PlateMap::Solve(used, fit->degree, result_.air, map_options_);
    if (!map)
      return tl::unexpected<Refusal>(
          {RefusalReason::kRough, "the fiducials seen do not determine the camera"});
    return Mapped(*map, *fit, *alignment);
  }

 private:
  void Align(const Alignment& alignment) {
    for (PointFp& p : seen_) {
      const Complex w = alignment.gain * Complex(p.x_mm, p.y_mm) + alignment.shift;
      p = {w.real(), w.imag()};
    }
    const double noise = std::hypot(options_.centroid_sigma_mm, options_.fiducial_sigma_mm);
    for (const FiducialMatch& match : alignment.matches)
      lights_.push_back({seen_[match.spot], request_.fiducials[match.fiducial].at_fp, noise});
  }

  [[nodiscard]] std::optional<Refusal> Rough(const PolynomialFit* fit) const {
    char text[120];
    const std::size_t least = std::max<std::size_t>(3, (request_.fiducials.size() + 1) / 2);
    if (fit == nullptr || fit->used_count < least) {
      std::snprintf(text, sizeof text, "%zu of %zu fiducials agree on a camera, fewer than %zu",
                    fit == nullptr ? 0 : fit->used_count, request_.fiducials.size(), least);
      return Refusal{RefusalReason::kFewFiducials, text};
    }
    if (fit->residual_mm <= options_.residual_mm_max) return std::nullopt;
    std::snprintf(text, sizeof text, "fiducials scatter by %.3g mm, more than %.3g",
                  fit->residual_mm, options_.residual_mm_max);
    return Refusal{RefusalReason::kRough, text};
  }

  void DescribeCamera(const Alignment& alignment, const PolynomialFit& fit) {
    result_.scale_change = std::abs(alignment.gain) - 1;
    result_.rotation_deg = std::arg(alignment.gain) * 180 / std::numbers::pi;
    result_.shift_fp = {alignment.shift.real(), alignment.shift.imag()};

    result_.fiducials_used = static_cast<std::uint32_t>(fit.used_count);
    result_.fiducials_missing =
        static_cast<std::uint32_t>(request_.fiducials.size() - lights_.size());
    result_.fiducials_false = static_cast<std::uint32_t>(lights_.size() - fit.used_count);
    result_.residual_mm = fit.residual_mm;
  }

  // Adds units that were not commanded to move and were measured before, where exactly one spot is
  // near: they are lights of known place, too. Fiducials stay whatever the units show; units that
  // do not fit are left out. The degree stays: the process follows the rest of the distortion, too.
  void AddStillUnits(const PolynomialFit& fit, std::vector<KnownLight>* used) {
    std::vector<std::uint32_t> still;
    for (std::uint32_t i = 0; i < request_.expectations.size(); ++i) {
      const UnitExpectation& e = request_.expectations[i];
      if (!e.moved && e.before_fp && e.before_sigma_mm <= kWellKnownMm) still.push_back(i);
    }
    if (still.empty() || used->size() >= kLightsMax) return;
    // Places by the fit without the air; its error is the residual.
    std::vector<PointFp> at;
    at.reserve(seen_.size());
    for (const PointFp& p : seen_) at.push_back(PlateBy(fit, map_options_, p));
    const SpotGrid grid(at, kMappingCellMm);
    // Every k-th unit is taken, so that they stand all over the plate.
    const std::size_t room = kLightsMax - used->size();
    const std::size_t stride = (still.size() + room - 1) / room;
    const std::size_t fiducials = used->size();
    std::vector<KnownLight> all = *used;
    for (std::size_t k = 0; k < still.size(); k += stride)
      TakeStillUnit(request_.expectations[still[k]], grid, fit.residual_mm, &all);
    const auto of_all = FitPolynomial(all, map_options_);
    if (!of_all) return;
    for (std::size_t k = fiducials; k < all.size(); ++k)
      if (of_all->used[k]) used->push_back(all[k]);
  }

  void TakeStillUnit(const UnitExpectation& unit, const SpotGrid& grid, double residual_mm,
                     std::vector<KnownLight>* lights) const {
    const double noise = std::hypot(std::hypot(options_.centroid_sigma_mm, options_.still_sigma_mm),
                                    unit.before_sigma_mm);
    const double gate_mm = kStillSigmas * std::hypot(residual_mm, noise);
    int near = 0;
    std::uint32_t spot = 0;
    // Twice the gate: a second spot within that distance could have pulled the first.
    grid.ForNear(*unit.before_fp, 2 * gate_mm, [&](std::uint32_t s, double d2) {
      ++near;
      spot = d2 <= gate_mm * gate_mm ? s : kNoSpot;
    });
    if (near == 1 && spot != kNoSpot) lights->push_back({seen_[spot], *unit.before_fp, noise});
  }

  [[nodiscard]] MappedSpots Mapped(const PlateMap& map, const PolynomialFit& fit,
                                   const Alignment& alignment) {
    MappedSpots mapped;
    mapped.at_fp.reserve(seen_.size());
    mapped.sigma_mm.reserve(seen_.size());
    for (const PointFp& p : seen_) {
      const PlateMap::Place place = map.At(p);
      mapped.at_fp.push_back(place.at_fp);
      mapped.sigma_mm.push_back(place.sigma_mm);
    }
    mapped.is_fiducial.assign(seen_.size(), false);
    for (std::size_t k = 0; k < alignment.matches.size(); ++k)
      if (fit.used[k]) mapped.is_fiducial[alignment.matches[k].spot] = true;
    result_.degree = map.degree();
    std::vector<double> sigmas = mapped.sigma_mm;
    if (!sigmas.empty()) {
      const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
      std::nth_element(sigmas.begin(), middle, sigmas.end());
      result_.map_sigma_mm = *middle;
    }
    result_.still_units_used = static_cast<std::uint32_t>(map.light_count() - fit.used_count);
    return mapped;
  }

  /// A unit whose place is less well known is no light of known place.
  static constexpr double kWellKnownMm = 0.03;

  const IdentificationRequest& request_;
  const IdentifyOptions& options_;
  PlateMapOptions map_options_;  // the polynomial normalised to these fiducials
  Identification& result_;
  std::vector<PointFp> seen_;
  std::vector<KnownLight> lights_;  // Shape: as the alignment's matches
};

}  // namespace

tl::expected<MappedSpots, Refusal> MapSpots(const IdentificationRequest& request,
                                            const IdentifyOptions& options, Orientation orientation,
                                            Identification* result) {
  return Mapping(request, options, result).Run(orientation);
}

}  // namespace focalfleet
