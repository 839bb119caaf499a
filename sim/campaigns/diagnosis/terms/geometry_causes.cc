#include "sim/campaigns/diagnosis/terms/geometry_causes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kGeometrySizeMin_um =
    1;  // tables are rounded, and shared terms leave a trace in it

struct Group {
  std::string_view cause;
  const char* axis;
  const char* unit;
  std::vector<Index> at;  // of the six static parameters
};
const std::vector<Group>& Groups() {
  static const std::vector<Group> groups = {{kZeroOffset, "theta", "deg", {4}},
                                            {kZeroOffset, "phi", "deg", {5}},
                                            {kBaseOffset, "none", "mm", {0, 1}},
                                            {kArmLength, "theta", "mm", {2}},
                                            {kArmLength, "phi", "mm", {3}}};
  return groups;
}

struct UnitOffset {
  std::size_t unit;
  StaticVector offset;
  StaticMatrix covariance;
};

std::vector<UnitOffset> Offsets(const Fit& fit) {
  std::vector<UnitOffset> offsets;
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    std::size_t used = 0;
    const Campaign& campaign = *fit.facts->campaign;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
      if (fit.weight[row] > 0) ++used;
    if (used < 4) continue;
    const CampaignUnit& a = fit.model.units[unit];
    const CampaignUnit& b = campaign.units[unit];
    UnitOffset out{unit, {}, StaticCovariance(fit, unit)};
    out.offset << a.base_x_mm - b.base_x_mm, a.base_y_mm - b.base_y_mm, a.arm_mm[0] - b.arm_mm[0],
        a.arm_mm[1] - b.arm_mm[1], std::remainder(a.zero_deg[0] - b.zero_deg[0], 360.0),
        std::remainder(a.zero_deg[1] - b.zero_deg[1], 360.0);
    offsets.push_back(out);
  }
  return offsets;
}

// Whether the units' mean places are off by one shift, turn and scale more than chance makes it of
// offsets that are each unit's own: Fisher's test of the variance that the image explains.
bool AreOffAlike(const Fit& fit, const std::vector<UnitOffset>& offsets) {
  constexpr double kByChance = 0.001;  // of campaigns whose units are off each by itself
  static_assert(kExposureParameters == 4);
  const auto units = static_cast<Index>(offsets.size());
  const double a = static_cast<double>(units) - 2;  // half of 2 coordinates a unit less 4
  if (!(a > 0)) return false;
  Eigen::VectorXcd moved(units);
  Eigen::MatrixXcd image(units, 2);
  for (Index k = 0; k < units; ++k) {
    const UnitOffset& one = offsets[static_cast<std::size_t>(k)];
    const CampaignUnit& unit = fit.model.units[one.unit];
    const VectorXd moved_um = GeometryDisplacements(Whiten(fit, one.unit)) * one.offset;
    const Eigen::Map<const Eigen::Matrix2Xd> places(moved_um.data(), 2, moved_um.size() / 2);
    const Eigen::Vector2d mean = places.rowwise().mean();
    moved[k] = {mean[0], mean[1]};
    image.row(k) << 1.0, std::complex<double>(unit.base_x_mm, unit.base_y_mm);
  }
  const double all = moved.squaredNorm();
  if (!(all > 0)) return false;
  const double left =
      (moved - image * image.colPivHouseholderQr().solve(moved)).squaredNorm() / all;
  return TailOfFourParameters(left, a) < kByChance;
}

