#include "sim/campaigns/campaign/frames.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace focalfleet::sim {
namespace {

using Place = std::complex<double>;

struct Pair {
  Place expected, measured;
};

// Least squares, each pair with its weight.
Similarity WeightedFit(const std::vector<Pair>& pairs, const std::vector<double>& weights) {
  // Frames are of one camera. Half and twice of this would stop another factor where expected
  // places are nonsense, and those of real planes nowhere: focus scales by some thousandths.
  constexpr double kFactorOff = 0.5;
  double sum = 0;
  Place expected = 0, measured = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    sum += weights[k];
    expected += weights[k] * pairs[k].expected, measured += weights[k] * pairs[k].measured;
  }
  expected /= sum, measured /= sum;
  double square = 0;
  Place product = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const Place from_mean = pairs[k].expected - expected;
    square += weights[k] * std::norm(from_mean);
    product += weights[k] * std::conj(from_mean) * (pairs[k].measured - measured);
  }
  Similarity found;
  if (square > 0 && std::abs(product / square - 1.0) < kFactorOff) found.factor = product / square;
  found.shift_mm = measured - found.factor * expected;
  return found;
}

// Least distances, by weights that are one over the distance.
Similarity FitLeastDistances(const std::vector<Pair>& pairs) {
  constexpr int kRounds = 30;          // 15 end within 1 um of 60, where frames are 1 mm apart
  constexpr double kLeast_mm = 0.001;  // a distance counts as this at least: what a camera sees
  std::vector<double> weights(pairs.size(), 1);
  Similarity found = WeightedFit(pairs, weights);
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t k = 0; k < pairs.size(); ++k)
      weights[k] =
          1 / std::max(std::abs(pairs[k].measured - found.Of(pairs[k].expected)), kLeast_mm);
    found = WeightedFit(pairs, weights);
  }
  return found;
}

}  // namespace

Frames FindFrames(const Campaign& campaign) {
  const std::span<const double> ids = campaign.Find("frame_id");
  if (ids.empty()) return {};
  // NaN has no order: rows without a frame are behind all others.
  const auto key = [](double id) { return std::pair(std::isnan(id), std::isnan(id) ? 0 : id); };
  std::map<std::pair<bool, double>, std::size_t> rows;
  for (const double id : ids) ++rows[key(id)];
  const auto most =
      std::ranges::max_element(rows, {}, [](const auto& frame) { return frame.second; });
  Frames frames;
  std::map<std::pair<bool, double>, std::uint32_t> at;
  const auto add = [&](const std::pair<bool, double>& frame) {
    at[frame] = static_cast<std::uint32_t>(frames.id.size());
    frames.id.push_back(frame.first ? std::numeric_limits<double>::quiet_NaN() : frame.second);
  };
  add(most->first);
  for (const auto& [frame, count] : rows)
    if (frame != most->first) add(frame);
  if (frames.size() < 2) return frames;
  for (const double id : ids) frames.of_row.push_back(at.at(key(id)));
  return frames;
}

std::vector<Similarity> FitFrames(const Frames& frames, const Places& expected,
                                  const Places& measured) {
  std::vector<std::vector<Pair>> pairs(frames.size());
  for (std::size_t row = 0; row < frames.of_row.size(); ++row)
    if (std::isfinite(measured.x_mm[row]) && std::isfinite(expected.x_mm[row]))
      pairs[frames.of_row[row]].push_back(
          {{expected.x_mm[row], expected.y_mm[row]}, {measured.x_mm[row], measured.y_mm[row]}});
  std::vector<Similarity> found;
  for (const std::vector<Pair>& of_frame : pairs)
    found.push_back(of_frame.empty() ? Similarity{} : FitLeastDistances(of_frame));
  return found;
}

void TakeToOne(const Frames& frames, const std::vector<Similarity>& found, const Similarity& one,
               Places* measured) {
  for (std::size_t row = 0; row < frames.of_row.size(); ++row) {
    const Place place =
        one.Of(found[frames.of_row[row]].Undone({measured->x_mm[row], measured->y_mm[row]}));
    measured->x_mm[row] = place.real(), measured->y_mm[row] = place.imag();
  }
}

}  // namespace focalfleet::sim
