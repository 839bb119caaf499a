// The plant is everything on the far side of the buses: the simulated fleet, and what of each bus a
// host would hear. The plant outlives each life of the host.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/ports/pollable_port.h"
#include "daemon/soak/draws.h"
#include "fleet/drive.h"
#include "fleet/layout.h"
#include "sim/world/world.h"

namespace focalfleet::soak {

class Plant {
 public:
  explicit Plant(const Draws& draws);

  /// The fleet lives until `now`; frames wait for the host.
  void Advance(HostInstant now);
  /// Frames that wait are lost, as where no host listens.
  void DropHeard();

  [[nodiscard]] const Layout& layout() const { return *layout_; }
  [[nodiscard]] const std::vector<UnitDrive>& drives() const { return drives_; }
  [[nodiscard]] std::span<const Fiducial> fiducials() const { return fiducials_; }
  [[nodiscard]] sim::World& world() { return *world_; }
  [[nodiscard]] const sim::World& world() const { return *world_; }
  [[nodiscard]] std::vector<ReceivedFrame>* heard(std::size_t bus) { return &heard_[bus]; }
  [[nodiscard]] bool hears() const;
  /// False: a host stamps frames when it reads them, as where its kernel has no stamps.
  [[nodiscard]] bool kernel_stamps() const { return kernel_stamps_; }
  /// The newest answer of this unit to a question of the same kind, under another
  /// sequence number. None: there is none among its last ones.
  [[nodiscard]] std::optional<CanFrame> AnsweredBefore(std::size_t bus,
                                                       const CanFrame& question) const;

 private:
  void Remember(std::size_t bus, const CanFrame& frame);

  std::unique_ptr<Layout> layout_;
  std::vector<UnitDrive> drives_;
  std::vector<Fiducial> fiducials_;
  std::unique_ptr<sim::World> world_;
  std::vector<std::vector<ReceivedFrame>> heard_;  // Shape: as the layout's buses
  std::vector<ReceivedFrame> delivered_;
  bool kernel_stamps_ = true;
  bool remembers_ = false;
  std::map<std::pair<std::size_t, std::uint32_t>, std::deque<CanFrame>> answers_;  // by bus, node
};

/// A host's port to one bus of the plant.
class PlantPort final : public PollablePort {
 public:
  /// Events of frames on their way; an exception ends the host's life there.
  struct Hooks {
    std::function<void(BusId, const CanFrame&)> sends;  // before each frame
    std::function<bool()> is_full = [] { return false; };
  };
  PlantPort(Plant* plant, std::size_t bus, Hooks hooks);

  std::size_t Send(std::span<const CanFrame> frames) override;
  void Receive(HostInstant now, std::vector<ReceivedFrame>* out) override;
  [[nodiscard]] LinkState state() const override;
  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] HostInstant wake_at() const override { return kNever; }
  [[nodiscard]] DurationNs retry_full() const override { return kRetryFull; }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] const std::string& trouble() const override;

 private:
  Plant* plant_;
  std::size_t index_;
  BusId bus_;
  Hooks hooks_;
  PortCounters counters_;
  std::string name_;
  struct Link;
  std::shared_ptr<Link> link_;
};

}  // namespace focalfleet::soak
