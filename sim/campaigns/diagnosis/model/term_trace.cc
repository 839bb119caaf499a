#include "sim/campaigns/diagnosis/model/term_trace.h"

#include <cmath>

namespace focalfleet::sim {

TermTrace TraceOf(const Fit& fit, const ModelTerm& term) {
  CampaignModel only;
  only.units = fit.model.units;
  const Places without = Predict(only, *fit.facts, fit.parallel);
  only.terms.push_back(term);
  const Places with = Predict(only, *fit.facts, fit.parallel);
  const Campaign& campaign = *fit.facts->campaign;
  TermTrace trace;
  trace.square_um2.assign(campaign.units.size(), 0);
  double sum = 0, count = 0;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    if (term.group_of_unit[unit] == kNoGroup) continue;
    double square = 0, n = 0;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      const double dx = 1e3 * (with.x_mm[row] - without.x_mm[row]);
      const double dy = 1e3 * (with.y_mm[row] - without.y_mm[row]);
      square += dx * dx + dy * dy, n += 1;
    }
    if (n == 0) continue;
    trace.square_um2[unit] = square;
    sum += square, count += n;
  }
  trace.rms_um = count > 0 ? std::sqrt(sum / count) : 0;
  return trace;
}

double SizeOf(const Fit& fit, const ModelTerm& term) { return TraceOf(fit, term).rms_um; }

}  // namespace focalfleet::sim
