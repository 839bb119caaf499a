#include "sim/world/camera/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace focalfleet::sim {
namespace {

struct Blob {
  std::complex<double> at_px;
  double flux = 0;
  double fwhm2_px = 0;
  std::vector<std::uint32_t> light;
};

Optics OpticsOfThisExposure(const CameraTraits& traits, Rng* rng) {
  Optics optics = traits.optics;
  optics.pixels_per_mm *= 1 + traits.scale_change_ppm * 1e-6 * rng->Normal();
  optics.rotation_deg += traits.rotation_change_deg * rng->Normal();
  const double shift_x_px = traits.shift_change_px * rng->Normal();
  const double shift_y_px = traits.shift_change_px * rng->Normal();
  optics.centre_px += std::complex<double>(shift_x_px, shift_y_px);
  return optics;
}

std::vector<Blob> Shine(const std::vector<LightSource>& sources, const CameraTraits& traits,
                        const Optics& optics, Rng* rng) {
  const Turbulence air(traits.air, rng);
  std::vector<Blob> blobs;
  blobs.reserve(sources.size());
  for (std::uint32_t k = 0; k < sources.size(); ++k) {
    const LightSource& source = sources[k];
    const bool dark = rng->Uniform() < traits.missing_share;
    const double flux = source.flux * std::max(0.05, 1 + traits.flux_scatter * rng->Normal());
    const double noise_x = rng->Normal();
    const double noise_y = rng->Normal();
    if (dark) continue;
    const double sigma_px = traits.centroid_sigma_px / std::sqrt(flux);
    const std::complex<double> at = PixelOf(optics, source.place_mm + air.At(source.place_mm)) +
                                    std::complex<double>(sigma_px * noise_x, sigma_px * noise_y);
    blobs.push_back({at, flux, traits.fwhm_px * traits.fwhm_px, {k}});
  }
  return blobs;
}

void AddExtras(const std::vector<LightSource>& sources, const CameraTraits& traits,
               const Optics& optics, std::vector<Blob>* blobs, Rng* rng) {
  double rim_mm = 0;
  for (const LightSource& source : sources) rim_mm = std::max(rim_mm, std::abs(source.place_mm));
  const auto count =
      static_cast<int>(std::lround(traits.extra_share * static_cast<double>(sources.size())));
  for (int k = 0; k < count; ++k) {
    const double r_mm = rim_mm * std::sqrt(rng->Uniform());
    const double turn = rng->Uniform(0, 2 * std::numbers::pi);
    const double flux = std::exp(rng->Uniform(std::log(0.2), std::log(2.0)));
    blobs->push_back(
        {PixelOf(optics, std::polar(r_mm, turn)), flux, traits.fwhm_px * traits.fwhm_px, {}});
  }
}

// The centroid is weighted by flux. The squares of the widths average by flux. The squares of the
// distances to the centroid do so too, halved because each counts in one of two directions.
Blob Merged(const std::vector<Blob>& blobs, const std::vector<std::uint32_t>& members) {
  constexpr double kFwhmPerSigma = 2.3548200450309493;
  Blob sum;
  for (const std::uint32_t k : members) {
    sum.flux += blobs[k].flux;
    sum.at_px += blobs[k].flux * blobs[k].at_px;
    sum.light.insert(sum.light.end(), blobs[k].light.begin(), blobs[k].light.end());
  }
  sum.at_px /= sum.flux;
  for (const std::uint32_t k : members)
    sum.fwhm2_px += blobs[k].flux / sum.flux *
                    (blobs[k].fwhm2_px +
                     kFwhmPerSigma * kFwhmPerSigma * std::norm(blobs[k].at_px - sum.at_px) / 2);
  return sum;
}

// Spots are sorted by the rows of the sensor. Chains blend as a whole.
std::vector<Blob> Blended(std::vector<Blob> blobs, double length_px) {
  std::sort(blobs.begin(), blobs.end(),
            [](const Blob& a, const Blob& b) { return a.at_px.imag() < b.at_px.imag(); });
  std::vector<std::uint32_t> root(blobs.size());
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&root](std::uint32_t k) {
    while (root[k] != k) k = root[k] = root[root[k]];
    return k;
  };
  for (std::uint32_t a = 0; a < blobs.size(); ++a)
    for (std::uint32_t b = a + 1;
         b < blobs.size() && blobs[b].at_px.imag() - blobs[a].at_px.imag() < length_px; ++b)
      if (std::abs(blobs[a].at_px - blobs[b].at_px) < length_px) root[find(b)] = find(a);
  std::vector<std::vector<std::uint32_t>> groups(blobs.size());
  for (std::uint32_t k = 0; k < blobs.size(); ++k) groups[find(k)].push_back(k);
  std::vector<Blob> merged;
  merged.reserve(blobs.size());
  for (std::uint32_t k = 0; k < blobs.size(); ++k) {
    if (groups[k].size() == 1) {
      merged.push_back(blobs[k]);
    } else if (!groups[k].empty()) {
      merged.push_back(Merged(blobs, groups[k]));
    }
  }
  return merged;
}

}  // namespace

Image TakeImage(const std::vector<LightSource>& sources, const CameraTraits& traits, Rng* rng) {
  const Optics optics = OpticsOfThisExposure(traits, rng);
  std::vector<Blob> blobs = Shine(sources, traits, optics, rng);
  AddExtras(sources, traits, optics, &blobs, rng);
  Image image;
  for (Blob& blob : Blended(std::move(blobs), traits.blend_fwhm * traits.fwhm_px)) {
    const double fwhm_px = std::sqrt(blob.fwhm2_px) * (1 + traits.fwhm_scatter * rng->Normal());
    const bool seen = blob.at_px.real() >= 0 && blob.at_px.imag() >= 0 &&
                      blob.at_px.real() < traits.sensor_px.real() &&
                      blob.at_px.imag() < traits.sensor_px.imag();
    if (!seen) continue;
    image.spots.push_back({blob.at_px.real(), blob.at_px.imag(), blob.flux, fwhm_px});
    image.light.push_back(std::move(blob.light));
  }
  return image;
}

std::vector<LightSource> FibresOf(const World& world) {
  std::vector<LightSource> fibres;
  fibres.reserve(world.units().size());
  for (std::size_t row = 0; row < world.units().size(); ++row) {
    const UnitTruth truth = world.Truth(row);
    fibres.push_back({LightKind::kFibre, truth.id.value, {truth.x_mm, truth.y_mm}, 1});
  }
  return fibres;
}

}  // namespace focalfleet::sim
