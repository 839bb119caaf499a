// The fit of a model to a campaign: residuals, their noise, robust weights, and Gauss-Newton steps
// of everything at once. Static geometry and the amplitudes that are a unit's own are eliminated
// unit by unit (Schur complement), so that a step costs O(rows) and one small dense system of the
// amplitudes that units share.
//
// Noise of one measured place: isotropic, plus what an error of either axis' angle does there,
//   cov = s0^2 I + s_theta^2 t_theta t_theta' + s_phi^2 t_phi t_phi',  t = dplace / dangle,
// times a factor of the unit. Weights are Huber's in the whitened length of the residual.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "sim/diagnosis/model.h"

namespace focalfleet::sim {

struct Noise {
  double place_um = 1;
  double angle_deg[2] = {0, 0};
  std::vector<double> unit_factor;  // Shape: (units)
};

/// A fit in progress. Rows without a measured place, or set aside, have weight 0.
struct Fit {
  const CampaignFacts* facts = nullptr;
  CampaignModel model;
  std::vector<double> x_um, y_um;  // Shape: (rows): measured less predicted
  std::vector<double> weight;      // Shape: (rows)
  std::vector<char> aside;         // Shape: (rows): never used in a fit
  Noise noise;
  ParallelFor parallel;
  bool with_angle_noise = true;

  [[nodiscard]] bool Used(std::size_t row) const { return weight[row] > 0; }
};

inline constexpr std::size_t kStaticColumns = 6;  // base x, y; arms; zeros
using StaticVector = Eigen::Matrix<double, 6, 1>;
using StaticMatrix = Eigen::Matrix<double, 6, 6>;

/// Starts from the table's geometry: finds each unit's static geometry robustly, also where zeros
/// are far off. Errors in the data stay residuals.
Fit StartFit(const CampaignFacts& facts, CampaignModel model, std::vector<char> aside,
             ParallelFor parallel);

void UpdateResiduals(Fit* fit);
void UpdateNoise(Fit* fit);    // by the present residuals
void UpdateWeights(Fit* fit);  // by residuals and noise

/// One Gauss-Newton step of geometry and all amplitudes, then residuals anew.
void StepFit(Fit* fit);

/// Steps, noise and weights in turn until the amplitudes rest.
void SettleFit(Fit* fit, int rounds);

/// Lets the zeros differ from homing to homing, and fits them.
void FreeHomings(Fit* fit);

/// 2 ln L of the fit less a price for its parameters (BIC); comparable between fits of one
/// campaign.
double Merit(const Fit& fit);

/// Static geometry's covariance in mm and degrees, with the unit's own terms beside it.
StaticMatrix StaticCovariance(const Fit& fit, std::size_t unit);

// ---- for those who look at a fit's columns

/// One unit's used rows as whitened, weighted vectors: two numbers a row.
struct WhiteUnit {
  UnitTrack track;
  std::vector<std::size_t> moves;  // indices of the used moves in the track
  Eigen::VectorXd y;               // residuals; Shape: (2 moves)
  Eigen::MatrixXd geometry;        // d place / d (base, arms, zeros), per mm and degree
  std::vector<double> whiten;      // Shape: (moves, 3): xx, xy, yy of the symmetric root
  std::vector<double> turn_um;     // Shape: (moves, 4): d place / d theta, d phi; um per degree
};
WhiteUnit Whiten(const Fit& fit, std::size_t unit);

/// The displacement that pose errors make, whitened. Shape: (2 moves).
void WhiteDisplacement(const WhiteUnit& white, const PoseErrors& errors, double* out);

}  // namespace focalfleet::sim
