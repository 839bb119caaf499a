// DiagnosisFigures are the pictures of report.html: where on the plate the errors are, what they
// look like against the columns of the campaign, and which orders of the gears are in them. Each
// has the errors by static geometry alone beside those by the extended model, at one scale.
#pragma once

#include <cstddef>
#include <vector>

#include "daemon/report/plot.h"
#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/use/residual_views.h"

namespace focalfleet {

class DiagnosisFigures {
 public:
  /// Lifetime: both outlive the figures.
  DiagnosisFigures(const sim::Campaign& campaign, const sim::Diagnosis& diagnosis);

  /// Maps of the units' residuals before and after, then of the amplitudes of the causes that are
  /// the units' own.
  [[nodiscard]] std::vector<report::Svg> Maps() const;
  /// Arrows of one exposure before and after, and the cloud of all residuals.
  [[nodiscard]] std::vector<report::Svg> Arrows() const;
  /// Signed errors of the axis' angle against those columns that show most in them, the clearest
  /// first.
  [[nodiscard]] std::vector<report::Svg> Against(std::size_t axis) const;
  [[nodiscard]] report::Svg Spectrum(std::size_t axis) const;

  [[nodiscard]] const sim::UnitResiduals& units() const { return units_; }
  /// Nothing was measured that a picture could show.
  [[nodiscard]] bool empty() const;

 private:
  const sim::Campaign& campaign_;
  const sim::Diagnosis& diagnosis_;
  sim::CampaignFacts facts_;
  sim::AngleResiduals angles_;
  sim::UnitResiduals units_;
};

}  // namespace focalfleet
