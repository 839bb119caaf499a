#include "fleet/camera/plate_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "fleet/camera/camera_model.h"
#include "fleet/camera/cholesky.h"

namespace focalfleet {
namespace {

constexpr std::size_t kLightsPerTerm = 3;  // the degree falls where there are fewer
constexpr double kNodesMax = 2500;         // of the grid, about; the step grows beyond
constexpr double kNoiseMinMm = 1e-5;       // keeps the matrix positive definite

using Terms = std::array<double, kDistortionTermsMax>;

Terms TermsAt(PointFp p, double radius_mm, int degree) {
  Terms terms{};
  Monomials(p.x_mm / radius_mm, p.y_mm / radius_mm, degree, terms);
  return terms;
}

PointFp Polynomial(std::span<const PointFp> coefficients, const Terms& terms) {
  PointFp sum;
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    sum.x_mm += coefficients[k].x_mm * terms[k];
    sum.y_mm += coefficients[k].y_mm * terms[k];
  }
  return sum;
}

PointFp Residual(const KnownLight& light, const PolynomialFit& fit, double radius_mm) {
  const PointFp p = Polynomial(fit.coefficients, TermsAt(light.seen_fp, radius_mm, fit.degree));
  return {light.true_fp.x_mm - light.seen_fp.x_mm - p.x_mm,
          light.true_fp.y_mm - light.seen_fp.y_mm - p.y_mm};
}

bool SolveOnce(std::span<const KnownLight> lights, double radius_mm, PolynomialFit* fit) {
  const std::size_t n = MonomialCount(fit->degree);
  std::vector<double> normal(n * n, 0);
  std::vector<double> x_mm(n, 0);
  std::vector<double> y_mm(n, 0);
  for (std::size_t k = 0; k < lights.size(); ++k) {
    if (!fit->used[k]) continue;
    const Terms terms = TermsAt(lights[k].seen_fp, radius_mm, fit->degree);
    for (std::size_t i = 0; i < n; ++i) {
      x_mm[i] += terms[i] * (lights[k].true_fp.x_mm - lights[k].seen_fp.x_mm);
      y_mm[i] += terms[i] * (lights[k].true_fp.y_mm - lights[k].seen_fp.y_mm);
      for (std::size_t j = 0; j <= i; ++j) normal[i * n + j] += terms[i] * terms[j];
    }
  }
  const auto factor = Cholesky::Of(std::move(normal), n);
  if (!factor) return false;
  factor->Solve(x_mm);
  factor->Solve(y_mm);
  fit->coefficients.resize(n);
  for (std::size_t k = 0; k < n; ++k) fit->coefficients[k] = {x_mm[k], y_mm[k]};
  return true;
}

// A sigma from the median distance of the lights in use: one wild light does not change it.
double RobustSigma(std::vector<double> distances) {
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle / 1.1774;  // the median of a Rayleigh distribution
}

int DegreeFor(std::size_t lights, int degree_max) {
  int degree = 1;
  while (degree < degree_max && MonomialCount(degree + 1) * kLightsPerTerm <= lights) ++degree;
  return degree;
}

// Makes one pass: puts aside lights beyond the gate and takes back those within. True: nothing
// changed.
bool Sort(std::span<const KnownLight> lights, const PlateMapOptions& options, PolynomialFit* fit) {
  std::vector<double> distance(lights.size());
  std::vector<double> of_used;
  for (std::size_t k = 0; k < lights.size(); ++k) {
    const PointFp r = Residual(lights[k], *fit, options.radius_mm);
    distance[k] = std::hypot(r.x_mm, r.y_mm);
    if (fit->used[k]) of_used.push_back(distance[k]);
  }
  const double gate =
      std::max(options.residual_mm_min, options.outlier_sigmas * RobustSigma(of_used));
  bool same = true;
  fit->used_count = 0;
  double sum2 = 0;
  for (std::size_t k = 0; k < lights.size(); ++k) {
    const bool use = distance[k] <= gate;
    same = same && use == fit->used[k];
    fit->used[k] = use;
    if (!use) continue;
    ++fit->used_count;
    sum2 += distance[k] * distance[k];
  }
  const auto count = static_cast<double>(fit->used_count);
  const double freedom = std::max(1.0, count - static_cast<double>(fit->coefficients.size()));
  fit->residual_mm = std::sqrt(sum2 / 2 / freedom);
  return same;
}

}  // namespace

