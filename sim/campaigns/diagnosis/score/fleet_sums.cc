#include "sim/campaigns/diagnosis/score/fleet_sums.h"

#include <algorithm>

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<std::size_t> ExposuresOf(const Fit& fit, const UnitChunk& chunk) {
  std::vector<bool> is_in(fit.facts->exposures.size());
  for (std::size_t unit = chunk.begin; unit < chunk.end; ++unit) {
    const UnitTrack track = TrackOf(fit.model, *fit.facts, unit);
    for (std::size_t row = track.first_row; row < track.first_row + track.moves; ++row)
      is_in[fit.facts->exposures.of_row[row]] = true;
  }
  std::vector<std::size_t> exposures;
  for (std::size_t e = 0; e < is_in.size(); ++e)
    if (is_in[e]) exposures.push_back(e);
  return exposures;
}

void Add(const Lanes& from, Lanes* to) { AddLanes(from, to); }
void Add(double from, double* to) { *to += from; }

// The exposures of a chunk among those of the whole.
struct Merging {
  std::vector<std::size_t> at;  // Shape: (exposures of the chunk)
  std::size_t exposures = 0;    // of the whole

  // Shapes: from (rows, exposures of the chunk, size), to (rows, exposures, size).
  template <class Value>
  void AddTo(const std::vector<Value>& from, std::size_t size, std::vector<Value>* to) const {
    const Value* next = from.data();
    for (Value* row = to->data(); next != from.data() + from.size(); row += exposures * size)
      for (const std::size_t e : at)
        for (std::size_t i = 0; i < size; ++i) Add(*next++, row + e * size + i);
  }
};

void Merge(const PassPlan& plan, const LookSums& from, const Merging& merging, LookSums* to) {
  for (std::size_t k = 0; k < from.of_template.size(); ++k) {
    const TemplateSums& a = from.of_template[k];
    TemplateSums& b = to->of_template[k];
    const std::size_t c = plan.templates[k].columns;
    merging.AddTo(a.exposure_g, c * c, &b.exposure_g);
    b.raw += a.raw, b.kept += a.kept;
    b.spread_sum += a.spread_sum, b.spread_count += a.spread_count;
  }
  merging.AddTo(from.exposure_b, 1, &to->exposure_b);
  merging.AddTo(from.exposure_g, 1, &to->exposure_g);
  for (std::size_t i = 0; i < from.shared_cross.size(); ++i)
    AddLanes(from.shared_cross[i], &to->shared_cross[i]);
  to->shared_g += from.shared_g;
  to->shared_b += from.shared_b;
  to->shared_target_b += from.shared_target_b;
  to->target_square += from.target_square;
  to->residual_square += from.residual_square;
  to->values += from.values;
}

}  // namespace

FleetSums EmptySums(const PassPlan& plan, const UnitChunk& chunk) {
  FleetSums sums{ExposuresOf(plan.fit, chunk), std::vector<LookSums>(plan.withouts.size())};
  const std::size_t exposures = sums.exposures.size();
  for (std::size_t l = 0; l < sums.looks.size(); ++l) {
    LookSums& look = sums.looks[l];
    const auto shared = static_cast<Index>(plan.shared.of_look[l].size());
    look.of_template.resize(plan.templates.size());
    for (std::size_t k = 0; k < plan.templates.size(); ++k)
      if (const std::size_t c = plan.templates[k].columns; c > 1)
        look.of_template[k].exposure_g.assign(exposures * c * c, 0);
    look.exposure_b.resize(plan.blocks.size() * exposures);
    look.exposure_g.resize(plan.blocks.size() * exposures);
    look.shared_cross.resize(plan.blocks.size() * plan.shared.of_look[l].size());
    look.shared_g = MatrixXd::Zero(shared, shared);
    look.shared_b = VectorXd::Zero(shared);
    look.shared_target_b = VectorXd::Zero(shared);
  }
  return sums;
}

void AddSums(const PassPlan& plan, const FleetSums& from, FleetSums* to) {
  Merging merging{.at = {}, .exposures = to->exposures.size()};
  auto next = to->exposures.begin();  // both are in order
  for (const std::size_t exposure : from.exposures) {
    next = std::lower_bound(next, to->exposures.end(), exposure);
    merging.at.push_back(static_cast<std::size_t>(next - to->exposures.begin()));
  }
  for (std::size_t l = 0; l < from.looks.size(); ++l)
    Merge(plan, from.looks[l], merging, &to->looks[l]);
}

}  // namespace focalfleet::sim
