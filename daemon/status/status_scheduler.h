// Which status goes out when: at most so many times a second, units that changed and units that
// move; the fleet and its buses at least once a second. Everything once at the start, for those who
// were there before us.
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

  /// What is to be told now. Pre: due.
  StatusBatch Take(const FleetView& view, std::uint64_t after_batch, bool store_failing);
  /// It was not taken: all of it stays to be told.
  void GiveBack(const StatusBatch& batch, const Layout& layout);

 private:
  void TakeUnits(const FleetView& view, StatusBatch* batch);

  Options options_;
  DurationNs period_;
  DurationNs idle_period_;
  HostInstant next_{0};       // not before
  HostInstant next_idle_{0};  // by then in any case
  std::vector<std::uint8_t> changed_;
  bool any_changed_ = true;
  bool moving_ = false;
};

}  // namespace focalfleet
