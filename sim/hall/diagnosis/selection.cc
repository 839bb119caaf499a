#include "sim/hall/diagnosis/selection.h"

#include <algorithm>
#include <cmath>

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kGateSigmas = 4.6;
constexpr double kRivalMargin = 9;
constexpr int kCausesMax = 12;
constexpr std::size_t kRivalsTried = 4;
constexpr double kDecays[] = {-5, -3, -1, 0, 1, 3, 4.5, 6, 7.5};

std::vector<HallHypothesis> MakeHypotheses(const ParameterLayout& layout, bool temperature) {
  std::vector<HallHypothesis> list;
  HallHypothesis gains{HallCause::kSensorGain, {}, {}, 0};
  HallHypothesis offsets{HallCause::kSensorOffset, {}, {}, 0};
  HallHypothesis shifts{HallCause::kSensorPosition, {}, {}, 0};
  for (std::size_t s = 0; s < layout.sensors; ++s) {
    list.push_back({HallCause::kSensorGain, {layout.gain(s)}, {s}, 0});
    list.push_back({HallCause::kSensorOffset, {layout.offset(s)}, {s}, 0});
    list.push_back({HallCause::kSensorPosition, {layout.shift(s), layout.shift(s) + 1}, {s}, 0});
    gains.sensors.push_back(s);
    gains.parameters.push_back(layout.gain(s));
    offsets.parameters.push_back(layout.offset(s));
    shifts.parameters.push_back(layout.shift(s));
    shifts.parameters.push_back(layout.shift(s) + 1);
  }
  offsets.sensors = shifts.sensors = gains.sensors;
  list.push_back(gains);
  list.push_back(offsets);
  list.push_back(shifts);
  list.push_back({HallCause::kFieldWidth, {ParameterLayout::kWidth}, {}, 0});
  if (temperature)
    list.push_back({HallCause::kTemperatureCoefficient, {ParameterLayout::kTemperature}, {}, 0});
  for (const double decay : kDecays)
    list.push_back({HallCause::kCentreOffset,
                    {ParameterLayout::kCentre, ParameterLayout::kCentre + 1,
                     ParameterLayout::kCentre + 2, ParameterLayout::kDecay},
                    {},
                    decay});
  for (std::size_t k = 0; k < layout.terms.size(); ++k) {
    HallHypothesis term{HallCause::kFieldHarmonics, {layout.term(k)}, {}, 0};
    const bool pair = k + 1 < layout.terms.size() && layout.terms[k + 1].sine;
    if (pair) term.parameters.push_back(layout.term(k + 1));
    list.push_back(term);
    if (pair) ++k;
  }
  for (std::size_t k = 0; k < layout.effects.size(); ++k)
    list.push_back({HallCause::kOutside, {layout.effect(k)}, {}, 0});
  return list;
}

bool Touches(const HallHypothesis& one, const std::vector<std::size_t>& free) {
  return std::all_of(one.parameters.begin(), one.parameters.end(), [&](std::size_t parameter) {
    return std::find(free.begin(), free.end(), parameter) != free.end();
  });
}

}  // namespace

double ChanceChi2(std::size_t freedom, double sigmas) {
  const auto k = static_cast<double>(freedom);
  const double root = 1 - 2 / (9 * k) + sigmas * std::sqrt(2 / (9 * k));
  return k * root * root * root;
}

