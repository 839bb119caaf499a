// The plane's coordinator takes a configuration over all sectors: one plan, one start instant.
//
//   listening -> claiming -> idle -> recording -> gathering -> planning -> preparing -> moving
//                                                     ^           |            |          |
//                                                     +-----------+------------+----------+
//                                                     |
//                                                     +-> finishing -> idle      (stop: stopping)
//                                                     |        |
//                                                     +--- measuring
//
// gathering   every sector is given the configuration, and asks for a plan
// planning    one plan of all units of the sectors that ask (plane_plan.h)
// preparing   each sector uploads its part, reads back, arms, and makes its intents durable
// moving      all sectors that hold the round have the start instant; each moves or gives it back
// finishing   nothing is left to move: each sector ends the configuration, or asks for an exposure
// measuring   the plane's camera looks at all units at once; each sector gets its own, and
//             asks for the next round of corrections, or ends the configuration
//
// The state is what the sectors report. The coordinator keeps its epoch, the configuration under
// way and the last one that is over, and nothing else, so that a new life of it goes on in any
// phase: it takes a new epoch, gives back what is held, waits until what moves has ended, and goes
// on with a new plan.
//
// Two coordinators. Each sector follows the highest epoch that it has heard. A coordinator that
// hears of a higher one than its own says nothing more, and takes over again where no sector has
// had an order for PlaneTimes::takeover. While sectors follow different coordinators, units at the
// borders between them stand (plane_plan.h), so that nothing can touch.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "fleet/plane/plane_layout.h"
#include "fleet/plane/plane_recall.h"
#include "fleet/plane/plane_rounds.h"
#include "fleet/plane/plane_state.h"
#include "fleet/plane/plane_tasks.h"
#include "fleet/plane/sector_clock_watch.h"

namespace focalfleet {

struct PlaneInputs {
  HostInstant now;
  std::span<const SectorReport> reports = {};
  std::span<const PlaneCommand> commands = {};
  std::span<const PlanePlanDone> plans = {};
  std::span<const ExposureDone> exposures = {};  // units by the plane's positions
  std::uint64_t kept = 0;                        // the number of the last record that is durable
};

class PlaneCoordinator {
 public:
  /// `plane` outlives the coordinator. `self` is its own number, which no other coordinator has.
  PlaneCoordinator(const PlaneLayout* plane, const PlaneTimes& times, std::uint64_t self,
                   PlaneRecord kept);
  PlaneCoordinator(const PlaneCoordinator&) = delete;
  PlaneCoordinator& operator=(const PlaneCoordinator&) = delete;

  void Step(const PlaneInputs& inputs, PlaneEffects* effects);

  [[nodiscard]] const PlaneView& view() const { return state_.view; }
  [[nodiscard]] const SectorBook& sectors() const { return state_.sectors; }
  [[nodiscard]] bool busy() const { return state_.record.under_way.has_value(); }
  /// Null: none.
  [[nodiscard]] const PlaneConfiguration* under_way() const {
    return busy() ? &*state_.record.under_way : nullptr;
  }

 private:
  void Proceed();
  void Listen();
  void Claim();
  void Obey(const PlaneCommand& command);
  Status Do(std::uint64_t request, const PlaneApplyCommand& command);
  Status Do(std::uint64_t request, const PlaneStopCommand& command);
  Status Do(std::uint64_t request, const PlaneHomeCommand& command);
  Status Do(std::uint64_t request, const PlaneRetargetCommand& command);
  Status Do(std::uint64_t request, const PlaneMeasureCommand& command);
  [[nodiscard]] Status MayBegin() const;
  void Begin(std::uint64_t request, PlaneConfiguration configuration);
  void AnswerRetargets();

  PlaneState state_;
  PlaneRounds rounds_;
  PlaneRecall recall_;
  SectorClockWatch clock_watch_;
  /// Changes of targets whose sectors have not carried them out yet.
  struct Retargeting {
    std::uint64_t request = 0;
    std::uint64_t change = 0;
    PositionerIndex unit;
  };
  std::vector<Retargeting> retargetings_;
};

}  // namespace focalfleet
