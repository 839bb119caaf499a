#include "sim/campaigns/diagnosis/terms/image.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/term_trace.h"
#include "sim/campaigns/diagnosis/terms/image_followed.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kImageUnitsMin = 6;
constexpr double kNeighbourReach = 1.3;  // of the pitch
constexpr double kNeighboursAgree = 6;   // standard deviations
constexpr double kSizeMin_um = 0.1;
constexpr double kRemembers = 4;  // standard deviations of chance

using Vector4 = ImageMotion;
using Matrix4 = Eigen::Matrix<double, 4, 4>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Shift (2), turn, scale, and the two shears, which no camera has.
struct Image {
  Matrix6 normal = Matrix6::Zero();
  Vector6 right = Vector6::Zero();
  double square = 0;  // of the whitened residuals
  double rows = 0;
};

std::vector<Image> Normals(const Fit& fit) {
  std::vector<Image> images(fit.facts->exposures.size());
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      const std::size_t i = white.moves[k];
      Image& image = images[fit.facts->exposures.of_row[white.track.first_row + i]];
      // Displacement per um of shift, and per um at the plate's edge of turn, scale and shears.
      const double x = white.track.fibre_x_mm[i] / fit.facts->radius_mm;
      const double y = white.track.fibre_y_mm[i] / fit.facts->radius_mm;
      Eigen::Matrix<double, 2, 6> plain;
      plain << ImageDisplacements(white, k, fit.facts->radius_mm),
          (Eigen::Matrix2d() << x, y, -y, x).finished();
      const Eigen::Matrix<double, 2, 6> j = white.filter[k].root() * plain;
      image.normal += j.transpose() * j;
      const Eigen::Vector2d residual = white.y.segment<2>(static_cast<Eigen::Index>(2 * k));
      image.right += j.transpose() * residual;
      image.square += residual.squaredNorm();
      image.rows += 1;
    }
  }
  return images;
}

// Agreement of neighbours' whitened residuals, exposure by exposure, in standard deviations.
double NeighboursAgree(const Fit& fit, double* size_um) {
  constexpr double kWeightLeast = 0.5;  // of a row 6 standard deviations off
  const Campaign& campaign = *fit.facts->campaign;
  const std::size_t units = campaign.units.size();
  std::vector<std::vector<double>> of(units);
  const std::size_t exposures = fit.facts->exposures.size();
  const auto place = [&](std::size_t unit) {
    std::vector<double> xy(2 * exposures, 0);
    const WhiteUnit w = Whiten(fit, unit);
    for (std::size_t k = 0; k < w.moves.size(); ++k) {
      const std::size_t row = w.track.first_row + w.moves[k];
      if (fit.weight[row] < kWeightLeast) continue;  // an outlier, which others may be like
      const std::size_t e = fit.facts->exposures.of_row[row];
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
  *size_um = std::hypot(fit.noise.place_um, fit.noise.rest_um) * std::sqrt(2 * share);
  return sum / std::sqrt(variance);
}

CauseFound ImageCause(double chi_square, double size_um, std::size_t exposures) {
  CauseFound cause = CauseNamed(kCameraSimilarity);
  cause.axis = "none";
  cause.scope = "camera";
  cause.all_units = true;
  cause.amplitude = size_um;
  cause.amplitude_unit = "um";
  const double sigma = size_um / std::sqrt(2 * static_cast<double>(exposures));
  cause.ci95[0] = size_um - 1.96 * sigma, cause.ci95[1] = size_um + 1.96 * sigma;
  cause.size_um = size_um;
  cause.delta_log_likelihood = chi_square / 2;
  cause.shape = "shift, turn and scale of the image, anew at each exposure";
  cause.paragraph =
      "The image shifts, turns or scales from exposure to exposure: tie each exposure to "
      "fiducials.";
  return cause;
}

// Correlation of the shifts from one exposure to the next, in standard deviations of chance.
double Carryover(const std::vector<Vector4>& shifts) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Vector4& v : shifts) mean += v.head<2>() / static_cast<double>(shifts.size());
  double next = 0, own = 0;
  for (std::size_t e = 0; e + 1 < shifts.size(); ++e) {
    const Eigen::Vector2d a = shifts[e].head<2>() - mean, b = shifts[e + 1].head<2>() - mean;
    next += a.dot(b), own += a.squaredNorm();
  }
  return own > 0 ? next / own * std::sqrt(2 * static_cast<double>(shifts.size())) : 0;
}

