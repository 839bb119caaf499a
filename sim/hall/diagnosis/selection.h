// The search among hypotheses for hall_diagnosis.h.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/hall/diagnosis/parameters.h"

namespace focalfleet::sim {

/// Parameters that are switched on together.
struct HallHypothesis {
  HallCause cause = HallCause::kSensorGain;
  std::vector<std::size_t> parameters;
  std::vector<std::size_t> sensors;
  double decay = 0;  // of kCentreOffset: the decay that the search tries
};

struct HallFit {
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;  // of `free`, for unit noise
  std::vector<std::size_t> free;
  double squares = 0;
  Eigen::VectorXd residuals;
};

class HallSearch {
 public:
  HallSearch(const HallForward& forward, const HallCampaign& campaign,
             std::vector<Reading> readings);

  /// The fit of amplitude and phase alone.
  [[nodiscard]] HallFit Free() const;
  /// The fit of amplitude, phase and the hypotheses' parameters, jointly and nonlinearly, from
  /// `start`.
  [[nodiscard]] HallFit Fit(const std::vector<HallHypothesis>& on,
                            const Eigen::VectorXd& start) const;
  /// The residual variance and the residuals with every parameter free, linear about `fit`.
  struct Rich {
    double variance = 0;
    Eigen::VectorXd residuals;
  };
  [[nodiscard]] Rich AllFree(const HallFit& fit) const;
  /// The squares that each hypothesis explains about `fit`, with the parameters of `fit` projected
  /// out.
  [[nodiscard]] std::vector<double> Explained(const HallFit& fit) const;

  [[nodiscard]] const std::vector<HallHypothesis>& hypotheses() const { return hypotheses_; }
  [[nodiscard]] const std::vector<Reading>& readings() const { return readings_; }
  void set_readings(std::vector<Reading> readings) { readings_ = std::move(readings); }
  [[nodiscard]] const Eigen::VectorXd& measured_V() const { return measured_V_; }
  void TakeMeasured();

 private:
  const HallForward& forward_;
  const HallCampaign& campaign_;
  std::vector<Reading> readings_;
  Eigen::VectorXd measured_V_;
  std::vector<HallHypothesis> hypotheses_;
};

/// The chi^2 that chance exceeds with about the probability of `sigmas` of a normal variable.
double ChanceChi2(std::size_t freedom, double sigmas);
/// The probability that chance exceeds chi2.
double ChanceOf(double chi2, std::size_t freedom);

struct Selected {
  std::vector<HallHypothesis> on;
  HallFit fit;
  double variance = 0;
  /// For each of `on`: the other causes that would explain its share nearly as well.
  std::vector<std::vector<HallCause>> rivals;
};
Selected SelectHall(const HallSearch& search);

}  // namespace focalfleet::sim
