#include "sim/campaigns/diagnosis/terms/rotor_phases.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/angle_errors.h"
#include "sim/campaigns/diagnosis/model/chances.h"

namespace focalfleet::sim {
namespace {

using Complex = std::complex<double>;

// Errors of the axis' angle at each row, in their own spread, and cut where they are far off. 0
// where nothing is known.
std::vector<double> ErrorsOf(const Fit& fit, std::size_t axis) {
  constexpr double kFar = 3;
  std::vector<double> errors(fit.facts->campaign->rows(), 0), sizes;
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const UnitTrack track = TrackOf(fit.model, *fit.facts, unit);
    for (const AngleRow& row : AngleErrors(fit, track, axis)) {
      errors[track.first_row + row.move] = row.error_deg;
      sizes.push_back(std::abs(row.error_deg));
    }
  }
  if (sizes.empty()) return errors;
  const double usual = std::max(Median(std::move(sizes)), 1e-12);
  for (double& error : errors) error = std::clamp(error / usual, -kFar, kFar);
  return errors;
}

struct Edge {
  std::size_t other = 0;
  Complex pull;  // so that conj(x_u) pull x_v is real and large, with x = exp(-i p)
};

std::vector<std::vector<Edge>> EdgesOf(const Fit& fit, std::size_t axis) {
  const CampaignFacts& facts = *fit.facts;
  const std::vector<double> errors = ErrorsOf(fit, axis);
  std::vector<std::vector<Edge>> edges(facts.neighbours.size());
  for (std::size_t u = 0; u < edges.size(); ++u)
    for (const std::size_t v : facts.neighbours[u]) {
      Complex sum = 0;
      for (const PullingPair& pair : PullOf(facts, u, v, axis))
        sum += pair.nearness * errors[pair.row] * std::polar(1.0, pair.angle_rad);
      // Im exp(i (p_u - p_v)) D = Re conj(x_u) (-i D) x_v, and both units' errors speak of it.
      edges[u].push_back({v, Complex(0, -1) * sum});
      edges[v].push_back({u, Complex(0, 1) * std::conj(sum)});
    }
  return edges;
}

struct Phases {
  std::vector<Complex> x;
  double agreement = 0;
};

// Each phase follows its neighbours' in turn, from equal ones: the agreement never falls.
Phases Synchronise(const std::vector<std::vector<Edge>>& edges, double sign) {
  constexpr int kRounds = 100;
  Phases phases{std::vector<Complex>(edges.size(), 1)};
  for (int round = 0; round < kRounds; ++round)
    for (std::size_t u = 0; u < edges.size(); ++u) {
      Complex sum = 0;
      for (const Edge& edge : edges[u]) sum += sign * edge.pull * phases.x[edge.other];
      if (std::abs(sum) > 0) phases.x[u] = sum / std::abs(sum);
    }
  for (std::size_t u = 0; u < edges.size(); ++u)
    for (const Edge& edge : edges[u])
      phases.agreement += sign * (std::conj(phases.x[u]) * edge.pull * phases.x[edge.other]).real();
  return phases;
}

}  // namespace

std::map<std::uint32_t, double> FindRotorPhases(const Fit& fit, std::size_t axis) {
  const std::vector<std::vector<Edge>> edges = EdgesOf(fit, axis);
  if (std::ranges::all_of(edges, [](const auto& of_unit) { return of_unit.empty(); })) return {};
  Phases best = Synchronise(edges, 1);
  if (Phases other = Synchronise(edges, -1); other.agreement > best.agreement)
    best = std::move(other);
  std::map<std::uint32_t, double> phase_deg;
  for (std::size_t u = 0; u < edges.size(); ++u)
    phase_deg[fit.model.units[u].id] = -std::arg(best.x[u]) / kRadiansPerDegree;
  return phase_deg;
}

}  // namespace focalfleet::sim