// Shift, turn and scale of each image, um at the plate's edge, and what they explain.
struct Motion {
  std::vector<Vector4> found;     // Shape: (exposures); 0 where no fibre was seen
  std::vector<std::size_t> seen;  // exposures
  double chi_square = 0, dof = 0;
  double left = 0, left_dof = 0;                              // of the residuals beside it
  Vector4 square = Vector4::Zero(), noise = Vector4::Zero();  // summed over exposures
  /// Share of each component that is no noise: shifts may be large and turns nothing.
  [[nodiscard]] Vector4 Kept() const {
    return (1 - noise.array() / square.array().max(1e-12)).max(0.0).min(1.0);
  }
  [[nodiscard]] std::vector<Vector4> OfSeen() const {
    std::vector<Vector4> of_seen;
    for (const std::size_t e : seen) of_seen.push_back(found[e]);
    return of_seen;
  }
};

// Whether a camera can move so: an image that shrinks or turns by more is one of false spots. A
// camera that is focused anew scales by some thousandths; half and twice of it: the same images.
bool IsPossible(const Vector4& motion, double radius_mm) {
  constexpr double kMost = 0.01;  // of the scale; radians of turn
  return motion.tail<2>().cwiseAbs().maxCoeff() <= kMost * radius_mm * kUmPerMm;
}

Motion FindMotion(const Fit& fit) {
  const std::vector<Image> images = Normals(fit);
  Motion motion;
  motion.found.assign(images.size(), Vector4::Zero());
  for (std::size_t e = 0; e < images.size(); ++e) {
    if (images[e].rows < 6) continue;
    const Matrix4 normal = images[e].normal.topLeftCorner<4, 4>();
    const Matrix4 covariance = normal.ldlt().solve(Matrix4::Identity());
    const Vector4 found = covariance * images[e].right.head<4>();
    if (!IsPossible(found, fit.facts->radius_mm)) continue;
    motion.seen.push_back(e);
    motion.found[e] = found;
    motion.square += motion.found[e].cwiseAbs2();
    motion.noise += covariance.diagonal();
    motion.chi_square += motion.found[e].dot(images[e].right.head<4>());
    motion.dof += 4;
    motion.left += images[e].square - motion.found[e].dot(images[e].right.head<4>());
    motion.left_dof += 2 * images[e].rows - 4;
  }
  // Frames have taken as much of the motion.
  if (!fit.model.frames.empty())
    motion.dof -= kExposureParameters * static_cast<double>(fit.model.frames.size() - 1);
  if (motion.left_dof > 0) motion.noise *= motion.left / motion.left_dof;
  return motion;
}

// A variance, summed over the images, less that of the noise. Its own variance, and the same where
// there is nothing but noise.
struct Power {
  double power = 0, variance = 0, variance_of_noise = 0;
};

// The deformation of images, anew at each exposure. Air has no preferred direction. A field whose
// components vary alike in both directions shears as much as it turns and scales.
struct Deformation {
  Power rigid;  // turn and scale
  Power shear;
  bool is_anew = true;  // the shears do not go on from one exposure to the next
  [[nodiscard]] bool IsCamera() const {
    constexpr double kSure = 3;  // standard deviations
    const double more = rigid.power - 2 * std::max(shear.power, 0.0);
    return more > kSure * std::sqrt(rigid.variance + 4 * shear.variance);
  }
  [[nodiscard]] bool IsAir() const {
    constexpr double kSure = 5;
    return is_anew && shear.power > kSure * std::sqrt(shear.variance_of_noise) &&
           shear.power > 0.5 * rigid.power;
  }
};

Deformation FindDeformation(const Fit& fit) {
  constexpr double kRowsMin = 8;
  Vector6 square = Vector6::Zero(), fourth = Vector6::Zero();
  Vector6 noise = Vector6::Zero(), noise_fourth = Vector6::Zero();
  std::vector<Vector4> shears;
  double left = 0, freedom = 0;
  for (const Image& image : Normals(fit)) {
    if (image.rows < kRowsMin) continue;
    const Eigen::LDLT<Matrix6> solver(image.normal);
    const Vector6 variance = solver.solve(Matrix6::Identity()).diagonal();
    if (!variance.allFinite() || !(variance.minCoeff() > 0)) continue;
    const Vector6 found = solver.solve(image.right);
    square += found.cwiseAbs2(), fourth += found.cwiseAbs2().cwiseAbs2();
    noise += variance, noise_fourth += variance.cwiseAbs2();
    shears.push_back({found[4], found[5], 0, 0});
    left += image.square - found.dot(image.right);
    freedom += 2 * image.rows - 6;
  }
  if (shears.empty()) return {};
  // The fit took the images' motion for noise; the noise is what is left beside the motion.
  const double dispersion = left / freedom;
  const auto power = [&](Eigen::Index k) {
    // The square of a normal variable of variance v has the variance 2 v^2, its fourth power the
    // mean 3 v^2.
    return Power{square[k] + square[k + 1] - dispersion * (noise[k] + noise[k + 1]),
                 2 * (fourth[k] + fourth[k + 1]) / 3,
                 2 * dispersion * dispersion * (noise_fourth[k] + noise_fourth[k + 1])};
  };
  return {power(2), power(4), Carryover(shears) < kRemembers};
}

