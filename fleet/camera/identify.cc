#include "fleet/camera/identify.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "fleet/camera/claims.h"
#include "fleet/camera/mapping.h"
#include "fleet/camera/swaps.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

constexpr double kCellMm = 8;
constexpr std::uint32_t kStrayFibresMin = 9;  // fewer are no evidence about a whole field

// Assigns spots in steps of falling certainty.
class Matching {
 public:
  Matching(const IdentificationRequest& request, const IdentifyOptions& options,
           const MappedSpots& spots, const SpotGrid& grid, Claims claims)
      : request_(request),
        options_(options),
        spots_(spots),
        search_{&request, &options, &spots, &grid},
        claims_(std::move(claims)),
        measurements_(request.layout->size()),
        settled_(request.layout->size(), 0),
        is_free_(spots.at_fp.size(), 1) {
    for (std::size_t k = 0; k < is_free_.size(); ++k)
      if (spots.is_fiducial[k]) is_free_[k] = 0;
  }

  void Run(Identification* result) {
    TakeSwaps();
    TakeExpected();
    TakeStrays();
    TakeOutside();
    NameRivals();
    MarkBlends();
    result->units = std::move(measurements_);
    for (const UnitMeasurement& measurement : result->units)
      ++result->count[static_cast<std::size_t>(measurement.status)];
    for (std::uint32_t k = 0; k < is_free_.size(); ++k)
      if (is_free_[k] != 0) result->unexplained.push_back(k);
  }

 private:
  void Give(std::uint32_t unit, std::uint32_t spot, MeasurementStatus status, double doubt) {
    UnitMeasurement& measurement = measurements_[unit];
    measurement.status = status;
    measurement.spot = spot;
    measurement.at_fp = spots_.at_fp[spot];
    const double sigma_mm = std::hypot(options_.centroid_sigma_mm, spots_.sigma_mm[spot]);
    measurement.covariance = {sigma_mm * sigma_mm, 0, sigma_mm * sigma_mm};
    measurement.doubt = doubt;
    settled_[unit] = 1;
    is_free_[spot] = 0;
  }

  void LeaveAmbiguous(std::uint32_t unit, double doubt) {
    measurements_[unit].status = MeasurementStatus::kAmbiguous;
    measurements_[unit].doubt = doubt;
    settled_[unit] = 1;
  }

  // Candidates are units that were commanded to move and have no spot near the end of the move. A
  // lost unit reports a place, which is no command. Their spots are all but those that are the only
  // one at the end of a unit's move.
  void TakeSwaps() {
    std::vector<std::uint32_t> ends(settled_.size(), 0);
    for (const Claim& claim : claims_.all)
      if (claim.kind == PlaceKind::kExpected) ++ends[claim.unit];
    std::vector<char> is_free = is_free_;
    for (const Claim& claim : claims_.all)
      if (claim.kind == PlaceKind::kExpected && ends[claim.unit] == 1) is_free[claim.spot] = 0;
    std::vector<std::uint32_t> units;
    for (std::uint32_t i = 0; i < ends.size(); ++i)
      if (ends[i] == 0 && request_.expectations[i].commanded && request_.expectations[i].moved &&
          !request_.expectations[i].lost)
        units.push_back(i);
    const SwapFindings found =
        FindSwaps({&request_, &options_, &spots_, search_.grid, units, is_free, claims_.all});
    traces_ = found.traces;
    for (const SwapRing& ring : found.rings) {
      for (const SwapTrace& trace : ring.members) {
        if (ring.ambiguous) {
          LeaveAmbiguous(trace.unit, 0.5);
          held_.push_back(trace.spot);
        } else {
          Give(trace.unit, trace.spot, MeasurementStatus::kSwapped, 0);
        }
        measurements_[trace.unit].other = {trace.other};
      }
    }
    for (const std::uint32_t spot : held_) is_free_[spot] = 0;
  }