// Where the image moves, what the offsets of all units do alike in an exposure is the image's
// motion as well: no table has its place. Offsets are judged without it, as if by the marginal
// likelihood of both, in which the motions of exposures do not depend on one another. Where the
// camera has several frames, and the units are off alike, the same holds of all exposures together:
// no frame is the table's.
void TakeOffTheImage(const Fit& fit, std::vector<UnitOffset>* offsets) {
  using ImageNormal = Eigen::Matrix<double, kExposureParameters, kExposureParameters>;
  using ImageVector = Eigen::Matrix<double, kExposureParameters, 1>;
  const std::vector<ExposureTerm>& exposures = fit.model.exposures;
  const bool has_frames = fit.facts->frames.size() > 1 && AreOffAlike(fit, *offsets);
  if (!has_frames && std::ranges::none_of(exposures, &ExposureTerm::moves)) return;
  // An image of each exposure, and one that all others have together.
  const std::size_t together = exposures.size();
  std::vector<ImageNormal> normal(together + 1, ImageNormal::Zero());
  std::vector<ImageVector> image(together + 1, ImageVector::Zero());
  // Calls `each` with every row whose image moves: the row's index in `white`, its image, and the
  // image's displacements.
  const auto for_rows = [&](const WhiteUnit& white, const auto& each) {
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      const std::size_t e = fit.facts->exposures.of_row[white.track.first_row + white.moves[k]];
      const bool moves = e < exposures.size() && exposures[e].moves();
      if (moves || has_frames)
        each(static_cast<Index>(2 * k), moves ? e : together,
             ImageDisplacements(white, k, fit.facts->radius_mm));
    }
  };
  for (const UnitOffset& one : *offsets) {
    const WhiteUnit white = Whiten(fit, one.unit);
    const VectorXd moved_um = GeometryDisplacements(white) * one.offset;
    for_rows(white, [&](Index at, std::size_t e, const auto& displacements) {
      const Eigen::Matrix2d root = white.filter[static_cast<std::size_t>(at / 2)].root();
      const Eigen::Matrix<double, 2, kExposureParameters> rows = root * displacements;
      normal[e] += rows.transpose() * rows;
      image[e] += rows.transpose() * (root * moved_um.segment<2>(at));
    });
  }
  // An exposure of few rows leaves some of the motion open: the least motion that fits.
  for (std::size_t e = 0; e <= together; ++e)
    image[e] = normal[e].completeOrthogonalDecomposition().solve(image[e]).eval();
  for (UnitOffset& one : *offsets) {
    const WhiteUnit white = Whiten(fit, one.unit);
    VectorXd image_um = VectorXd::Zero(white.y.size());
    for_rows(white, [&](Index at, std::size_t e, const auto& displacements) {
      image_um.segment<2>(at) = displacements * image[e];
    });
    white.Apply(image_um.data());
    one.offset -= one.covariance * (white.geometry.transpose() * image_um);
  }
}

// Chi-square that is left when only the parameters outside `rest` may differ.
double Left(const UnitOffset& unit, const std::vector<Index>& rest) {
  const auto n = static_cast<Index>(rest.size());
  if (n == 0) return 0;
  VectorXd d(n);
  MatrixXd c(n, n);
  for (Index i = 0; i < n; ++i) {
    d[i] = unit.offset[rest[static_cast<std::size_t>(i)]];
    for (Index j = 0; j < n; ++j)
      c(i, j) =
          unit.covariance(rest[static_cast<std::size_t>(i)], rest[static_cast<std::size_t>(j)]);
  }
  return d.dot(c.ldlt().solve(d));
}

// The square of a unit's offset, and the part of it that the error of the fit makes.
struct Square {
  double value = 0, of_error = 0;
};

// The square of the group's offset in its own unit or, with levers, at the fibre in um^2.
Square SquareOf(const UnitOffset& unit, const Group& group, const CampaignUnit* levers) {
  Square square;
  for (const Index at : group.at) {
    double lever = 1;
    if (levers != nullptr) {
      lever = kUmPerMm;
      if (at == 4) lever *= std::hypot(levers->arm_mm[0], levers->arm_mm[1]) * kRadiansPerDegree;
      if (at == 5) lever *= levers->arm_mm[1] * kRadiansPerDegree;
    }
    square.value += std::pow(unit.offset[at] * lever, 2);
    square.of_error += unit.covariance(at, at) * lever * lever;
  }
  return square;
}

// The units' rms without what the errors of the fits make of it. A unit that tells little of itself
// counts little.
double RmsOfTruth(const std::vector<Square>& squares) {
  std::vector<double> values;
  for (const Square& square : squares) values.push_back(square.value);
  const double usual = Median(values);
  double sum = 0, weights = 0;
  for (const Square& square : squares) {
    const double weight = std::pow(std::max(square.of_error + usual, 1e-30), -2);
    sum += weight * (square.value - square.of_error), weights += weight;
  }
  return weights > 0 ? std::sqrt(std::max(sum / weights, 0.0)) : 0;
}

struct GroupTest {
  double log_p = 0;
  double gained = 0;
  std::vector<std::size_t> which;  // indices of the offsets that have it
};