// Whether the image has a scale that goes on from exposure to exposure, and next to nothing else.
// The data do not show whether plate or camera makes it.
bool OnlyGrows(const Motion& motion) {
  constexpr double kMore = 2;
  const Vector4 power = (motion.square - motion.noise).cwiseMax(0.0);
  // Powers are in um at the edge; the fibres have half the square of it.
  if (0.5 * power[3] < kMore * (power[0] + power[1] + 0.5 * power[2])) return false;
  std::vector<Vector4> scales;
  for (const Vector4& shift : motion.OfSeen()) scales.push_back({shift[3], 0, 0, 0});
  return Carryover(scales) >= kRemembers;
}

// Whether the image moves along one line, without turn or scale, as gravity may move it. The
// direction of the line is unknown.
bool MovesAlongALine(const Motion& motion) {
  constexpr double kSure = 4;     // standard deviations of noise alone
  constexpr double kLeaks = 0.2;  // of the motion: where units move alike geometry bends the line
  const double exposures = static_cast<double>(std::max(motion.seen.size(), std::size_t{1}));
  const Vector4 noise = motion.noise * (1 + kSure * std::sqrt(2 / exposures));
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Vector4& one : motion.OfSeen()) mean += one.head<2>() / exposures;
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const Vector4& one : motion.OfSeen())
    spread += (one.head<2>() - mean) * (one.head<2>() - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(spread, Eigen::EigenvaluesOnly);
  const double across = axes.eigenvalues()[0], along = axes.eigenvalues()[1];
  return across <= noise.head<2>().maxCoeff() + kLeaks * along &&
         motion.square[2] <= noise[2] + kLeaks * along &&
         motion.square[3] <= noise[3] + kLeaks * along;
}

bool IsImageStep(const ModelTerm& term) { return term.form.effect->traits.is_of_camera; }

// Drops steps of the whole image, which were a first guess at its motion. Returns whether there
// were any.
bool DropImageSteps(Fit* fit) {
  if (std::erase_if(fit->model.terms, IsImageStep) == 0) return false;
  UpdateResiduals(fit);
  SettleFit(fit, 2);
  return true;
}

// Takes the motion into the model, round by round: rest errors and geometry have absorbed a part of
// slow motion. Returns the whole motion. `size_um`: its root mean square without noise.
Motion TakeMotion(Motion motion, Fit* fit, double* size_um) {
  constexpr int kRounds = 5;
  const std::size_t exposures = motion.found.size();
  const double per_edge = 1e3 / fit->facts->radius_mm;  // um at the edge to urad and ppm
  std::vector<Vector4> taken(exposures, Vector4::Zero());
  Motion whole = motion;
  fit->model.exposures.assign(exposures, {});
  for (int round = 0; round < kRounds; ++round) {
    const Vector4 kept = motion.Kept();
    if (kept.maxCoeff() < 0.05) break;
    for (std::size_t e = 0; e < exposures; ++e) {
      taken[e] += kept.cwiseProduct(motion.found[e]);
      const Vector4& v = taken[e];
      fit->model.exposures[e] = {v[0], v[1], v[2] * per_edge, v[3] * per_edge};
    }
    UpdateResiduals(fit);
    SettleFit(fit, 2);
    motion = FindMotion(*fit);
    for (std::size_t e = 0; e < exposures; ++e) whole.found[e] = taken[e] + motion.found[e];
  }
  double square = 0;
  whole.square.setZero();
  for (std::size_t e = 0; e < exposures; ++e) {
    const Vector4& v = taken[e];
    square += v[0] * v[0] + v[1] * v[1] + 0.5 * (v[2] * v[2] + v[3] * v[3]);
    whole.square += whole.found[e].cwiseAbs2();
  }
  *size_um = std::sqrt(square / static_cast<double>(std::max(whole.seen.size(), std::size_t{1})));
  return whole;
}