  void TakeExpected() {
    std::vector<Claim> open;
    for (const Claim& claim : claims_.all)
      if (settled_[claim.unit] == 0 && is_free_[claim.spot] != 0) open.push_back(claim);
    const std::vector<Decision> decisions = AssignWithLost(&open);
    for (const Decision& decision : decisions) {
      if (decision.spot != kNoSpot && decision.doubt <= options_.doubt_max) GiveExpected(decision);
    }
    // A spot that an undecided unit could have is not assigned to another either.
    for (const Decision& decision : decisions) {
      if (decision.doubt <= options_.doubt_max) continue;
      if (!request_.expectations[decision.unit].lost || decision.doubt > options_.stray_doubt_max)
        LeaveAmbiguous(decision.unit, decision.doubt);
      else if (decision.spot != kNoSpot)
        Give(decision.unit, decision.spot, MeasurementStatus::kStrayed, decision.doubt);
    }
    for (const Claim& claim : open) {
      const bool undecided = measurements_[claim.unit].status == MeasurementStatus::kAmbiguous;
      if (undecided && is_free_[claim.spot] != 0) {
        is_free_[claim.spot] = 0;
        held_.push_back(claim.spot);
      }
    }
  }

  // A lost unit may have any spot that it reaches, also one where another unit is expected. Such
  // claims are decided together with the others where the answers can be counted. They are too many
  // where many units near each other are lost and reach far into each other's areas: claims on
  // expected places are then decided by themselves. `open` becomes the claims that were decided.
  std::vector<Decision> AssignWithLost(std::vector<Claim>* open) {
    std::vector<std::uint32_t> lost;
    for (const std::uint32_t unit : Open())
      if (request_.expectations[unit].lost) lost.push_back(unit);
    std::vector<Claim> all = *open;
    const std::vector<Claim> anywhere = FindStrays(search_, lost, is_free_);
    all.insert(all.end(), anywhere.begin(), anywhere.end());
    std::vector<Decision> decisions = Assign(all);
    std::vector<char> is_too_large(settled_.size(), 0);
    for (const Decision& decision : decisions)
      if (decision.too_large) is_too_large[decision.unit] = 1;
    std::erase_if(decisions, &Decision::too_large);
    std::erase_if(all, [&](const Claim& claim) { return is_too_large[claim.unit] != 0; });
    std::erase_if(*open, [&](const Claim& claim) { return is_too_large[claim.unit] == 0; });
    for (const Decision& decision : Assign(*open)) decisions.push_back(decision);
    open->insert(open->end(), all.begin(), all.end());
    return decisions;
  }

  void GiveExpected(const Decision& decision) {
    const bool stayed =
        decision.kind != PlaceKind::kExpected && decision.kind != PlaceKind::kAnywhere;
    const bool known =
        decision.kind != PlaceKind::kAnywhere && decision.kind_doubt <= options_.motion_doubt_max;
    Give(decision.unit, decision.spot,
         stayed && known ? MeasurementStatus::kDidNotMove : MeasurementStatus::kMeasured,
         decision.doubt);
    UnitMeasurement& measurement = measurements_[decision.unit];
    measurement.motion_is_known = known;
    if (!stayed || !known) return;
    measurement.stayed[Index(Axis::kTheta)] = decision.kind != PlaceKind::kPhiStayed;
    measurement.stayed[Index(Axis::kPhi)] = decision.kind != PlaceKind::kThetaStayed;
  }

  [[nodiscard]] std::vector<std::uint32_t> Open() const {
    std::vector<std::uint32_t> units;
    for (std::uint32_t i = 0; i < settled_.size(); ++i)
      if (settled_[i] == 0) units.push_back(i);
    return units;
  }

