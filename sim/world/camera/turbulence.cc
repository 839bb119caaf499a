#include "sim/world/camera/turbulence.h"

#include <cmath>
#include <numbers>

namespace focalfleet::sim {
namespace {

constexpr int kWaves = 96;
constexpr double kShape = 2;  // a; the draw of a Gamma below is for 2

}  // namespace

Turbulence::Turbulence(const TurbulenceLaw& law, Rng* rng) {
  if (law.sigma_mm <= 0) return;
  amplitude_mm_ = law.sigma_mm * std::sqrt(2.0 / kWaves);
  for (std::vector<Wave>& waves : waves_) {
    for (int j = 0; j < kWaves; ++j) {
      // 1 - u is never 0, so the logarithm is finite.
      const double gamma = -std::log((1 - rng->Uniform()) * (1 - rng->Uniform()));
      const double deviation = std::sqrt(gamma / kShape) / law.length_mm;
      const double kx = deviation * rng->Normal();
      const double ky = deviation * rng->Normal();
      waves.push_back({{kx, ky}, rng->Uniform(0, 2 * std::numbers::pi)});
    }
  }
}

std::complex<double> Turbulence::At(std::complex<double> place_mm) const {
  std::array<double, 2> sum{};
  for (std::size_t k = 0; k < 2; ++k)
    for (const Wave& wave : waves_[k])
      sum[k] += std::cos(wave.wave_per_mm.real() * place_mm.real() +
                         wave.wave_per_mm.imag() * place_mm.imag() + wave.phase);
  return {amplitude_mm_ * sum[0], amplitude_mm_ * sum[1]};
}

}  // namespace focalfleet::sim
