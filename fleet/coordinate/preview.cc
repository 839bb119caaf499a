#include "fleet/coordinate/preview.h"

#include <utility>

#include "fleet/coordinate/stall_detection.h"

namespace focalfleet {
namespace {

/// Why the unit cannot go to `target` now; empty: it can, as far as it alone is concerned.
std::string WhyNot(const UnitTable& units, PositionerIndex i, const Pose& target) {
  const UnitView& view = units[i].view;
  if (!view.enabled) return "disabled: " + view.disabled_reason;
  if (view.phase != UnitPhase::kReady) return "it " + units.TroubleOf(i);
  if (!IsPlace(view.knowledge)) return "its place " + units.WhyNoPlace(i);
  if (units.NearestInReach(i, target) != target)
    return "its range, as it was measured, ends before it";
  return {};
}

}  // namespace

Preview PreviewOf(const Coordination& fleet, const Goal& goal, double start_skew_s) {
  Preview preview{.job = {.purpose = PlanPurpose::kPreview,
                          .start = {},
                          .targets = {},
                          .frozen = {},
                          .offsets = {},
                          .options = {},
                          .to_home = {}},
                  .refused = {}};
  PlanJob& job = preview.job;
  job.options.fixed = goal.fixed;
  job.options.lead_apart = true;
  job.options.start_skew_s = start_skew_s;
  job.options.notice_s = StallDetectionOf(fleet.config).notice.seconds();
  for (std::uint32_t n = 0; n < fleet.units.size(); ++n) {
    const UnitView& view = fleet.units[{n}].view;
    UnitKnowledge knowledge = view.knowledge;
    Pose offset = view.offset;
    const bool usable = view.enabled && view.phase == UnitPhase::kReady;
    std::optional<Pose> target = goal.targets[n];
    if (target) {
      ++preview.targeted;
      if (std::string why = WhyNot(fleet.units, {n}, *target); !why.empty()) {
        preview.refused.push_back({{n}, std::move(why)});
        target.reset();
      } else if (!goal.offsets.empty() && goal.offsets[n]) {
        // The model in force has another idea of where the unit stands than its count.
        Pose place = PlaceOf(knowledge);
        for (const Axis axis : kAxes)
          place[Index(axis)] += (*goal.offsets[n])[Index(axis)] - offset[Index(axis)];
        offset = *goal.offsets[n];
        knowledge = Exactly(Witness::kReported, place);
      }
    }
    job.start.push_back(knowledge);
    job.offsets.push_back(offset);
    job.frozen.push_back(usable ? 0 : 1);
    job.targets.push_back(target);
  }
  return preview;
}

}  // namespace focalfleet
