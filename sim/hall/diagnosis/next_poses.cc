// The poses that would best separate the remaining rivals. Each pose is the one whose voltages are
// least foreseen, given the campaign and the poses chosen before it (greedy D-optimal design over
// all parameters).

#include "sim/hall/diagnosis/findings.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kPosesProposed = 24;

HallCampaign Candidates(std::size_t sensors) {
  HallCampaign candidates;
  for (const double alpha_deg : {-12.0, -6.0, 0.0, 6.0, 12.0})
    for (const double beta_deg : {-12.0, -6.0, 0.0, 6.0, 12.0})
      for (const double gamma_deg : {-40.0, -20.0, 0.0, 20.0, 40.0}) {
        candidates.poses.push_back(
            {alpha_deg * kRadPerDeg, beta_deg * kRadPerDeg, gamma_deg * kRadPerDeg});
        candidates.rows.push_back({std::vector<double>(sensors, 0)});
      }
  return candidates;
}

}  // namespace

std::vector<Orientation> ProposePoses(const HallForward& forward, const VectorXd& parameters,
                                      const std::vector<Reading>& readings, double noise_V) {
  const std::size_t sensors = forward.layout().sensors;
  std::vector<std::size_t> all;
  for (std::size_t k = 0; k < forward.layout().size(); ++k)
    if (k != ParameterLayout::kDecay && k != ParameterLayout::kTemperature) all.push_back(k);
  const MatrixXd known = forward.Slopes(parameters, readings, all) / noise_V;
  MatrixXd information = known.transpose() * known;
  // The prior: no parameter is expected to exceed some hundredths.
  for (Index i = 0; i < information.rows(); ++i) information(i, i) += 1e3;
  MatrixXd covariance =
      information.llt().solve(MatrixXd::Identity(information.rows(), information.cols()));

  const HallCampaign candidates = Candidates(sensors);
  const HallForward there = forward.At(candidates);
  std::vector<Reading> asked;
  for (std::size_t row = 0; row < candidates.poses.size(); ++row)
    for (std::size_t sensor = 0; sensor < sensors; ++sensor) asked.push_back({row, sensor});
  const MatrixXd slopes = there.Slopes(parameters, asked, all) / noise_V;
  std::vector<Orientation> poses;
  std::vector<bool> taken(candidates.poses.size(), false);
  const auto height = static_cast<Index>(sensors);
  while (poses.size() < kPosesProposed) {
    const MatrixXd spread = slopes * covariance;
    std::size_t best = 0;
    double most = -1;
    for (std::size_t row = 0; row < candidates.poses.size(); ++row) {
      const auto begin = static_cast<Index>(row) * height;
      const double unforeseen =
          spread.middleRows(begin, height).cwiseProduct(slopes.middleRows(begin, height)).sum();
      if (!taken[row] && unforeseen > most) {
        most = unforeseen;
        best = row;
      }
    }
    taken[best] = true;
    poses.push_back(candidates.poses[best]);
    for (std::size_t sensor = 0; sensor < sensors; ++sensor) {
      const VectorXd row = slopes.row(static_cast<Index>(best * sensors + sensor)).transpose();
      const VectorXd reach = covariance * row;
      covariance -= reach * reach.transpose() / (1 + row.dot(reach));
    }
  }
  return poses;
}

}  // namespace focalfleet::sim
