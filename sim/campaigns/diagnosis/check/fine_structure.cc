#include "sim/campaigns/diagnosis/check/fine_structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <span>
#include <string>
#include <unsupported/Eigen/FFT>
#include <vector>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/model/chances.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kNext = 8;   // partners of a row, by rank
constexpr std::size_t kApart = 4;  // exposures; nearer ones may share the air
constexpr double kClip = 3;        // limits an outlier's weight to that of one row
constexpr double kPairsMin = 100;
// Distances that count as near, as a share of the column's range.
constexpr std::array kNear = {1.0 / 20000, 1.0 / 5000, 1.0 / 1250, 1.0 / 300, 1.0 / 80};

// Orders of a ripple beyond the screen's, in halves of one: bins are of two turns.
constexpr std::size_t kPairBins = 65536;
constexpr double kFolded_deg = 720;
constexpr std::size_t kBinOfOrder = 2, kOrderMin = 60, kOrders = 16000;

enum Channel { kAlongTheta, kAlongPhi, kAlongX, kAlongY, kChannels };
constexpr std::string_view kChannelName[] = {"theta angle", "phi angle", "x", "y"};

struct Row {
  double along[kChannels];  // whitened residual along a direction: variance about one
  double um[kChannels];     // um of one unit of `along`
};

// Values by which rows nearly repeat each other. Shapes: (rows).
struct Column {
  std::string name;
  std::vector<double> values;
  std::vector<double> sign;  // of the residuals; 0: the row has no part in it; empty: all +1
  std::vector<Channel> channels;
};

std::vector<Row> RowsOf(const Fit& fit) {
  std::vector<Row> rows(fit.weight.size());
  const std::vector<UnitChunk> chunks = ChunksOf(fit.model.units.size());
  fit.parallel(chunks.size(), [&](std::size_t chunk) {
    std::vector<double> weights;
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      const WhiteUnit white = WhitenAnew(fit, unit, &weights);
      for (std::size_t k = 0; k < white.moves.size(); ++k) {
        Row& row = rows[white.track.first_row + white.moves[k]];
        const double* t = &white.turn_um[4 * k];
        const double* w = white.filter[k].w;
        const double directions[kChannels][2] = {{t[0], t[1]}, {t[2], t[3]}, {1, 0}, {0, 1}};
        for (int c = 0; c < kChannels; ++c) {
          const double x = w[0] * directions[c][0] + w[1] * directions[c][1];
          const double y = w[1] * directions[c][0] + w[2] * directions[c][1];
          const double length = std::hypot(x, y);
          if (!(length > 0)) continue;
          const auto at = static_cast<Eigen::Index>(2 * k);
          row.along[c] =
              std::clamp((x * white.y[at] + y * white.y[at + 1]) / length, -kClip, kClip);
          row.um[c] = std::hypot(directions[c][0], directions[c][1]) / length;
        }
      }
    }
  });
  return rows;
}

// Whether a named cause reads the column, as a pixel's: structure along it is left by that cause's
// shape.
bool IsNamed(const CampaignModel& model, std::string_view column) {
  return std::ranges::any_of(model.terms, [&](const ModelTerm& term) {
    return std::ranges::find(term.form.effect->needs, column) != term.form.effect->needs.end();
  });
}

// The columns are angles as commanded and the distance from there. Others are gaps of arms that
// come near each other, and the spot's position on its pixel.
std::vector<Column> ColumnsOf(const CampaignFacts& facts, const CampaignModel& model) {
  const std::vector<Channel> angles = {kAlongTheta, kAlongPhi};
  std::vector<Column> columns;
  const auto take = [&](std::string_view name, std::vector<Channel> channels) -> Column* {
    const FilledColumn* column = facts.Find(name);
    if (column == nullptr || !column->varies() || IsNamed(model, name)) return nullptr;
    columns.push_back({std::string(name), column->values, {}, std::move(channels)});
    return &columns.back();
  };
  for (const std::size_t axis : {kTheta, kPhi}) take(kCommand[axis], angles);
  for (const std::size_t axis : {kTheta, kPhi}) take(kStep[axis], angles);
  if (Column* gap = take(kArmGap, {kAlongPhi})) gap->sign = facts.Find(kArmGapSide)->values;
  for (const auto& [name, channel] : {std::pair{"pixel_x", kAlongX}, {"pixel_y", kAlongY}})
    if (Column* pixel = take(name, {channel}))
      for (double& value : pixel->values) value -= std::floor(value);
  return columns;
}

