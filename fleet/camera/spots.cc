#include "fleet/camera/spots.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

std::string FaultOf(const Spot& spot, const SensorLimits& sensor) {
  if (!std::isfinite(spot.x_px) || !std::isfinite(spot.y_px)) return "its place is not finite";
  // The sensor extends half a pixel beyond the first and the last centre.
  if (spot.x_px < -0.5 || spot.y_px < -0.5 || spot.x_px > sensor.columns_px - 0.5 ||
      spot.y_px > sensor.rows_px - 0.5)
    return "it is off the sensor";
  if (!(spot.flux > 0) || !std::isfinite(spot.flux)) return "its flux is not above 0";
  if (!(spot.fwhm_px >= 0) || !std::isfinite(spot.fwhm_px)) return "its width is negative";
  return {};
}

std::uint64_t Mixed(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

std::string SecondsText(std::int64_t ns) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3f s", static_cast<double>(ns) * 1e-9);
  return text;
}

Status NoTwoAlike(const std::vector<Spot>& spots) {
  std::vector<std::uint32_t> order(spots.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return spots[a].id < spots[b].id; });
  for (std::size_t k = 1; k < order.size(); ++k)
    if (spots[order[k]].id == spots[order[k - 1]].id)
      return Fail(ErrorCode::kInvalid,
                  "spot " + std::to_string(spots[order[k]].id) + " is there twice");
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return spots[a].x_px != spots[b].x_px ? spots[a].x_px < spots[b].x_px
                                          : spots[a].y_px < spots[b].y_px;
  });
  for (std::size_t k = 1; k < order.size(); ++k) {
    const Spot& a = spots[order[k - 1]];
    const Spot& b = spots[order[k]];
    if (a.x_px == b.x_px && a.y_px == b.y_px)
      return Fail(ErrorCode::kInvalid, "spots " + std::to_string(std::min(a.id, b.id)) + " and " +
                                           std::to_string(std::max(a.id, b.id)) +
                                           " are at one place");
  }
  return {};
}

}  // namespace

Status CheckSpots(const Exposure& exposure, const SensorLimits& sensor) {
  if (exposure.spots.size() > limits::kSpotsPerExposure)
    return Fail(ErrorCode::kInvalid, std::to_string(exposure.spots.size()) +
                                         " spots are more than " +
                                         std::to_string(limits::kSpotsPerExposure));
  for (const Spot& spot : exposure.spots)
    if (std::string fault = FaultOf(spot, sensor); !fault.empty())
      return Fail(ErrorCode::kInvalid, "spot " + std::to_string(spot.id) + ": " + fault);
  return NoTwoAlike(exposure.spots);
}

const char* Name(RefusalReason reason) {
  constexpr const char* kNames[] = {"doubled",       "early",  "late",       "future", "count",
                                    "few_fiducials", "turned", "mirrored",   "scale",  "rotation",
                                    "shift",         "rough",  "other_field"};
  return kNames[static_cast<std::size_t>(reason)];
}

std::uint64_t ContentOf(const Exposure& exposure) {
  // A sum does not depend on the order. Each term is mixed, so that coordinates of two spots cannot
  // be exchanged without a change of the sum.
  std::uint64_t sum = exposure.spots.size();
  for (const Spot& spot : exposure.spots) {
    const std::uint64_t x = Mixed(std::bit_cast<std::uint64_t>(spot.x_px) + 0x9e3779b97f4a7c15u);
    const std::uint64_t y = Mixed(std::bit_cast<std::uint64_t>(spot.y_px) ^ x);
    sum += Mixed(std::bit_cast<std::uint64_t>(spot.flux) ^ y);
  }
  return sum;
}

std::optional<Refusal> Admit(const Exposure& exposure, const AdmissionRules& rules,
                             std::span<const SeenExposure> seen) {
  const std::string named = "exposure " + exposure.id;
  const std::uint64_t content = ContentOf(exposure);
  for (const SeenExposure& other : seen) {
    if (other.id == exposure.id)
      return Refusal{RefusalReason::kDoubled, named + " was there before"};
    if (other.content == content)
      return Refusal{RefusalReason::kDoubled, named + " has the spots of exposure " + other.id};
  }
  const std::int64_t taken = exposure.taken_unix_ns;
  if (taken > rules.now_unix_ns + rules.clock_slack_ns)
    return Refusal{RefusalReason::kFuture, named + " was taken " +
                                               SecondsText(taken - rules.now_unix_ns) +
                                               " from now: the clocks differ"};
  if (taken < rules.motion_end_unix_ns)
    return Refusal{RefusalReason::kEarly, named + " was taken " +
                                              SecondsText(rules.motion_end_unix_ns - taken) +
                                              " before the motion ended"};
  if (rules.now_unix_ns - taken > rules.age_max_ns)
    return Refusal{RefusalReason::kLate, named + " is " + SecondsText(rules.now_unix_ns - taken) +
                                             " old, more than " + SecondsText(rules.age_max_ns)};
  return std::nullopt;
}

}  // namespace focalfleet
