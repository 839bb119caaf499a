// A fit turns a map of a rotor's radial field into a model of it, with uncertainty.
//
// Harmonic and surface models are fitted by plain least squares. The spherical one has more
// coefficients than a sparse map has points. A prior therefore makes coefficients fall off
// geometrically with the degree. The evidence (marginal likelihood) of the map itself sets how fast
// and how far. The first fit has only orders 4, 12, 20, 28, which are all that eight equal
// alternating poles make. All other orders, which unlike magnets make, follow and are kept where
// the evidence supports them. Two cuts are therefore enough for an ideal array, and a full map
// resolves each magnet.
//
// Units: T, radians, mm. Source of the evidence: [RasmussenWilliams2006] chapter 2.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/hall/field_model.h"

namespace focalfleet::sim {

struct FieldPoint {
  double theta_rad = 0;  // from the rotor's z axis
  double phi_rad = 0;
  double b_T = 0;
  double radius_mm = 59;
};
using FieldMap = std::vector<FieldPoint>;

struct FieldFit {
  FieldParameters parameters;
  double radius_mm = 59;        // of the sphere that the parameters hold for: the map's mean
  std::optional<double> decay;  // B_r ~ r^-decay; only from a map of several radii
  double sd_decay = 0;
  double rms_T = 0;  // of the residuals
  double worst_T = 0;
  double peak_T = 0;        // greatest magnitude in the map
  double noise_T = 0;       // of one point, as far as the fit separates noise from field
  bool all_orders = false;  // unlike magnets were found
};

enum class FieldKind { kHarmonic, kSurface, kSpherical };
inline constexpr FieldKind kFieldKinds[] = {FieldKind::kHarmonic, FieldKind::kSurface,
                                            FieldKind::kSpherical};
std::string_view Name(FieldKind kind);

/// Errors: kInvalid: too few points, no field, or points that do not determine the model's
/// parameters. Cost: spherical about points * 200^2 operations for ideal arrays, a second for
/// 65,000 points.
Result<FieldFit> FitField(const FieldMap& map, FieldKind kind);

Vector3 DirectionAt(double theta_rad, double phi_rad);

}  // namespace focalfleet::sim
