#include "sim/diagnosis/image.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/diagnosis/chances.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kUnitsMin = 6;
constexpr double kNeighbourReach = 1.3;  // of the pitch
constexpr double kNeighboursAgree = 6;   // standard deviations
constexpr double kSizeMin_um = 0.2;

using Vector4 = Eigen::Matrix<double, 4, 1>;
using Matrix4 = Eigen::Matrix<double, 4, 4>;

struct Image {
  Matrix4 normal = Matrix4::Zero();
  Vector4 right = Vector4::Zero();
  double rows = 0;
};

std::vector<Image> Normals(const Fit& fit) {
  std::vector<Image> images(fit.facts->exposures.size());
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      const std::size_t i = white.moves[k];
      Image& image = images[fit.facts->exposures.of_row[white.track.first_row + i]];
      // Per um of shift, and per um at the plate's edge of turn and scale.
      const double x = (white.track.fibre_x_mm[i] - fit.facts->centre_x_mm) / fit.facts->radius_mm;
      const double y = (white.track.fibre_y_mm[i] - fit.facts->centre_y_mm) / fit.facts->radius_mm;
      const double* w = white.filter[k].w;
      Eigen::Matrix<double, 2, 4> plain, j;
      plain << 1, 0, -y, x, 0, 1, x, y;
      Eigen::Matrix2d root;
      root << w[0], w[1], w[1], w[2];
      j = root * plain;
      image.normal += j.transpose() * j;
      image.right += j.transpose() * white.y.segment<2>(static_cast<Eigen::Index>(2 * k));
      image.rows += 1;
    }
  }
  return images;
}

// Do neighbours' whitened residuals agree, exposure by exposure? In standard deviations.
double NeighboursAgree(const Fit& fit, double* size_um) {
  const Campaign& campaign = *fit.facts->campaign;
  const std::size_t units = campaign.units.size();
  std::vector<std::vector<double>> of(units);
  const std::size_t exposures = fit.facts->exposures.size();
  const auto place = [&](std::size_t unit) {
    std::vector<double> xy(2 * exposures, 0);
    const WhiteUnit w = Whiten(fit, unit);
    for (std::size_t k = 0; k < w.moves.size(); ++k) {
      const std::size_t e = fit.facts->exposures.of_row[w.track.first_row + w.moves[k]];
      xy[2 * e] = w.y[static_cast<Eigen::Index>(2 * k)];
      xy[2 * e + 1] = w.y[static_cast<Eigen::Index>(2 * k + 1)];
    }
    return xy;
  };
  for (std::size_t unit = 0; unit < units; ++unit) of[unit] = place(unit);
  double sum = 0, variance = 0, count = 0;
  const double reach_mm = kNeighbourReach * fit.facts->pitch_mm;
  for (std::size_t a = 0; a < units; ++a)
    for (std::size_t b = a + 1; b < units; ++b) {
      if (std::hypot(campaign.units[a].base_x_mm - campaign.units[b].base_x_mm,
                     campaign.units[a].base_y_mm - campaign.units[b].base_y_mm) > reach_mm)
        continue;
      for (std::size_t e = 0; e < exposures; ++e) {
        const double dot = of[a][2 * e] * of[b][2 * e] + of[a][2 * e + 1] * of[b][2 * e + 1];
        if (dot == 0) continue;
        sum += dot, variance += dot * dot, count += 2;
      }
    }
  if (count < 100 || !(variance > 0)) return 0;
  const double share = std::clamp(sum / count, 0.0, 1.0);
  *size_um = fit.noise.place_um * std::sqrt(2 * share);
  return sum / std::sqrt(variance);
}

CauseFound ImageCause(const Fit& fit, double chi_square, double size_um) {
  CauseFound cause;
  cause.cause = "camera_similarity";
  cause.candidates = {cause.cause};
  cause.axis = "none";
  cause.scope = "camera";
  cause.all_units = true;
  cause.amplitude = size_um;
  cause.amplitude_unit = "um";
  const double sigma = size_um / std::sqrt(2 * static_cast<double>(fit.model.exposures.size()));
  cause.ci95[0] = size_um - 1.96 * sigma, cause.ci95[1] = size_um + 1.96 * sigma;
  cause.size_um = size_um;
  cause.delta_log_likelihood = chi_square / 2;
  cause.shape = "shift, turn and scale of the image, anew at each exposure";
  cause.paragraph =
      "The image shifts, turns or scales from exposure to exposure: tie each exposure to "
      "fiducials.";
  return cause;
}

// ---- does the image move with something that the table knows?

// Mean of a column at each exposure; empty where units differ, or where it does not vary.
std::vector<double> OfExposures(const CampaignFacts& facts, const FilledColumn& column) {
  constexpr double kOwnShareMax = 0.1;  // of the variance: what units have of their own
  const std::size_t exposures = facts.exposures.size();
  std::vector<double> mean(exposures, 0), count(exposures, 0);
  double square = 0;
  for (std::size_t row = 0; row < column.values.size(); ++row) {
    const std::size_t e = facts.exposures.of_row[row];
    mean[e] += column.values[row], count[e] += 1;
    square += (column.values[row] - column.mean) * (column.values[row] - column.mean);
  }
  double between = 0;
  for (std::size_t e = 0; e < exposures; ++e) {
    mean[e] /= std::max(count[e], 1.0);
    between += count[e] * (mean[e] - column.mean) * (mean[e] - column.mean);
  }
  if (!(square > 0) || between < (1 - kOwnShareMax) * square) mean.clear();
  return mean;
}