std::optional<PolynomialFit> FitPolynomial(std::span<const KnownLight> lights,
                                           const PlateMapOptions& options) {
  PolynomialFit fit;
  fit.used.assign(lights.size(), true);
  fit.used_count = lights.size();
  const int top = DegreeFor(lights.size(), std::min(options.degree, kDistortionDegreeMax));
  // Low degrees come first: a light that is far off is put aside before it can bend a high degree.
  for (fit.degree = 1; fit.degree <= top; ++fit.degree) {
    for (int pass = 0; pass < 6; ++pass) {
      if (fit.used_count < 3 || fit.used_count < MonomialCount(fit.degree)) return std::nullopt;
      if (!SolveOnce(lights, options.radius_mm, &fit)) return std::nullopt;
      if (Sort(lights, options, &fit)) break;
    }
  }
  fit.degree = top;
  if (fit.used_count < 3 || !SolveOnce(lights, options.radius_mm, &fit)) return std::nullopt;
  return fit;
}

PointFp PlateBy(const PolynomialFit& fit, const PlateMapOptions& options, PointFp seen_fp) {
  const PointFp p = Polynomial(fit.coefficients, TermsAt(seen_fp, options.radius_mm, fit.degree));
  return {seen_fp.x_mm + p.x_mm, seen_fp.y_mm + p.y_mm};
}

// The factored matrices C and F'C^-1F, and what is needed at each place.
class PlateSolution {
 public:
  PlateSolution(std::span<const KnownLight> lights, int degree, const AirLaw& air,
                const PlateMapOptions& options)
      : lights_(lights),
        n_(lights.size()),
        terms_(MonomialCount(degree)),
        degree_(degree),
        air2_(air.sigma_mm * air.sigma_mm),
        length_mm_(air.length_mm),
        radius_mm_(options.radius_mm) {}

  bool Solve() {
    std::vector<double> covariance(n_ * n_, 0);
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; air2_ > 0 && j < i; ++j)
        covariance[i * n_ + j] = Covariance(lights_[i].seen_fp, lights_[j].seen_fp);
      const double noise = std::max(kNoiseMinMm, lights_[i].noise_mm);
      covariance[i * n_ + i] = air2_ + noise * noise;
    }
    of_lights_ = Cholesky::Of(std::move(covariance), n_);
    if (!of_lights_) return false;
    // Column t of F, whitened: row t here.
    whitened_.assign(terms_ * n_, 0);
    for (std::size_t k = 0; k < n_; ++k) {
      const Terms f = TermsAt(lights_[k].seen_fp, radius_mm_, degree_);
      for (std::size_t t = 0; t < terms_; ++t) whitened_[t * n_ + k] = f[t];
    }
    for (std::size_t t = 0; t < terms_; ++t)
      of_lights_->SolveLower(std::span(whitened_).subspan(t * n_, n_));
    std::vector<double> normal(terms_ * terms_, 0);
    for (std::size_t t = 0; t < terms_; ++t)
      for (std::size_t u = 0; u <= t; ++u)
        normal[t * terms_ + u] = Dot(&whitened_[t * n_], &whitened_[u * n_], n_);
    of_terms_ = Cholesky::Of(std::move(normal), terms_);
    if (!of_terms_) return false;
    x_ = Coordinate([](PointFp p) { return p.x_mm; });
    y_ = Coordinate([](PointFp p) { return p.y_mm; });
    return true;
  }

  [[nodiscard]] std::vector<PointFp> Coefficients() const {
    std::vector<PointFp> both(terms_);
    for (std::size_t t = 0; t < terms_; ++t) both[t] = {x_.coefficients[t], y_.coefficients[t]};
    return both;
  }

  /// Minus the logarithm of the restricted likelihood, but for a constant.
  [[nodiscard]] double Unlikelihood() const {
    return of_lights_->LogDeterminant() + of_terms_->LogDeterminant() +
           (x_.squared_sigmas + y_.squared_sigmas) / 2;
  }

  [[nodiscard]] PointFp AirAt(PointFp p) {
    SetCovariances(p);
    return {Dot(scratch_.data(), x_.weights.data(), n_),
            Dot(scratch_.data(), y_.weights.data(), n_)};
  }

  /// Variance of the air's part and the polynomial together. Units: mm^2, of one coordinate.
  [[nodiscard]] double VarianceAt(PointFp p) {
    SetCovariances(p);
    of_lights_->SolveLower(scratch_);
    Terms f = TermsAt(p, radius_mm_, degree_);
    for (std::size_t t = 0; t < terms_; ++t) f[t] -= Dot(&whitened_[t * n_], scratch_.data(), n_);
    of_terms_->SolveLower(std::span<double>(f.data(), terms_));
    return std::max(0.0, air2_ - Dot(scratch_.data(), scratch_.data(), n_)) +
           Dot(f.data(), f.data(), terms_);
  }

 private:
  struct Solved {
    std::vector<double> coefficients;
    std::vector<double> weights;  // C^-1 (y - F b)
    double squared_sigmas = 0;    // (y - F b)' C^-1 (y - F b)
  };

  void SetCovariances(PointFp p) {
    scratch_.resize(n_);
    for (std::size_t k = 0; k < n_; ++k)
      scratch_[k] = air2_ > 0 ? Covariance(p, lights_[k].seen_fp) : 0;
  }

  [[nodiscard]] double Covariance(PointFp p, PointFp q) const {
    const double dx = (p.x_mm - q.x_mm) / length_mm_;
    const double dy = (p.y_mm - q.y_mm) / length_mm_;
    return air2_ * std::exp(-0.5 * (dx * dx + dy * dy));
  }

  template <class Pick>
  [[nodiscard]] Solved Coordinate(Pick pick) const {
    Solved solved;
    solved.weights.resize(n_);
    for (std::size_t k = 0; k < n_; ++k)
      solved.weights[k] = pick(lights_[k].true_fp) - pick(lights_[k].seen_fp);
    of_lights_->SolveLower(solved.weights);
    solved.coefficients.resize(terms_);
    for (std::size_t t = 0; t < terms_; ++t)
      solved.coefficients[t] = Dot(&whitened_[t * n_], solved.weights.data(), n_);
    of_terms_->Solve(solved.coefficients);
    for (std::size_t t = 0; t < terms_; ++t)
      for (std::size_t k = 0; k < n_; ++k)
        solved.weights[k] -= solved.coefficients[t] * whitened_[t * n_ + k];
    solved.squared_sigmas = Dot(solved.weights.data(), solved.weights.data(), n_);
    of_lights_->SolveUpper(solved.weights);
    return solved;
  }

  std::span<const KnownLight> lights_;
  std::size_t n_;
  std::size_t terms_;
  int degree_;
  double air2_;
  double length_mm_;
  double radius_mm_;
  std::optional<Cholesky> of_lights_;
  std::optional<Cholesky> of_terms_;
  std::vector<double> whitened_;  // Shape: (terms, lights)
  Solved x_;
  Solved y_;
  std::vector<double> scratch_;
};

