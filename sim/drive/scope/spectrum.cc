#include "sim/drive/scope/spectrum.h"

#include <bit>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

using Complex = std::complex<double>;

void ReverseBits(std::vector<Complex>* samples) {
  std::size_t reversed = 0;
  for (std::size_t k = 1; k < samples->size(); ++k) {
    std::size_t bit = samples->size() / 2;
    for (; (reversed & bit) != 0; bit /= 2) reversed ^= bit;
    reversed |= bit;
    if (k < reversed) std::swap((*samples)[k], (*samples)[reversed]);
  }
}

}  // namespace

std::vector<Complex> Components(std::vector<Complex> samples) {
  const std::size_t size = samples.size();
  FOCALFLEET_CHECK(std::has_single_bit(size));
  ReverseBits(&samples);
  for (std::size_t width = 2; width <= size; width *= 2) {
    for (std::size_t k = 0; k < width / 2; ++k) {
      const Complex twist = std::polar(
          1.0, -2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(width));
      for (std::size_t at = k; at < size; at += width) {
        const Complex odd = samples[at + width / 2] * twist;
        samples[at + width / 2] = samples[at] - odd;
        samples[at] += odd;
      }
    }
  }
  for (Complex& sample : samples) sample /= static_cast<double>(size);
  return samples;
}

std::vector<double> PhaseHarmonics(std::span<const Complex> components) {
  const std::size_t size = components.size();
  if (size == 0) return {};
  std::vector<double> harmonics = {std::abs(components[0])};
  for (std::size_t m = 1; m < size / 2; ++m)
    harmonics.push_back(std::sqrt(std::norm(components[m]) + std::norm(components[size - m])));
  return harmonics;
}

}  // namespace focalfleet::sim
