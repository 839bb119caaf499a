// The spectrum of currents that repeat with the field. The three phase currents are one complex
// number, so component m of a turn of samples turns m times forward. A phase cannot distinguish it
// from -m, and its harmonic m contains both. Radix-2 transform: O(n log n).
#pragma once

#include <complex>
#include <span>
#include <vector>

namespace focalfleet::sim {

/// The components of e^(2 pi j m k / n) in `samples`, their mean first (m = 0); m and m - n are
/// one. Shape: as samples. Pre: samples.size() is a power of two.
std::vector<std::complex<double>> Components(std::vector<std::complex<double>> samples);

/// The amplitudes of a phase's harmonics 0, 1 .. n / 2 - 1. Harmonic 0 is the mean as if it were an
/// amplitude: |c_0|.
std::vector<double> PhaseHarmonics(std::span<const std::complex<double>> components);

}  // namespace focalfleet::sim
