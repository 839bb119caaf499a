// The seat of a sector in its plane: the agent (fleet/plane/sector_agent.h) with its link, and the
// thread that keeps the epoch. The shell calls it once a turn, on the core thread.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/loop/event_signal.h"
#include "daemon/loop/job_thread.h"
#include "daemon/loop/sector_port.h"
#include "daemon/plane/plane_link.h"
#include "daemon/plane/sector_memory.h"
#include "fleet/plane/sector_agent.h"

namespace focalfleet {

class SectorSeat final : public SectorPort {
 public:
  struct Options {
    SectorAgentConfig agent;
    DdsOptions dds;
    std::string memory;                                                        // path of its file
    std::function<void(const std::string&)> tell = [](const std::string&) {};  // troubles of DDS
    std::function<void(const std::string&)> log_error;
  };
  /// `wake` is raised when something has arrived; it outlives the seat. Errors: those of
  /// SectorMemory; kUnavailable: no descriptors left.
  static Result<std::unique_ptr<SectorSeat>> Create(Options options, const EventSignal* wake);

  void Gather(HostInstant now, const Coordinator& coordinator, std::vector<Command>* commands,
              std::vector<ShellNote>* notes) override;
  void Take(Effects* effects) override;
  [[nodiscard]] HostInstant wake_at() const override { return wake_at_; }

 private:
  struct Kept {
    PlaneEpoch epoch;
    Status status;
  };
  using Keeper = JobThread<PlaneEpoch, Kept>;

  SectorSeat(Options options, SectorMemory memory);
  std::shared_ptr<const SectorPlaces> PlacesIfDue(HostInstant now, const Coordinator& coordinator);

  Options options_;
  SectorMemory memory_;
  SectorAgent agent_;
  PlaneEpoch kept_;
  PlaneEpoch keeping_;
  Effects last_;  // what the agent has not seen yet
  bool any_ = false;
  HostInstant wake_at_{0};
  HostInstant places_at_{0};  // when the places are due to be looked at
  std::unique_ptr<Keeper> keeper_;
  std::unique_ptr<PlaneLink> link_;
};

}  // namespace focalfleet
