// The scheduler decides which status goes out when. Units that changed and units that move go out
// at a limited rate; the fleet and its buses go out at least once a second. At the start everything
// goes out once, for readers that were there before the daemon.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/status/status_batch.h"
#include "daemon/status/status_snapshot.h"

namespace focalfleet {

class StatusScheduler {
 public:
  struct Options {
    double rate_hz = 10;  // in real time
    std::string version;
    WallTime started;
  };
  StatusScheduler(std::size_t units, Options options, const HostClock& clock);

  void Changed(std::span<const PositionerIndex> units);
  [[nodiscard]] bool due(HostInstant now) const { return now >= wake_at(); }
  [[nodiscard]] HostInstant wake_at() const;

  /// The status to be published now. Pre: due.
  StatusBatch Take(const FleetView& view, std::uint64_t after_batch, bool store_failing);
  /// The batch was not taken: all of it is to be published again.
  void GiveBack(const StatusBatch& batch, const Layout& layout);

 private:
  void TakeUnits(const FleetView& view, StatusBatch* batch);

  Options options_;
  DurationNs period_;
  DurationNs idle_period_;
  HostInstant next_{0};       // the earliest instant of the next batch
  HostInstant next_idle_{0};  // the latest instant of the next batch
  std::vector<std::uint8_t> changed_;
  bool any_changed_ = true;
  bool moving_ = false;
};

}  // namespace focalfleet