namespace {

// Laws on a lattice: sigma = usual 1.5^j, length = usual 1.5^i.
class AirSearch {
 public:
  AirSearch(std::span<const KnownLight> lights, int degree, const PlateMapOptions& options)
      : degree_(degree), options_(options) {
    const std::size_t stride = (lights.size() + kLightsMax - 1) / kLightsMax;
    for (std::size_t k = 0; k < lights.size(); k += stride) lights_.push_back(lights[k]);
  }

  AirLaw Likeliest() {
    int i = 0;
    int j = 0;
    for (bool climbing = true; climbing;) {
      climbing = false;
      constexpr std::array<std::array<int, 2>, 4> kSteps = {{{0, 1}, {0, -1}, {1, 0}, {-1, 0}}};
      for (const auto& step : kSteps) {
        if (At(i + step[0], j + step[1]) >= At(i, j)) continue;
        i += step[0];
        j += step[1];
        climbing = true;
      }
    }
    return LawAt(i, j);
  }

 private:
  [[nodiscard]] AirLaw LawAt(int i, int j) const {
    return {options_.usual_air.sigma_mm * std::pow(kFactor, j),
            options_.usual_air.length_mm * std::pow(kFactor, i)};
  }

  double At(int i, int j) {
    if (std::abs(i) > kStepsMax || std::abs(j) > kStepsMax)
      return std::numeric_limits<double>::infinity();
    const std::size_t key =
        static_cast<std::size_t>(i + kStepsMax) * kSide + static_cast<std::size_t>(j + kStepsMax);
    if (known_[key]) return *known_[key];
    PlateSolution solution(lights_, degree_, LawAt(i, j), options_);
    const double of_length = i * std::log(kFactor) / kLengthPrior;
    const double of_sigma = j * std::log(kFactor) / kSigmaPrior;
    known_[key] = solution.Solve()
                      ? solution.Unlikelihood() + (of_length * of_length + of_sigma * of_sigma) / 2
                      : std::numeric_limits<double>::infinity();
    return *known_[key];
  }

  static constexpr std::size_t kLightsMax = 150;  // of one factorisation
  static constexpr int kStepsMax = 6;
  static constexpr std::size_t kSide = 2 * kStepsMax + 1;
  static constexpr double kFactor = 1.5;       // from one law of the lattice to the next
  static constexpr double kLengthPrior = 0.7;  // standard deviations of the logarithms
  static constexpr double kSigmaPrior = 1;