  void TakeStrays() {
    const std::vector<std::uint32_t> open = Open();
    std::vector<char> is_candidate = is_free_;
    for (const std::uint32_t spot : held_) is_candidate[spot] = 1;
    std::vector<char> is_held(is_free_.size(), 0);
    for (const std::uint32_t spot : held_) is_held[spot] = 1;
    std::vector<Claim> strays = FindStrays(search_, open, is_candidate);
    // A unit is undecided if it could have a spot over which others are undecided.
    for (const Claim& claim : strays)
      if (is_held[claim.spot] != 0 && settled_[claim.unit] == 0) LeaveAmbiguous(claim.unit, 0.5);
    std::vector<Claim> left;
    for (const Claim& claim : strays)
      if (settled_[claim.unit] == 0 || is_held[claim.spot] == 0) left.push_back(claim);
    for (const Decision& decision : Assign(left)) {
      if (settled_[decision.unit] != 0) continue;
      if (decision.doubt > options_.stray_doubt_max) {
        LeaveAmbiguous(decision.unit, decision.doubt);
      } else if (decision.spot == kNoSpot) {
        continue;
      } else if (request_.expectations[decision.unit].lost &&
                 decision.doubt <= options_.doubt_max) {
        // The place of this unit was not known, so it did not stray: it is found.
        Give(decision.unit, decision.spot, MeasurementStatus::kMeasured, decision.doubt);
        measurements_[decision.unit].motion_is_known = false;
      } else {
        Give(decision.unit, decision.spot, MeasurementStatus::kStrayed, decision.doubt);
        Suspect(decision.unit, decision.spot);
      }
    }
    for (const Claim& claim : left)
      if (measurements_[claim.unit].status == MeasurementStatus::kAmbiguous &&
          is_free_[claim.spot] != 0) {
        is_free_[claim.spot] = 0;
        held_.push_back(claim.spot);
      }
  }

  // A single other unit, not seen where it should be, was commanded to where this one is.
  void Suspect(std::uint32_t unit, std::uint32_t spot) {
    int found = 0;
    for (const SwapTrace& trace : traces_) {
      if (trace.unit != unit || trace.spot != spot) continue;
      if (IsCertain(measurements_[trace.other].status)) continue;
      ++found;
      measurements_[unit].other = {trace.other};
    }
    if (found == 1) measurements_[unit].status = MeasurementStatus::kSwapSuspected;
    if (found != 1) measurements_[unit].other = kNoUnit;
  }

  void TakeOutside() {
    for (const std::uint32_t unit : Open()) {
      const Unit& arms = request_.layout->unit({unit});
      const double reach_mm = arms.theta().arm_mm + arms.phi().arm_mm + options_.outside_mm;
      std::uint32_t spot = kNoSpot;
      int found = 0;
      search_.grid->ForNear(arms.base_fp, reach_mm, [&](std::uint32_t s, double) {
        if (is_free_[s] == 0 || !InPatrol(arms, spots_.at_fp[s], options_.outside_mm)) return;
        ++found;
        spot = s;
      });
      if (found == 1) Give(unit, spot, MeasurementStatus::kOutsidePatrol, 0.5);
    }
  }

  // Names a rival of an ambiguous unit: the single other unit near it that is undecided as well.
  void NameRivals() {
    for (std::uint32_t i = 0; i < measurements_.size(); ++i) {
      UnitMeasurement& measurement = measurements_[i];
      if (measurement.status != MeasurementStatus::kAmbiguous || measurement.other != kNoUnit)
        continue;
      for (const PositionerIndex j : request_.layout->neighbours({i}))
        if (measurements_[j.value].status == MeasurementStatus::kAmbiguous) {
          measurement.other = j;
          break;
        }
    }
  }

  void MarkBlends() {
    const double width_px = MedianWidth();
    std::vector<std::uint32_t> holder(is_free_.size(), UINT32_MAX);
    for (std::uint32_t i = 0; i < measurements_.size(); ++i) {
      const UnitMeasurement& measurement = measurements_[i];
      if (measurement.spot == kNoSpot) continue;
      holder[measurement.spot] = i;
      const Spot& spot = request_.exposure->spots[measurement.spot];
      const double flux = request_.expectations[i].flux;
      const bool wide = width_px > 0 && spot.fwhm_px > options_.blend_width_ratio * width_px;
      if (wide || (flux > 0 && spot.flux > options_.blend_flux_ratio * flux)) Blend(i);
    }
    // A unit is not seen and is expected where another's spot is: that spot may be the light of
    // both.
    for (std::uint32_t i = 0; i < measurements_.size(); ++i) {
      if (measurements_[i].status != MeasurementStatus::kMissing ||
          !request_.expectations[i].expected_fp)
        continue;
      std::uint32_t with = kNoSpot;
      search_.grid->ForNear(*request_.expectations[i].expected_fp, options_.blend_mm,
                            [&](std::uint32_t spot, double) {
                              if (holder[spot] != UINT32_MAX) with = spot;
                            });
      if (with == kNoSpot) continue;
      Give(i, with, MeasurementStatus::kBlended, 0.5);
      measurements_[i].other = {holder[with]};
      measurements_[holder[with]].other = {i};
      Blend(i);
      Blend(holder[with]);
    }
  }