// Share of the shifts' variance that curves over the ranks of `values` take.
double ShareTaken(const std::vector<Vector4>& shifts, const std::vector<double>& values,
                  int curves) {
  const auto n = static_cast<Eigen::Index>(shifts.size());
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  Eigen::MatrixXd basis(n, curves + 1), two(n, 2);
  for (Eigen::Index e = 0; e < n; ++e) {
    const double value = values[static_cast<std::size_t>(e)];
    const auto range = std::equal_range(sorted.begin(), sorted.end(), value);
    const double rank =
        static_cast<double>((range.first - sorted.begin()) + (range.second - sorted.begin())) /
        (2 * static_cast<double>(n));
    basis(e, 0) = 1;
    for (int k = 1; k <= curves; ++k) basis(e, k) = std::cos(std::numbers::pi * k * rank);
    two.row(e) = shifts[static_cast<std::size_t>(e)].head<2>().transpose();
  }
  two.rowwise() -= two.colwise().mean().eval();
  const Eigen::MatrixXd left = two - basis * basis.colPivHouseholderQr().solve(two);
  const double all = two.squaredNorm();
  return all > 0 ? 1 - left.squaredNorm() / all : 0;
}

// The column that the image's shifts follow best, if it is no chance and more than time does.
std::optional<UnknownFound> FollowedColumn(const CampaignFacts& facts,
                                           const std::vector<Vector4>& shifts, double size_um) {
  constexpr int kCurves = 3, kTimeCurves = 6;
  constexpr double kShareMin = 0.25, kBeyondTime = 0.1;
  const std::size_t exposures = facts.exposures.size();
  if (exposures < 20) return std::nullopt;
  std::vector<double> order(exposures), parity(exposures);
  for (std::size_t e = 0; e < exposures; ++e)
    order[e] = static_cast<double>(e), parity[e] = static_cast<double>(e % 2);
  const double by_time = ShareTaken(shifts, order, kTimeCurves);
  std::optional<UnknownFound> best;
  double most = std::max(kShareMin, by_time + kBeyondTime), columns = 1;
  const auto look = [&](const std::string& name, const std::vector<double>& values, int curves) {
    columns += 1;
    const double share = ShareTaken(shifts, values, curves);
    if (share < most) return;
    most = share;
    best = UnknownFound{name, "the image's shift", 0, size_um * std::sqrt(share)};
    best->p_value = std::exp(LogChiSquareTail(
        -2 * static_cast<double>(exposures) * std::log1p(-std::min(share, 0.999)), 2.0 * curves));
  };
  look("move parity", parity, 1);
  for (const auto& [name, column] : facts.columns) {
    if (!column.varies() || name == kOrder || name == "t_s" || name.starts_with("pixel_")) continue;
    const std::vector<double> values = OfExposures(facts, column);
    if (!values.empty()) look(name, values, kCurves);
  }
  if (best && best->p_value * columns > 1e-4) best.reset();
  return best;
}

}  // namespace

std::optional<CauseFound> AddImageTerms(Fit* fit, double family_wise,
                                        std::vector<UnknownFound>* unknown) {
  if (fit->model.units.size() < kUnitsMin) return std::nullopt;
  const std::vector<Image> images = Normals(*fit);
  double chi_square = 0, dof = 0;
  std::vector<Vector4> found(images.size(), Vector4::Zero());
  for (std::size_t e = 0; e < images.size(); ++e) {
    if (images[e].rows < 6) continue;
    found[e] = images[e].normal.ldlt().solve(images[e].right);
    chi_square += found[e].dot(images[e].right);
    dof += 4;
  }
  // The noise estimate's own error grows with the number of exposures.
  constexpr double kNoiseOfNoise = 1.15;
  double turbulence_um = 0;
  const double before = NeighboursAgree(*fit, &turbulence_um);
  const bool moves =
      dof > 0 && LogChiSquareTail(chi_square / kNoiseOfNoise, dof) < std::log(family_wise / 10);
  if (!moves && before < kNeighboursAgree) return std::nullopt;
  // Drawn to zero by as much of it as chance alone would be.
  const double kept = std::clamp(1 - dof / std::max(chi_square, 1e-9), 0.0, 1.0);
  fit->model.exposures.assign(images.size(), {});
  double square = 0;
  const double per_edge = 1e3 / fit->facts->radius_mm;  // um at the edge to urad and ppm
  for (std::size_t e = 0; e < images.size(); ++e) {
    const Vector4 v = kept * found[e];
    fit->model.exposures[e] = {v[0], v[1], v[2] * per_edge, v[3] * per_edge};
    square += v[0] * v[0] + v[1] * v[1] + 0.5 * (v[2] * v[2] + v[3] * v[3]);
  }
  const double size_um = std::sqrt(square / static_cast<double>(images.size()));
  const auto followed = FollowedColumn(*fit->facts, found, size_um);
  if (followed) unknown->push_back(*followed);
  UpdateResiduals(fit);
  SettleFit(fit, 2);
  const double after = NeighboursAgree(*fit, &turbulence_um);
  CauseFound cause = ImageCause(*fit, chi_square, std::max(size_um, turbulence_um));
  if (after > kNeighboursAgree) {
    cause.cause = "air_turbulence";
    cause.candidates = {cause.cause};
    cause.size_um = std::hypot(size_um, turbulence_um);
    cause.amplitude = cause.size_um;
    cause.shape = "neighbours move alike, differently at each exposure";
    cause.paragraph =
        "Air bends the light on its way to the camera: neighbours move alike, anew at each "
        "exposure. Stack exposures, or calm the air.";
  }
  // What follows a column is not the image's own unrest.
  if (followed || cause.size_um < kSizeMin_um) return std::nullopt;
  return cause;
}

}  // namespace focalfleet::sim