  int degree_;
  const PlateMapOptions& options_;
  std::vector<KnownLight> lights_;
  std::array<std::optional<double>, kSide * kSide> known_;
};

}  // namespace

AirLaw AirOf(std::span<const KnownLight> lights, int degree, const PlateMapOptions& options) {
  return AirSearch(lights, degree, options).Likeliest();
}

std::optional<PlateMap> PlateMap::Solve(std::span<const KnownLight> lights, int degree,
                                        const AirLaw& air, const PlateMapOptions& options) {
  PlateSolution solution(lights, degree, air, options);
  if (lights.size() < MonomialCount(degree) || !solution.Solve()) return std::nullopt;
  PlateMap map;
  map.light_count_ = lights.size();
  map.degree_ = degree;
  map.radius_mm_ = options.radius_mm;
  map.coefficients_ = solution.Coefficients();
  map.low_ = lights.front().seen_fp;
  PointFp high = map.low_;
  for (const KnownLight& light : lights) {
    map.low_ = {std::min(map.low_.x_mm, light.seen_fp.x_mm),
                std::min(map.low_.y_mm, light.seen_fp.y_mm)};
    high = {std::max(high.x_mm, light.seen_fp.x_mm), std::max(high.y_mm, light.seen_fp.y_mm)};
  }
  // Units stand a little outside the outermost fiducials.
  const double margin = air.length_mm / 2;
  map.low_ = {map.low_.x_mm - margin, map.low_.y_mm - margin};
  const double width = high.x_mm + margin - map.low_.x_mm;
  const double height = high.y_mm + margin - map.low_.y_mm;
  map.step_mm_ = std::max(air.length_mm / 3, std::sqrt(width * height / kNodesMax));
  // The counts are odd: every node without a variance of its own lies between two that have one.
  map.columns_ = static_cast<std::size_t>(width / map.step_mm_ / 2) * 2 + 3;
  map.rows_ = static_cast<std::size_t>(height / map.step_mm_ / 2) * 2 + 3;
  map.nodes_.resize(map.columns_ * map.rows_);
  map.FillNodes(&solution);
  return map;
}

void PlateMap::FillNodes(PlateSolution* solution) {
  const auto node = [this](std::size_t row, std::size_t column) -> Node& {
    return nodes_[row * columns_ + column];
  };
  for (std::size_t row = 0; row < rows_; ++row)
    for (std::size_t column = 0; column < columns_; ++column) {
      const PointFp p{low_.x_mm + static_cast<double>(column) * step_mm_,
                      low_.y_mm + static_cast<double>(row) * step_mm_};
      node(row, column).air_fp = solution->AirAt(p);
      if (row % 2 == 0 && column % 2 == 0) node(row, column).variance_mm2 = solution->VarianceAt(p);
    }
  for (std::size_t row = 0; row < rows_; row += 2)
    for (std::size_t column = 1; column < columns_; column += 2)
      node(row, column).variance_mm2 =
          (node(row, column - 1).variance_mm2 + node(row, column + 1).variance_mm2) / 2;
  for (std::size_t row = 1; row < rows_; row += 2)
    for (std::size_t column = 0; column < columns_; ++column)
      node(row, column).variance_mm2 =
          (node(row - 1, column).variance_mm2 + node(row + 1, column).variance_mm2) / 2;
}

PlateMap::Place PlateMap::At(PointFp seen_fp) const {
  const auto cell = [this](double offset_mm, std::size_t count, std::size_t* index) {
    const double cells =
        std::clamp(offset_mm / step_mm_, 0.0, static_cast<double>(count) - 1 - 1e-9);
    *index = static_cast<std::size_t>(cells);
    return cells - static_cast<double>(*index);
  };
  std::size_t column = 0;
  std::size_t row = 0;
  const double u = cell(seen_fp.x_mm - low_.x_mm, columns_, &column);
  const double v = cell(seen_fp.y_mm - low_.y_mm, rows_, &row);
  const Node* node = &nodes_[row * columns_ + column];
  const double weights[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  const Node* corners[4] = {node, node + 1, node + columns_, node + columns_ + 1};
  const PointFp p = Polynomial(coefficients_, TermsAt(seen_fp, radius_mm_, degree_));
  Place place{{seen_fp.x_mm + p.x_mm, seen_fp.y_mm + p.y_mm}, 0};
  double variance = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    place.at_fp.x_mm += weights[k] * corners[k]->air_fp.x_mm;
    place.at_fp.y_mm += weights[k] * corners[k]->air_fp.y_mm;
    variance += weights[k] * corners[k]->variance_mm2;
  }
  place.sigma_mm = std::sqrt(variance);
  return place;
}

}  // namespace focalfleet
