// The injector lets faults of the armed sites happen: those that go by time by itself, those that
// go by occasions when it is asked. A fault that is planned may meet nothing: a full disk no write,
// a unit that lies no question. Each site is therefore counted where it acts. The injector notes
// what a fault touches and until when.
#pragma once

#include <functional>
#include <optional>
#include <queue>
#include <string>
#include <vector>

#include "daemon/soak/draws.h"
#include "daemon/soak/fault_sites.h"
#include "daemon/soak/memory_disk.h"
#include "daemon/soak/plant.h"
#include "daemon/soak/troubles.h"
#include "protocol/base/rng.h"

namespace focalfleet::soak {

class FaultInjector {
 public:
  struct Parts {
    const Draws* draws = nullptr;
    Plant* plant = nullptr;
    MemoryDisk* disk = nullptr;
    Troubles* troubles = nullptr;
    FaultCounts* reached = nullptr;
    /// Done by the host itself at a fault of it. False: it met nothing.
    std::function<bool(FaultSite)> host;
    std::function<bool()> daemon_lives;
    /// Gets a line for each fault that goes by time.
    std::function<void(const std::string&)> tell;
  };
  FaultInjector(const Parts& parts, HostInstant now);

  /// The next fault that goes by time, or the next end of one.
  [[nodiscard]] HostInstant next() const;
  /// Does what is due. Pre: the plant has advanced to `now`.
  void Apply(HostInstant now);
  /// Whether a fault that goes by occasions happens now; it is counted then. `more` times likelier
  /// where it is most dangerous.
  bool Happens(FaultSite site, double more = 1);
  /// The host gives a frame to a bus; the old answer to it may be heard first.
  void Sent(BusId bus, const CanFrame& frame);
  /// No fault begins any more, and all that lasts has ended.
  void Heal(HostInstant now);

  /// An operation of the disk, for MemoryDisk::fails.
  int Disk(DiskOperation operation);
  /// Whether a fault that lasts is on and acts now; it is counted then.
  bool Acts(FaultSite site);
  Rng* rng() { return &rng_; }

 private:
  struct End {
    HostInstant at;
    std::uint64_t number = 0;  // in order of their begins
    std::function<void()> undo;
    bool operator>(const End& other) const {
      return std::pair(at, number) > std::pair(other.at, other.number);
    }
  };
  /// A fault on a bus or a unit: what it touches, and until when.
  struct Begun {
    std::string on;
    HostInstant until;
  };
  void Begin(FaultSite site);
  std::optional<Begun> BeginOnBus(FaultSite site);
  /// A fault that takes or spoils frames of one bus. False: the site is no such.
  bool BeginOfFrames(FaultSite site, BusId bus, HostInstant end);
  std::optional<Begun> BeginOnUnit(FaultSite site);
  void CountAnswers(FaultSite site, UnitId unit);
  void CutPower(FaultSite site, std::size_t row, HostInstant end);
  void Until(HostInstant at, std::function<void()> undo);
  void Count(FaultSite site, std::uint64_t times = 1) { (*parts_.reached)[Index(site)] += times; }
  [[nodiscard]] HostInstant Lasts();
  DurationNs Gap(FaultSite site);
  void Hear(bool garbage);

  Parts parts_;
  HostInstant now_;
  Rng rng_;
  bool healed_ = false;
  std::array<HostInstant, kFaultSites> due_{};
  std::array<bool, kFaultSites> on_{};  // of faults that last
  std::vector<bool> unplugged_;         // Shape: (n)
  std::priority_queue<End, std::vector<End>, std::greater<>> ends_;
  std::uint64_t ends_number_ = 0;
};

}  // namespace focalfleet::soak
