#include "sim/campaigns/effects/rotor_ways.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/units.h"

namespace focalfleet::sim {
namespace {

constexpr std::string_view kCogging = "cogging", kImbalance = "phase_imbalance";
constexpr std::string_view kCauses[] = {kCogging, kImbalance};

double Straight(double, double wave_rad, double strength) { return strength * std::sin(wave_rad); }

double OfDetent(double harmonic, double wave_rad, double strength) {
  return kRadiansPerDegree * DetentError(harmonic, wave_rad / kRadiansPerDegree, strength);
}

// Ellipse and shifted circle: the field is 1 + strength exp(-i wave) in its own frame.
double OfField(double, double wave_rad, double strength) {
  return std::atan2(-strength * std::sin(wave_rad), 1 + strength * std::cos(wave_rad));
}

// The lost voltage points to the middle of the sixth of a turn that the field is in.
double OfDeadTime(double harmonic, double wave_rad, double strength) {
  const double within = std::remainder(wave_rad, 2 * std::numbers::pi) / harmonic;
  return std::atan2(strength * std::sin(within), 1 - strength * std::cos(within));
}

constexpr RotorWay kWays[] = {
    {kCogging, 1, 1, OfDetent},   {kCogging, 2, 1, OfDetent},   {kCogging, 4, 1, OfDetent},
    {kCogging, 6, 1, OfDetent},   {kCogging, 1, 1, Straight},   {kCogging, 2, 1, Straight},
    {kCogging, 4, 1, Straight},   {kCogging, 6, 1, Straight},   {kCogging, 1, 2, Straight},
    {kCogging, 2, 2, Straight},   {kCogging, 4, 2, Straight},   {kCogging, 6, 2, Straight},
    {kImbalance, 1, 1, OfField},  {kImbalance, 2, 0, OfField},  {kImbalance, 6, 1, OfDeadTime},
    {kImbalance, 1, 1, Straight}, {kImbalance, 2, 0, Straight}, {kImbalance, 6, 1, Straight}};

}  // namespace

std::span<const RotorWay> RotorWays() { return kWays; }

std::span<const std::string_view> RotorWayCauses() { return kCauses; }

bool HasRotorWays(std::string_view cause) { return std::ranges::count(kCauses, cause) != 0; }

double DetentError(double harmonic, double wave_deg, double detent) {
  // The lag nearest to zero: sin(lag) - detent sin(wave - n lag) goes from -sin(wave) to its first
  // zero.
  const double wave = wave_deg * kRadiansPerDegree;
  const auto excess = [&](double lag) {
    return std::sin(lag) - detent * std::sin(wave - harmonic * lag);
  };
  const double sign = std::sin(wave) >= 0 ? 1 : -1;
  const double step = 0.25 / std::max(harmonic, 1.0);
  double low = 0, high = 0;
  while (sign * excess(sign * high) < 0 && high < std::numbers::pi / 2) low = high, high += step;
  constexpr int kHalvings = 24;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    (sign * excess(sign * middle) < 0 ? low : high) = middle;
  }
  return -sign * (low + high) / 2 / kRadiansPerDegree;
}

}  // namespace focalfleet::sim