  // The centroid of two lights of any brightness is within their distance of each.
  void Blend(std::uint32_t unit) {
    UnitMeasurement& measurement = measurements_[unit];
    measurement.status = MeasurementStatus::kBlended;
    measurement.covariance.xx += options_.blend_mm * options_.blend_mm / 4;
    measurement.covariance.yy += options_.blend_mm * options_.blend_mm / 4;
  }

  [[nodiscard]] double MedianWidth() const {
    std::vector<double> widths;
    for (const Spot& spot : request_.exposure->spots)
      if (spot.fwhm_px > 0) widths.push_back(spot.fwhm_px);
    if (widths.empty()) return 0;
    const auto middle = widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 2);
    std::nth_element(widths.begin(), middle, widths.end());
    return *middle;
  }

  const IdentificationRequest& request_;
  const IdentifyOptions& options_;
  const MappedSpots& spots_;
  ClaimSearch search_;
  Claims claims_;
  std::vector<UnitMeasurement> measurements_;
  std::vector<char> settled_;
  std::vector<char> is_free_;
  std::vector<std::uint32_t> held_;  // spots over which units are undecided
  std::vector<SwapTrace> traces_;
};

bool IsOtherField(const Claims& claims, const IdentifyOptions& options) {
  return claims.recognised < options.recognised_share_min * claims.units &&
         claims.stray_spots > std::max(claims.recognised, kStrayFibresMin);
}

// P(at least `count`) of a Poisson distribution.
double PoissonTail(double mean, std::size_t count) {
  double term = std::exp(-mean), below = 0;
  for (std::size_t k = 0; k < count; ++k) below += term, term *= mean / static_cast<double>(k + 1);
  return 1 - below;
}

// Lost units may be anywhere, and are found in any picture. Where too few units at known places
// vouch for it, more dark units and spots of no unit than dark fibres and dust make tell another
// field.
std::optional<Refusal> PerhapsOtherField(std::uint32_t recognised, const IdentifyOptions& options,
                                         const Identification& found) {
  // Each is where it should be within some hundredths of a millimetre: by chance one in thousands.
  constexpr std::size_t kWitnessesMin = 3;
  if (recognised >= std::min(kWitnessesMin, found.units.size() / 2)) return std::nullopt;
  const std::size_t dark = found.count[static_cast<std::size_t>(MeasurementStatus::kMissing)] +
                           found.count[static_cast<std::size_t>(MeasurementStatus::kOutsidePatrol)];
  const double usual =
      (options.shares.missing + options.shares.dust) * static_cast<double>(found.units.size());
  if (PoissonTail(usual, dark + found.unexplained.size()) >= options.doubt_max) return std::nullopt;
  return Refusal{RefusalReason::kOtherField,
                 "fiducials are in place, but " + std::to_string(found.unexplained.size()) +
                     " spots are of no unit and " + std::to_string(dark) + " of " +
                     std::to_string(found.units.size()) +
                     " units have no spot, and most places were not known before: another field, "
                     "or another plate"};
}

std::optional<Refusal> Implausible(const IdentificationRequest& request,
                                   const IdentifyOptions& options) {
  const auto lights = static_cast<double>(request.layout->size() + request.fiducials.size());
  const auto spots = static_cast<double>(request.exposure->spots.size());
  char text[120];
  if (spots < options.spots_share_min * lights || spots > options.spots_share_max * lights + 20) {
    std::snprintf(text, sizeof text, "%zu spots for %zu units and %zu fiducials",
                  request.exposure->spots.size(), request.layout->size(), request.fiducials.size());
    return Refusal{RefusalReason::kCount, text};
  }
  if (request.fiducials.size() < 3)
    return Refusal{RefusalReason::kFewFiducials,
                   "a camera cannot be solved from fewer than 3 fiducials"};
  return std::nullopt;
}