GroupTest TestGroup(const std::vector<UnitOffset>& offsets, const std::vector<Index>& rest,
                    const Group& group, double family_wise) {
  std::vector<Index> without;
  for (const Index at : rest)
    if (std::find(group.at.begin(), group.at.end(), at) == group.at.end()) without.push_back(at);
  const auto dof = static_cast<double>(group.at.size());
  const auto n = static_cast<double>(offsets.size());
  GroupTest test;
  double sum = 0, best = 0;
  // A unit's noise is known to some 15 % from its own rows.
  constexpr double kOwnNoise = 1.3;
  for (std::size_t k = 0; k < offsets.size(); ++k) {
    const double gained = std::max(Left(offsets[k], rest) - Left(offsets[k], without), 0.0);
    const double log_p = LogChiSquareTail(gained / kOwnNoise, dof);
    sum += gained;
    best = std::min(best, log_p);
    if (LogLeastOf(log_p, n * 5) < std::log(family_wise))
      test.which.push_back(k), test.gained += gained;
  }
  // For the fleet as a whole the error of the noise estimate grows with the number of units.
  constexpr double kNoiseOfNoise = 1.1;
  const double all = LogChiSquareTail(sum / kNoiseOfNoise, dof * n);
  test.log_p = std::min(all, LogLeastOf(best, n)) + std::log(10.0);
  if (test.which.empty() || all + std::log(10.0) < std::log(family_wise)) {
    if (static_cast<double>(test.which.size()) > 0.5 * n || test.which.empty()) {
      test.which.clear();
      for (std::size_t k = 0; k < offsets.size(); ++k) test.which.push_back(k);
      test.gained = sum;
    }
  }
  return test;
}

CauseFound Report(const Fit& fit, const std::vector<UnitOffset>& offsets, const Group& group,
                  const GroupTest& test) {
  CauseFound cause;
  cause.cause = group.cause;
  cause.candidates = {std::string(group.cause)};
  cause.axis = group.axis;
  cause.scope = "unit";
  cause.amplitude_unit = group.unit;
  cause.delta_log_likelihood = test.gained / 2;
  cause.all_units = test.which.size() == offsets.size();
  std::vector<Square> own, at_fibre;
  double variance = 0;
  for (const std::size_t k : test.which) {
    const UnitOffset& unit = offsets[k];
    cause.units.push_back(fit.model.units[unit.unit].id);
    own.push_back(SquareOf(unit, group, nullptr));
    at_fibre.push_back(SquareOf(unit, group, &fit.model.units[unit.unit]));
    variance += own.back().of_error;
  }
  const auto n = static_cast<double>(std::max<std::size_t>(test.which.size(), 1));
  cause.amplitude = RmsOfTruth(own);
  if (test.which.size() == 1 && group.at.size() == 1)
    cause.amplitude = offsets[test.which[0]].offset[group.at[0]];
  const double sigma = std::sqrt(variance / n) / std::sqrt(n);
  cause.ci95[0] = cause.amplitude - 1.96 * sigma;
  cause.ci95[1] = cause.amplitude + 1.96 * sigma;
  cause.size_um = RmsOfTruth(at_fibre);
  cause.shape =
      cause.all_units && offsets.size() > 1 ? "each unit its own; the amplitude is their rms" : "";
  cause.paragraph = "The unit's geometry differs from units.csv: take the fitted value.";
  return cause;
}

}  // namespace

std::vector<CauseFound> FindGeometryCauses(const Fit& fit, double family_wise) {
  std::vector<UnitOffset> offsets = Offsets(fit);
  TakeOffTheImage(fit, &offsets);
  std::vector<CauseFound> causes;
  if (offsets.empty()) return causes;
  std::vector<Index> rest = {0, 1, 2, 3, 4, 5};
  std::vector<char> used(Groups().size(), 0);
  for (;;) {
    std::size_t best = Groups().size();
    GroupTest best_test;
    double best_rate = 0;
    for (std::size_t g = 0; g < Groups().size(); ++g) {
      if (used[g] != 0) continue;
      GroupTest test = TestGroup(offsets, rest, Groups()[g], family_wise);
      const double rate = test.gained / static_cast<double>(Groups()[g].at.size());
      if (test.log_p > std::log(family_wise) || rate <= best_rate) continue;
      best = g, best_rate = rate, best_test = std::move(test);
    }
    if (best == Groups().size()) break;
    used[best] = 1;
    std::erase_if(rest, [&](Index at) {
      const auto& group = Groups()[best].at;
      return std::find(group.begin(), group.end(), at) != group.end();
    });
    CauseFound cause = Report(fit, offsets, Groups()[best], best_test);
    if (cause.size_um >= kGeometrySizeMin_um) causes.push_back(std::move(cause));
  }
  return causes;
}

}  // namespace focalfleet::sim