struct Alike {
  double products = 0, squares = 0, both = 0, pairs = 0;
  void Add(double a, double b) {
    products += a * b;
    squares += a * a * b * b;
    both += (a * a + b * b) / 2;
    pairs += 1;
  }
  Alike& operator+=(const Alike& other) {
    products += other.products, squares += other.squares;
    both += other.both, pairs += other.pairs;
    return *this;
  }
  [[nodiscard]] double deviations() const { return products / std::sqrt(std::max(squares, 1e-12)); }
  [[nodiscard]] double share() const { return products / std::max(both, 1e-12); }
};

// The rows in the order of their values; equal ones at random, because neighbours in the table are
// of one unit.
std::vector<std::size_t> OrderOf(const Column& column, const Fit& fit) {
  std::vector<std::size_t> order;
  for (std::size_t row = 0; row < fit.weight.size(); ++row)
    if (fit.aside[row] == 0 && std::isfinite(fit.x_um[row]) &&
        (column.sign.empty() || column.sign[row] != 0))
      order.push_back(row);
  Rng rng = Rng::Stream(1, column.name);
  for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[rng.Below(k)]);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return column.values[a] < column.values[b];
  });
  return order;
}

// Root mean square of the noise along a direction, in um.
double SpreadOf(const std::vector<Row>& rows, Channel c) {
  double sum = 0, count = 0;
  for (const Row& row : rows)
    if (row.um[c] > 0) sum += row.um[c] * row.um[c], count += 1;
  return count > 0 ? std::sqrt(sum / count) : 0;
}

class Clearest {
 public:
  Clearest(double family_wise, double looks)
      : looks_(looks), least_(std::log(kShareOfSearch * family_wise)) {}

  void Look(double log_p, const UnknownFound& seen) {
    const double log_p_family = LogLeastOf(log_p, looks_);
    if (log_p_family >= least_) return;
    least_ = log_p_family;
    found_ = seen;
    found_->p_value = std::exp(log_p_family);
  }
  std::optional<UnknownFound> Take() { return std::move(found_); }

 private:
  double looks_;
  double least_;
  std::optional<UnknownFound> found_;
};

// ln of a normal deviate's one-sided tail probability.
double LogTail(double z) { return z > 0 ? LogChiSquareTail(z * z, 1) - std::numbers::ln2 : 0; }

// The gain of ln L by a share of the rows' variance.
double GainOfShare(double share, std::size_t rows) {
  return -static_cast<double>(rows) / 2 * std::log1p(-std::min(share, 0.99));
}

void LookAtRepeats(const Fit& fit, const std::vector<Row>& rows, const Column& column,
                   double share_min, Clearest* clearest) {
  const std::vector<std::uint32_t>& exposure = fit.facts->exposures.of_row;
  const std::vector<std::size_t> order = OrderOf(column, fit);
  if (order.empty()) return;
  const double range = column.values[order.back()] - column.values[order.front()];
  Alike alike[kNear.size()][kChannels];
  for (std::size_t k = 0; k < order.size(); ++k)
    for (std::size_t next = k + 1; next < std::min(order.size(), k + 1 + kNext); ++next) {
      const std::size_t a = order[k], b = order[next];
      const double distance = column.values[b] - column.values[a];
      const auto scale =
          std::ranges::find_if(kNear, [&](double near) { return distance <= near * range; });
      if (scale == kNear.end()) break;
      if (exposure[a] < exposure[b] + kApart && exposure[b] < exposure[a] + kApart) continue;
      const double sign = column.sign.empty() ? 1 : column.sign[a] * column.sign[b];
      for (const Channel c : column.channels)
        alike[scale - kNear.begin()][c].Add(sign * rows[a].along[c], rows[b].along[c]);
    }
  for (const Channel c : column.channels) {
    Alike sum;
    for (const auto& at_scale : alike) {
      sum += at_scale[c];
      if (sum.pairs < kPairsMin || sum.share() < share_min) continue;
      const double z = sum.deviations();
      clearest->Look(LogTail(z), {.covariate = column.name,
                                  .channel = std::string(kChannelName[c]),
                                  .size_um = std::sqrt(sum.share()) * SpreadOf(rows, c),
                                  .delta_log_likelihood = GainOfShare(sum.share(), order.size())});
    }
  }
}

