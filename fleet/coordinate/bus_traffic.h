// The traffic of the buses is counted exactly here: frames and bits of both directions, load of the
// last second, bits of the upload under way.
#pragma once

#include <span>

#include "fleet/coordinate/coordinator_config.h"
#include "fleet/coordinate/step_state.h"
#include "fleet/coordinate/unit_record.h"
#include "fleet/coordinate/unit_table.h"
#include "protocol/link/frame_port.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet {

class BusTraffic {
 public:
  /// All arguments outlive this.
  BusTraffic(const CoordinatorConfig& config, const StepState& step, UnitTable* units);

  void CountHeard(const ReceivedFrame& received, BusRecord* bus);
  /// Counts the frames among the step's effects, and closes the second over which the load is
  /// taken where it is over.
  void EndStep();

 private:
  /// Frames that passed the bus together: one, or those of a group.
  void Count(BusRecord* bus, std::span<const CanFrame> frames) const;
  void CountSent();
  void CloseLoadWindow(BusRecord* bus) const;

  const BusRates rates_;
  const StepState& step_;
  UnitTable& units_;
  /// The end of the last frame heard; later than `now` where the host was held up on its way to the
  /// frame.
  HostInstant heard_until_{INT64_MIN};
};

}  // namespace focalfleet
