#include "fleet/camera/fiducials.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

namespace focalfleet {
namespace {

using Complex = std::complex<double>;

constexpr double kSearchFactor = 3;    // beyond the bounds, so that a refusal can give the reason
constexpr std::size_t kPairsMax = 60;  // of fiducials, tried one after the other
constexpr std::size_t kCandidatesMax = 64;  // of one fiducial
constexpr std::size_t kMatchesMin = 3;      // an alignment with fewer is none

Complex At(PointFp p) { return {p.x_mm, p.y_mm}; }
PointFp Point(Complex z) { return {z.real(), z.imag()}; }

struct Pair {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  double distance2 = 0;
};

// Wide pairs with each fiducial in few of them, so that one false light does not spoil all.
std::vector<Pair> WidePairs(std::span<const Fiducial> fiducials) {
  std::vector<Pair> pairs;
  for (std::uint32_t a = 0; a < fiducials.size(); ++a) {
    Pair widest{a, a, -1};
    for (std::uint32_t b = 0; b < fiducials.size(); ++b) {
      const double d2 = std::norm(At(fiducials[a].at_fp) - At(fiducials[b].at_fp));
      // Distances may be equal up to rounding on symmetric plates: the later one is taken, so that
      // partners differ.
      if (b != a && d2 >= widest.distance2) widest = {a, b, d2};
    }
    if (widest.distance2 > 0) pairs.push_back(widest);
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& x, const Pair& y) { return x.distance2 > y.distance2; });
  if (pairs.size() > kPairsMax) pairs.resize(kPairsMax);
  return pairs;
}

class Search {
 public:
  Search(std::span<const Fiducial> fiducials, std::span<const PointFp> seen_fp,
         const SpotGrid& grid, const CameraBounds& bounds)
      : fiducials_(fiducials), seen_(seen_fp), grid_(grid), bounds_(bounds) {
    enough_ = std::max(kMatchesMin, fiducials.size() * 4 / 5);
  }

  std::optional<Alignment> Best() {
    for (const Pair& pair : WidePairs(fiducials_)) {
      TryPair(pair);
      if (best_.matches.size() >= enough_) break;
    }
    const std::size_t least = std::max(kMatchesMin, (fiducials_.size() + 1) / 2);
    if (best_.matches.size() < least) return std::nullopt;
    return best_;
  }

 private:
  [[nodiscard]] std::vector<std::uint32_t> Candidates(std::uint32_t fiducial) const {
    const double off_axis_mm = std::abs(At(fiducials_[fiducial].at_fp));
    const double radius_mm =
        bounds_.distortion_mm_max +
        kSearchFactor *
            (bounds_.shift_mm_max +
             off_axis_mm * (bounds_.scale_max + bounds_.rotation_deg_max * std::numbers::pi / 180));
    std::vector<std::pair<double, std::uint32_t>> near;
    grid_.ForNear(fiducials_[fiducial].at_fp, radius_mm,
                  [&](std::uint32_t spot, double d2) { near.emplace_back(d2, spot); });
    std::sort(near.begin(), near.end());
    if (near.size() > kCandidatesMax) near.resize(kCandidatesMax);
    std::vector<std::uint32_t> spots;
    spots.reserve(near.size());
    for (const auto& [d2, spot] : near) spots.push_back(spot);
    return spots;
  }

  void TryPair(const Pair& pair) {
    const Complex fa = At(fiducials_[pair.a].at_fp);
    const Complex fb = At(fiducials_[pair.b].at_fp);
    const std::vector<std::uint32_t> near_b = Candidates(pair.b);
    for (const std::uint32_t sa : Candidates(pair.a)) {
      for (const std::uint32_t sb : near_b) {
        const Complex across = At(seen_[sb]) - At(seen_[sa]);
        if (sa == sb || std::norm(across) < pair.distance2 / 4) continue;
        const Complex gain = (fb - fa) / across;
        if (std::abs(std::abs(gain) - 1) > kSearchFactor * bounds_.scale_max + Slack(pair) ||
            std::abs(std::arg(gain)) >
                kSearchFactor * bounds_.rotation_deg_max * std::numbers::pi / 180 + Slack(pair))
          continue;
        Count(gain, fa - gain * At(seen_[sa]));
        if (best_.matches.size() >= enough_) return;
      }
    }
  }

  // The part of scale and rotation that the distortion at the two ends may add.
  [[nodiscard]] double Slack(const Pair& pair) const {
    return 2 * bounds_.distortion_mm_max / std::sqrt(pair.distance2);
  }

  void Count(Complex gain, Complex shift) {
    Alignment trial{gain, shift, {}};
    for (std::uint32_t f = 0; f < fiducials_.size(); ++f) {
      // The inverse leads back to where the model would see the fiducial: the grid is in that
      // frame.
      const PointFp seen = Point((At(fiducials_[f].at_fp) - shift) / gain);
      double nearest2 = std::numeric_limits<double>::infinity();
      std::uint32_t spot = 0;
      grid_.ForNear(seen, bounds_.distortion_mm_max, [&](std::uint32_t s, double d2) {
        if (d2 < nearest2) {
          nearest2 = d2;
          spot = s;
        }
      });
      if (std::isfinite(nearest2)) trial.matches.push_back({f, spot});
    }
    if (trial.matches.size() > best_.matches.size()) best_ = std::move(trial);
  }

  std::span<const Fiducial> fiducials_;
  std::span<const PointFp> seen_;
  const SpotGrid& grid_;
  const CameraBounds& bounds_;
  std::size_t enough_ = 0;
  Alignment best_;
};

std::string Beyond(const char* what, double value, double limit) {
  char text[96];
  std::snprintf(text, sizeof text, "%s by %.3g, more than %.3g", what, value, limit);
  return text;
}

}  // namespace

std::optional<Alignment> FindFiducials(std::span<const Fiducial> fiducials,
                                       std::span<const PointFp> seen_fp, const SpotGrid& grid,
                                       const CameraBounds& bounds) {
  return Search(fiducials, seen_fp, grid, bounds).Best();
}

std::optional<Refusal> OutOfBounds(const Alignment& alignment, const CameraBounds& bounds) {
  const double scale = std::abs(alignment.gain) - 1;
  const double rotation_deg = std::arg(alignment.gain) * 180 / std::numbers::pi;
  const double shift_mm = std::abs(alignment.shift);
  if (std::abs(scale) > bounds.scale_max)
    return Refusal{RefusalReason::kScale, Beyond("the scale is off", scale, bounds.scale_max)};
  if (std::abs(rotation_deg) > bounds.rotation_deg_max)
    return Refusal{RefusalReason::kRotation, Beyond("the picture is rotated, in degrees,",
                                                    rotation_deg, bounds.rotation_deg_max)};
  if (shift_mm > bounds.shift_mm_max)
    return Refusal{RefusalReason::kShift,
                   Beyond("the picture is shifted, in mm,", shift_mm, bounds.shift_mm_max)};
  return std::nullopt;
}

}  // namespace focalfleet