bool MovesForSure(const Motion& motion, double family_wise) {
  // The gate uses the residuals beside the motion, because the fit's noise has the motion in it. In
  // 130 hidden campaigns without any motion the largest ratio to it was 3.1 standard deviations
  // above 1.
  constexpr double kNoiseOfNoise = 1.03, kShare = 0.01;
  if (motion.dof <= 0 || !(motion.left > 0)) return false;
  const double noise = kNoiseOfNoise * motion.left / motion.left_dof;
  return LogChiSquareTail(motion.chi_square / noise, motion.dof) < std::log(kShare * family_wise);
}

// Whether a single step of the image explains a slow dependence on a column: without the step the
// column shows.
bool HidesAColumn(const Fit& fit, double family_wise) {
  Fit bare = fit;
  DropImageSteps(&bare);
  const Motion motion = FindMotion(bare);
  if (!MovesForSure(motion, family_wise)) return false;
  const double signal = 0.5 * (motion.Kept()[0] + motion.Kept()[1]);
  return FollowedColumn(*fit.facts, motion.seen, motion.OfSeen(), signal, 1).has_value();
}

}  // namespace

ImageFound AddImageTerms(Fit* fit, double family_wise) {
  ImageFound image;
  if (fit->model.units.size() < kImageUnitsMin) return image;
  Motion motion = FindMotion(*fit);
  double turbulence_um = 0;
  const double before = NeighboursAgree(*fit, &turbulence_um);
  const bool moves = MovesForSure(motion, family_wise);
  // Several steps are no touch of the camera, but stand in for another effect.
  const auto steps = std::count_if(fit->model.terms.begin(), fit->model.terms.end(), IsImageStep);
  const bool one_step_alone = !moves && before < kNeighboursAgree && steps < 2;
  if (one_step_alone && (steps == 0 || !HidesAColumn(*fit, family_wise))) return image;
  const Fit with_step = one_step_alone ? *fit : Fit{};
  if (DropImageSteps(fit)) motion = FindMotion(*fit);
  const Deformation deformed = FindDeformation(*fit);
  image.moves = true;
  double size_um = 0;
  motion = TakeMotion(std::move(motion), fit, &size_um);
  const double signal = 0.5 * (motion.Kept()[0] + motion.Kept()[1]);
  const std::vector<Vector4> shifts = motion.OfSeen();
  image.followed = FollowedColumn(*fit->facts, motion.seen, shifts, signal, size_um);
  // With the whole motion taken no column shows: a single step was right.
  if (one_step_alone && !image.followed) {
    *fit = with_step;
    return {};
  }
  const double after = NeighboursAgree(*fit, &turbulence_um);
  const bool goes_on = Carryover(shifts) >= kRemembers;
  if (goes_on) image.drift_um = size_um;
  CauseFound cause =
      ImageCause(motion.chi_square, std::max(size_um, turbulence_um), motion.seen.size());
  // Air is new at each exposure. A motion that is new as well may be air, however few the
  // neighbours.
  if (!goes_on && !deformed.IsCamera()) cause.candidates.emplace_back(kAirTurbulence);
  if (OnlyGrows(motion)) cause.candidates.emplace_back(CauseOf(MotionOfImage::kGrows));
  if (!MovesAlongALine(motion)) cause.cannot_be.emplace_back(CauseOf(MotionOfImage::kAlongALine));
  if (after > kNeighboursAgree || deformed.IsAir()) {
    cause.cause = kAirTurbulence;
    cause.candidates = {cause.cause};
    cause.size_um = std::hypot(size_um, turbulence_um);
    cause.amplitude = cause.size_um;
    cause.shape = "neighbours move alike, differently at each exposure";
    cause.paragraph =
        "Air bends the light on its way to the camera: neighbours move alike, anew at each "
        "exposure. Stack exposures, or calm the air.";
  }
  const bool swings = image.followed && image.followed->channel != kImageShift;
  if (swings && deformed.IsCamera()) image.followed.reset();
  // A motion that follows a column is not unrest of the image itself.
  if ((!image.followed || swings) && cause.size_um >= kSizeMin_um) image.cause = std::move(cause);
  return image;
}

void AddDriftAsRival(double drift_um, const Fit& fit, Selection* selection) {
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    const ModelTerm& term = fit.model.terms[t];
    if (term.form.effect->traits.image_motion != MotionOfImage::kNone &&
        2 * drift_um > SizeOf(fit, term))
      selection->accepted[t].rivals.push_back({kCameraSimilarity, 0, 0, 0});
  }
}

}  // namespace focalfleet::sim
