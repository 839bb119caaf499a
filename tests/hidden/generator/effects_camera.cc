// Effects of plate, telescope, air and camera: they move a fibre's picture and not its arm.
#include <algorithm>
#include <array>
#include <cmath>

#include "protocol/base/rng.h"
#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

namespace {

// The instrument hangs: all fibres go down together, a little more than in proportion.
void GravitySag(const Scene& scene, const Effect& effect, std::size_t, Track* track) {
  const double sag_mm = effect.kind->typical * effect.size;
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const double weight = std::cos(scene.campaign->exposures[m].elevation_deg * kDegree);
    track->place_mm[m] += Place(0, -sag_mm * weight * (1 + 0.05 * weight));
  }
}

// The camera is elsewhere from picture to picture: scale, turn and shift, wandering.
void CameraSimilarity(const Scene& scene, const Effect& effect, std::size_t, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double amount_mm = effect.kind->typical * effect.size;
  Rng rng = Rng::Stream(effect.seed, "camera");
  Place linear;
  Place shift;
  const double keep = 0.9 * effect.shape[0];
  const double fresh = std::sqrt(1 - keep * keep);
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double draws[] = {rng.Normal(), rng.Normal(), rng.Normal(), rng.Normal()};
    linear = keep * linear + fresh * Place(draws[0], draws[1]);
    shift = keep * shift + fresh * Place(draws[2], draws[3]);
    track->place_mm[m] +=
        amount_mm * (shift + linear * track->place_mm[m] / campaign.plate_radius_mm);
  }
}

// Brown's radial and tangential terms, and a trefoil of Zernike's, fixed to the camera.
void CameraDistortion(const Scene& scene, const Effect& effect, std::size_t, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double rim_mm = effect.kind->typical * effect.size;
  const double turn = 2 * kPi * effect.shape[1];
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Place z = track->place_mm[m] / campaign.plate_radius_mm;
    const double r2 = std::norm(z);
    const Place radial = z * (r2 + 0.4 * (effect.shape[0] - 0.5) * r2 * r2);
    const Place direction = std::polar(1.0, turn);
    const Place tangential = 0.15 * (r2 * direction + 2.0 * (std::conj(direction) * z).real() * z);
    const Place trefoil = 0.2 * std::conj(z * z) * std::polar(1.0, 3 * turn);
    track->place_mm[m] += rim_mm * (radial + tangential + trefoil);
  }
}

// Centroid of a Gaussian spot in a window of three pixels, along one coordinate, less the truth.
double WindowBias(double fraction, double sigma_px) {
  double light = 0;
  double moment = 0;
  for (int pixel = -1; pixel <= 1; ++pixel) {
    const double low = pixel - 0.5 - fraction;
    const auto below = [&](double x) { return 0.5 * std::erfc(-x / sigma_px / std::sqrt(2.0)); };
    const double share = below(low + 1) - below(low);
    light += share;
    moment += share * pixel;
  }
  return moment / light - fraction;
}

void CentroidBias(const Scene& scene, const Effect& effect, std::size_t, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double times = effect.kind->typical * effect.size;
  const double sigma_px = 0.55 + 0.35 * effect.shape[0];
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Place px = (track->place_mm[m] - campaign.pixel_origin_mm) / campaign.pixel_mm;
    const auto bias = [&](double at) { return WindowBias(at - std::round(at), sigma_px); };
    track->place_mm[m] += times * campaign.pixel_mm * Place(bias(px.real()), bias(px.imag()));
  }
}

// Air between plate and camera is a Gaussian random field over the plate, new in every picture. The
// field is a sum of plane waves with random directions and Gaussian wave numbers (Bochner's
// theorem).
void AirTurbulence(const Scene& scene, const Effect& effect, std::size_t, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double rms_mm = effect.kind->typical * effect.size;
  const double length_mm = (0.3 + 0.7 * effect.shape[0]) * campaign.plate_radius_mm;
  constexpr int kWaves = 24;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    Rng rng = Rng::Stream(effect.seed, "air", m);
    const Place z = track->place_mm[m] / length_mm;
    Place sum;
    for (int w = 0; w < kWaves; ++w) {
      const Place k{rng.Normal(), rng.Normal()};
      const double along = (std::conj(k) * z).real();
      const double phases[] = {rng.Uniform(0, 2 * kPi), rng.Uniform(0, 2 * kPi)};
      sum += Place(std::cos(along + phases[0]), std::cos(along + phases[1]));
    }
    track->place_mm[m] += rms_mm * std::sqrt(2.0 / kWaves) * sum;
  }
}

// Two fibres are plugged the wrong way round. The weights mark the pair. The exchange itself needs
// both tracks and is made by the plant.
void IdentitySwap(const Scene&, const Effect&, std::size_t, Track*) {}

}  // namespace

std::vector<EffectKind> PlateEffects() {
  return {
      {"gravity_sag",
       Stage::kPlate,
       AxisUse::kNone,
       3e-3,
       "mm",
       60,
       true,
       {Owner::kPlate},
       {"elevation_deg"},
       1,
       false,
       GravitySag},
  };
}

std::vector<EffectKind> CameraEffects() {
  return {
      {"camera_similarity",
       Stage::kCamera,
       AxisUse::kNone,
       3e-3,
       "mm at the rim",
       60,
       false,
       {Owner::kCamera},
       {},
       1,
       true,
       CameraSimilarity},
      {"camera_distortion",
       Stage::kCamera,
       AxisUse::kNone,
       0.05,
       "mm at the rim",
       60,
       true,
       {Owner::kCamera},
       {},
       1,
       false,
       CameraDistortion},
      {"centroid_bias",
       Stage::kCamera,
       AxisUse::kNone,
       1,
       "of a window of 3 pixels",
       8,
       false,
       {Owner::kCamera},
       {"x_px", "y_px"},
       1,
       false,
       CentroidBias},
      {"air_turbulence",
       Stage::kCamera,
       AxisUse::kNone,
       3e-3,
       "mm",
       20,
       false,
       {Owner::kCamera},
       {},
       1,
       true,
       AirTurbulence},
      {"identity_swap",
       Stage::kCamera,
       AxisUse::kNone,
       1,
       "1",
       1,
       false,
       {Owner::kUnit},
       {},
       1,
       true,
       IdentitySwap},
  };
}

}  // namespace focalfleet::hidden