struct Looked {
  MappedSpots spots;
  SpotGrid grid;
  Claims claims;
};

tl::expected<Looked, Refusal> LookOnce(const IdentificationRequest& request,
                                       const IdentifyOptions& options, Orientation orientation,
                                       Identification* result) {
  auto spots = MapSpots(request, options, orientation, result);
  if (!spots) return tl::unexpected<Refusal>(std::move(spots.error()));
  SpotGrid grid(spots->at_fp, kCellMm);
  Claims claims = FindClaims({&request, &options, &*spots, &grid});
  return Looked{std::move(*spots), std::move(grid), std::move(claims)};
}

bool Fits(const IdentificationRequest& request, const IdentifyOptions& options,
          Orientation orientation) {
  Identification ignored;
  const auto looked = LookOnce(request, options, orientation, &ignored);
  return looked && looked->claims.recognised >= options.recognised_share_min * looked->claims.units;
}

std::string Said(Orientation orientation, bool model_is_mirrored) {
  if (orientation.mirrored)
    return std::string("the picture is mirrored") +
           (orientation.quarters == 0 ? "" : " and turned");
  // The turn is undone on the plate; on a mirrored sensor the sense is the other.
  const int quarters = model_is_mirrored ? orientation.quarters : 4 - orientation.quarters;
  return "the picture is turned by " + std::to_string(90 * quarters) + " degrees";
}

// Tests for the expected field seen the wrong way round: fiducials and fibres fit when it is
// turned.
std::optional<Refusal> Turned(const IdentificationRequest& request,
                              const IdentifyOptions& options) {
  for (int k = 1; k < 8; ++k) {
    const Orientation orientation{k % 4, k >= 4};
    if (!Fits(request, options, orientation)) continue;
    return Refusal{orientation.mirrored ? RefusalReason::kMirrored : RefusalReason::kTurned,
                   Said(orientation, request.camera->mirrored)};
  }
  return std::nullopt;
}

}  // namespace

const char* Name(MeasurementStatus status) {
  constexpr const char* kNames[] = {
      "measured",       "did_not_move", "swapped", "strayed",         "swap_suspected", "blended",
      "outside_patrol", "ambiguous",    "missing", "sensors_doubted", "too_coarse"};
  return kNames[static_cast<std::size_t>(status)];
}

tl::expected<Identification, Refusal> Identify(const IdentificationRequest& request,
                                               const IdentifyOptions& options) {
  FOCALFLEET_CHECK(request.layout != nullptr && request.camera != nullptr &&
                   request.exposure != nullptr &&
                   request.expectations.size() == request.layout->size());
  if (auto refusal = Implausible(request, options))
    return tl::unexpected<Refusal>(std::move(*refusal));
  Identification result;
  auto looked = LookOnce(request, options, {}, &result);
  if (!looked) {
    if (auto turned = Turned(request, options)) return tl::unexpected<Refusal>(std::move(*turned));
    return tl::unexpected<Refusal>(std::move(looked.error()));
  }
  if (IsOtherField(looked->claims, options)) {
    if (auto turned = Turned(request, options)) return tl::unexpected<Refusal>(std::move(*turned));
    return tl::unexpected<Refusal>(
        {RefusalReason::kOtherField,
         "fiducials are in place, but only " + std::to_string(looked->claims.recognised) + " of " +
             std::to_string(looked->claims.units) +
             " units are where they ended or were before: another field, or another plate"});
  }
  const std::uint32_t recognised = looked->claims.recognised;
  Matching(request, options, looked->spots, looked->grid, std::move(looked->claims)).Run(&result);
  if (auto other = PerhapsOtherField(recognised, options, result))
    return tl::unexpected<Refusal>(std::move(*other));
  result.spots_fp = std::move(looked->spots.at_fp);
  return result;
}

}  // namespace focalfleet
