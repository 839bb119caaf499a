// SimulatedPort gives access to a fleet in the daemon's own process, for a first look and for
// tests. All buses share one simulated world on the daemon's clock. The world is lost when the
// daemon ends; that of focalfleet-sim is not. A port reports the state of its host controller as a
// SocketCAN port does.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/ports/can_errors.h"
#include "daemon/ports/pollable_port.h"
#include "fleet/layout.h"
#include "sim/world/world.h"

namespace focalfleet {

class SimulatedFleet {
 public:
  /// A fleet whose world follows `clock`; without a clock, the instants given to Take.
  /// Errors: kInvalid: the simulation cannot have such units.
  static Result<std::shared_ptr<SimulatedFleet>> Create(sim::WorldConfig config,
                                                        std::optional<HostClock> clock = {});

  bool Inject(BusId bus, const CanFrame& frame);
  /// Advances the whole fleet to `now` and appends the frames that this bus received.
  void Take(BusId bus, HostInstant now, std::vector<ReceivedFrame>* out);
  /// The next event of this bus; at once where its frames already wait, delivered while another bus
  /// was served.
  [[nodiscard]] HostInstant NextEvent(BusId bus) const;
  [[nodiscard]] bool dead(BusId bus) const { return world_.dead(bus); }
  [[nodiscard]] sim::World& world() { return world_; }

 private:
  SimulatedFleet(sim::WorldConfig config, const std::optional<HostClock>& clock)
      : world_(std::move(config)), clock_(clock) {}

  sim::World world_;
  std::optional<HostClock> clock_;
  std::vector<ReceivedFrame> delivered_;
  std::unordered_map<BusId, std::vector<ReceivedFrame>> inbox_;
};

/// The units of a layout as the simulation describes them.
std::vector<sim::UnitDescription> DescribeUnits(const Layout& layout);

/// The joints of the layout's units, if any unit has sensors; else null. With a real spread,
/// sensors differ from their calibration by 0.05 % and 0.2 mV.
std::shared_ptr<const sim::JointSensors> MakeJoints(const Layout& layout, std::uint64_t seed,
                                                    sim::Spread spread);

/// The state and trouble that a port reports of its simulated controller, in the words of the
/// SocketCAN port.
class SimulatedLink {
 public:
  explicit SimulatedLink(BusId bus) : bus_(bus) {}
  /// True if state or trouble have changed.
  bool Look(const sim::World& world);
  [[nodiscard]] LinkState state() const { return state_; }
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  [[nodiscard]] std::uint64_t errors() const { return errors_seen_; }  // error frames

 private:
  BusId bus_;
  LinkState state_ = LinkState::kUp;
  std::string trouble_;
  ErrorTally tally_;
  std::array<std::uint64_t, sim::kFrameErrorCount> counted_{};
  std::uint64_t errors_seen_ = 0;
};

class SimulatedPort : public PollablePort {
 public:
  SimulatedPort(std::shared_ptr<SimulatedFleet> fleet, BusId bus);

  std::size_t Send(std::span<const CanFrame> frames) override;
  void Receive(HostInstant now, std::vector<ReceivedFrame>* out) override;
  [[nodiscard]] LinkState state() const override;
  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] HostInstant wake_at() const override { return fleet_->NextEvent(bus_); }
  [[nodiscard]] DurationNs retry_full() const override { return kRetryFull; }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] const std::string& trouble() const override { return link_.trouble(); }

 private:
  std::shared_ptr<SimulatedFleet> fleet_;
  BusId bus_;
  PortCounters counters_;
  std::string name_;
  SimulatedLink link_;
};

}  // namespace focalfleet