double ChanceOf(double chi2, std::size_t freedom) {
  const auto k = static_cast<double>(freedom);
  const double z =
      (std::cbrt(std::max(0.0, chi2) / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

HallSearch::HallSearch(const HallForward& forward, const HallCampaign& campaign,
                       std::vector<Reading> readings)
    : forward_(forward),
      campaign_(campaign),
      readings_(std::move(readings)),
      hypotheses_(MakeHypotheses(forward.layout(), campaign.has_temperature)) {
  TakeMeasured();
}

void HallSearch::TakeMeasured() {
  measured_V_.resize(At(readings_.size()));
  for (std::size_t k = 0; k < readings_.size(); ++k)
    measured_V_[At(k)] = campaign_.rows[readings_[k].row].voltages_V[readings_[k].sensor];
}

HallFit HallSearch::Free() const { return Fit({}, VectorXd::Zero(At(forward_.layout().size()))); }

HallFit HallSearch::Fit(const std::vector<HallHypothesis>& on, const VectorXd& start) const {
  HallFit fit;
  fit.parameters = start;
  fit.free = {ParameterLayout::kAmplitude, ParameterLayout::kPhase};
  for (const HallHypothesis& hypothesis : on) {
    for (const std::size_t parameter : hypothesis.parameters)
      if (std::find(fit.free.begin(), fit.free.end(), parameter) == fit.free.end())
        fit.free.push_back(parameter);
    if (hypothesis.cause == HallCause::kCentreOffset &&
        fit.parameters[At(ParameterLayout::kDecay)] == 0)
      fit.parameters[At(ParameterLayout::kDecay)] = hypothesis.decay;
  }
  VectorXd predicted;
  const auto squares_at = [&](const VectorXd& parameters, VectorXd* residuals) {
    forward_.Predict(parameters, readings_, &predicted);
    *residuals = measured_V_ - predicted;
    return residuals->squaredNorm();
  };
  fit.squares = squares_at(fit.parameters, &fit.residuals);
  double damping = 1e-6;
  MatrixXd normal;
  for (int step = 0; step < 30; ++step) {
    const MatrixXd slopes = forward_.Slopes(fit.parameters, readings_, fit.free);
    normal = slopes.transpose() * slopes;
    const VectorXd right = slopes.transpose() * fit.residuals;
    bool better = false;
    double gain = 0;
    for (int trial = 0; trial < 8 && !better; ++trial) {
      MatrixXd damped = normal;
      for (Index i = 0; i < damped.rows(); ++i)
        damped(i, i) += damping * normal(i, i) + 1e-12 * (normal.diagonal().mean() + 1e-12);
      const VectorXd change = damped.ldlt().solve(right);
      VectorXd moved = fit.parameters;
      for (std::size_t k = 0; k < fit.free.size(); ++k)
        moved[At(fit.free[k])] += std::clamp(change[At(k)], -5.0, 5.0);
      moved[At(ParameterLayout::kDecay)] =
          std::clamp(moved[At(ParameterLayout::kDecay)], -12.0, 15.0);
      moved[At(ParameterLayout::kWidth)] =
          std::clamp(moved[At(ParameterLayout::kWidth)], -1.5, 1.5);
      VectorXd residuals;
      const double squares = squares_at(moved, &residuals);
      if (std::isfinite(squares) && squares <= fit.squares) {
        gain = fit.squares - squares;
        fit.parameters = moved;
        fit.squares = squares;
        fit.residuals = residuals;
        damping = std::max(1e-9, damping / 10);
        better = true;
      } else {
        damping *= 30;
      }
    }
    if (!better || gain < 1e-7 * fit.squares + 1e-18) break;
  }
  for (Index i = 0; i < normal.rows(); ++i)
    normal(i, i) += 1e-12 * (normal.diagonal().mean() + 1e-12);
  fit.covariance = normal.ldlt().solve(MatrixXd::Identity(normal.rows(), normal.cols()));
  return fit;
}

HallSearch::Rich HallSearch::AllFree(const HallFit& fit) const {
  std::vector<std::size_t> all;
  for (std::size_t k = 0; k < forward_.layout().library(); ++k) {
    if (k == ParameterLayout::kDecay) continue;
    if (k == ParameterLayout::kTemperature && !campaign_.has_temperature) continue;
    all.push_back(k);
  }
  const MatrixXd slopes = forward_.Slopes(fit.parameters, readings_, all);
  MatrixXd normal = slopes.transpose() * slopes;
  for (Index i = 0; i < normal.rows(); ++i) normal(i, i) += 1e-9 * normal(i, i) + 1e-12;
  const VectorXd solution = normal.ldlt().solve(slopes.transpose() * fit.residuals);
  Rich rich;
  rich.residuals = fit.residuals - slopes * solution;
  const double freedom =
      std::max(1.0, static_cast<double>(readings_.size()) - static_cast<double>(all.size()));
  rich.variance = rich.residuals.squaredNorm() / freedom;
  return rich;
}

std::vector<double> HallSearch::Explained(const HallFit& fit) const {
  const MatrixXd fixed = forward_.Slopes(fit.parameters, readings_, fit.free);
  const Eigen::HouseholderQR<MatrixXd> factor(fixed);
  const MatrixXd basis = factor.householderQ() * MatrixXd::Identity(fixed.rows(), fixed.cols());
  const auto projected = [&](const MatrixXd& columns) {
    return MatrixXd(columns - basis * (basis.transpose() * columns));
  };
  const VectorXd rest = projected(fit.residuals);
  const ParameterLayout& layout = forward_.layout();
  MatrixXd effects;
  if (!layout.effects.empty())
    effects = projected(forward_.EffectSlopes(fit.parameters, readings_));
  const bool centre_on = fit.parameters[At(ParameterLayout::kCentre)] != 0;
  std::vector<double> explained;
  for (const HallHypothesis& hypothesis : hypotheses_) {
    if (Touches(hypothesis, fit.free) ||
        (centre_on && hypothesis.cause == HallCause::kCentreOffset)) {
      explained.push_back(0);
      continue;
    }
    if (hypothesis.cause == HallCause::kOutside) {
      const auto own = effects.col(At(hypothesis.parameters.front() - layout.library()));
      const double right = own.dot(rest);
      explained.push_back(right * right / (own.squaredNorm() + 1e-15));
      continue;
    }
    VectorXd at = fit.parameters;
    std::vector<std::size_t> chosen;
    for (const std::size_t parameter : hypothesis.parameters)
      if (parameter != ParameterLayout::kDecay &&
          std::find(fit.free.begin(), fit.free.end(), parameter) == fit.free.end())
        chosen.push_back(parameter);
    if (hypothesis.cause == HallCause::kCentreOffset)
      at[At(ParameterLayout::kDecay)] = hypothesis.decay;
    const MatrixXd own = projected(forward_.Slopes(at, readings_, chosen));
    MatrixXd normal = own.transpose() * own;
    for (Index i = 0; i < normal.rows(); ++i) normal(i, i) += 1e-9 * normal.trace() + 1e-15;
    const VectorXd right = own.transpose() * rest;
    explained.push_back(right.dot(normal.ldlt().solve(right)));
  }
  return explained;
}

namespace {

// The evidence of a hypothesis that explains `squares`.
double Score(double squares, double variance, std::size_t freedom, std::size_t readings) {
  return squares / variance -
         static_cast<double>(freedom) * std::log(static_cast<double>(readings));
}

// 0.01 % of the range: a field model itself is no better, and a smaller effect calls for no action.
constexpr double kLeast_V = 2.5e-4;
double Variance(const HallSearch::Rich& rich) {
  return std::max(rich.variance, kLeast_V * kLeast_V);
}

std::size_t Best(const HallSearch& search, const std::vector<double>& explained, double variance) {
  std::size_t best = search.hypotheses().size();
  double score = 0;
  for (std::size_t k = 0; k < explained.size(); ++k) {
    const std::size_t freedom = search.hypotheses()[k].parameters.size();
    if (explained[k] / variance < ChanceChi2(freedom, kGateSigmas)) continue;
    const double own = Score(explained[k], variance, freedom, search.readings().size());
    if (own > score) {
      score = own;
      best = k;
    }
  }
  return best;
}

std::vector<HallHypothesis> Without(const std::vector<HallHypothesis>& on, std::size_t k) {
  std::vector<HallHypothesis> rest = on;
  rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(k));
  return rest;
}

VectorXd Cleared(VectorXd parameters, const HallHypothesis& hypothesis) {
  for (const std::size_t parameter : hypothesis.parameters) parameters[At(parameter)] = 0;
  return parameters;
}

void Grow(const HallSearch& search, Selected* selected) {
  while (selected->on.size() < kCausesMax) {
    const std::size_t best = Best(search, search.Explained(selected->fit), selected->variance);
    if (best == search.hypotheses().size()) return;
    std::vector<HallHypothesis> more = selected->on;
    more.push_back(search.hypotheses()[best]);
    HallFit fit = search.Fit(more, selected->fit.parameters);
    if (fit.squares >= selected->fit.squares) return;
    selected->on = std::move(more);
    selected->fit = std::move(fit);
    selected->variance = Variance(search.AllFree(selected->fit));
  }
}

void Prune(const HallSearch& search, Selected* selected) {
  for (std::size_t k = 0; k < selected->on.size();) {
    const HallFit without =
        search.Fit(Without(selected->on, k), Cleared(selected->fit.parameters, selected->on[k]));
    const std::size_t freedom = selected->on[k].parameters.size();
    const double chi2 = (without.squares - selected->fit.squares) / selected->variance;
    if (chi2 >= ChanceChi2(freedom, kGateSigmas) &&
        Score(chi2, 1, freedom, search.readings().size()) > 0) {
      ++k;
      continue;
    }
    selected->on = Without(selected->on, k);
    selected->fit = without;
  }
}

// Compares an accepted hypothesis with its rivals. True: a rival was better and took its place.
bool Swap(const HallSearch& search, std::size_t k, Selected* selected) {
  const HallHypothesis own = selected->on[k];
  const std::vector<HallHypothesis> rest = Without(selected->on, k);
  const HallFit without = search.Fit(rest, Cleared(selected->fit.parameters, own));
  const double variance = selected->variance;
  const std::size_t n = search.readings().size();
  const double own_score =
      Score(without.squares - selected->fit.squares, variance, own.parameters.size(), n);
  const std::vector<double> explained = search.Explained(without);
  std::vector<std::size_t> order;
  for (std::size_t h = 0; h < explained.size(); ++h)
    if (search.hypotheses()[h].cause != own.cause) order.push_back(h);
  const auto linear = [&](std::size_t h) {
    return Score(explained[h], variance, search.hypotheses()[h].parameters.size(), n);
  };
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return linear(a) > linear(b); });
  selected->rivals[k].clear();
  std::size_t tried = 0;
  std::vector<HallCause> causes_tried;
  for (std::size_t r = 0; r < order.size() && tried < kRivalsTried; ++r) {
    const HallHypothesis& rival = search.hypotheses()[order[r]];
    if (std::count(causes_tried.begin(), causes_tried.end(), rival.cause) >= 2) continue;
    causes_tried.push_back(rival.cause);
    ++tried;
    // The rival is far behind already in the linear estimate, which is the most that it has.
    if (linear(order[r]) < 0.5 * own_score - 20) break;
    std::vector<HallHypothesis> with = rest;
    with.push_back(rival);
    HallFit fit = search.Fit(with, without.parameters);
    const double score = Score(without.squares - fit.squares, variance, rival.parameters.size(), n);
    if (score > own_score + 1e-6) {
      selected->on[k] = rival;
      // The fit is kept in place of the former one.
      selected->fit = search.Fit(selected->on, fit.parameters);
      selected->variance = Variance(search.AllFree(selected->fit));
      return true;
    }
    auto& list = selected->rivals[k];
    if (score > own_score - kRivalMargin &&
        std::find(list.begin(), list.end(), rival.cause) == list.end())
      list.push_back(rival.cause);
  }
  return false;
}

}  // namespace

Selected SelectHall(const HallSearch& search) {
  Selected selected;
  selected.fit = search.Free();
  selected.variance = Variance(search.AllFree(selected.fit));
  for (int round = 0; round < 4; ++round) {
    Grow(search, &selected);
    Prune(search, &selected);
    selected.rivals.assign(selected.on.size(), {});
    bool swapped = false;
    for (std::size_t k = 0; k < selected.on.size() && !swapped; ++k)
      swapped = Swap(search, k, &selected);
    if (!swapped) break;
  }
  return selected;
}

}  // namespace focalfleet::sim