// Whether the axis has just come to rest, so that its error is a new one.
bool Arrives(const CampaignFacts& facts, std::size_t axis, std::size_t row) {
  return facts.restarts[row] != 0 || facts.step_deg[axis][row] != 0;
}

void LookAtRipples(const Fit& fit, const std::vector<Row>& rows, std::size_t axis, double share_min,
                   Clearest* clearest) {
  const CampaignFacts& facts = *fit.facts;
  const Channel c = axis == kTheta ? kAlongTheta : kAlongPhi;
  const std::span<const double> angle_deg = facts.Find(kCommand[axis])->values;
  std::vector<std::size_t> arrivals;
  std::vector<double> at_angle(kPairBins, 0.0);
  double squares = 0;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const double along = rows[row].along[c];
    if (along == 0 || !Arrives(facts, axis, row)) continue;
    arrivals.push_back(row);
    const double turns = angle_deg[row] / kFolded_deg;
    const auto bin = static_cast<std::size_t>((turns - std::floor(turns)) * kPairBins);
    at_angle[std::min(bin, kPairBins - 1)] += along;
    squares += along * along;
  }
  if (static_cast<double>(arrivals.size()) < kPairsMin) return;
  std::vector<std::complex<double>> waves;
  Eigen::FFT<double>().fwd(waves, at_angle);
  std::size_t most = kBinOfOrder * kOrderMin;
  for (std::size_t k = most; k < most + kOrders; ++k)
    if (std::norm(waves[k]) > std::norm(waves[most])) most = k;
  // The common part of an exposure adds up at any phase: the spread of the exposures' sums is the
  // scale.
  const double order = static_cast<double>(most) / kBinOfOrder;
  std::vector<std::complex<double>> of_exposure(facts.exposures.size());
  std::complex<double> sum = 0;
  for (const std::size_t row : arrivals) {
    const std::complex<double> wave =
        rows[row].along[c] * std::polar(1.0, -order * angle_deg[row] * std::numbers::pi / 180);
    of_exposure[facts.exposures.of_row[row]] += wave;
    sum += wave;
  }
  double apart = 0;
  for (const std::complex<double>& one : of_exposure) apart += std::norm(one);
  const double share = 2 * std::norm(sum) / (static_cast<double>(arrivals.size()) * squares);
  if (share < share_min) return;
  // Waves may all be real, as at one angle: one degree of freedom is the worst.
  const double z2 = std::norm(sum) / std::max(apart, squares);
  clearest->Look(LogChiSquareTail(z2, 1),
                 {.covariate = std::string(kCommand[axis]),
                  .channel = std::string(kChannelName[c]),
                  .size_um = std::sqrt(share) * SpreadOf(rows, c),
                  .delta_log_likelihood = GainOfShare(share, arrivals.size())});
}

}  // namespace

std::optional<UnknownFound> FindFineStructure(const Fit& fit, double family_wise,
                                              double share_min) {
  const std::vector<Row> rows = RowsOf(fit);
  const std::vector<Column> columns = ColumnsOf(*fit.facts, fit.model);
  double looks = 2 * kOrders;
  for (const Column& column : columns)
    looks += static_cast<double>(column.channels.size() * kNear.size());
  Clearest clearest(family_wise, looks);
  for (const Column& column : columns) LookAtRepeats(fit, rows, column, share_min, &clearest);
  for (const std::size_t axis : {kTheta, kPhi})
    LookAtRipples(fit, rows, axis, share_min, &clearest);
  return clearest.Take();
}

}  // namespace focalfleet::sim
