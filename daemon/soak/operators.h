// The operators of a simulated night: they send requests at random, or those that set a fleet right
// again, and note the answers. Each request has a client of its own. They know of no pause of the
// host, and go on sending. Each request is answered while the daemon lives. The longest waits are
// those for a configuration, some 100 s a round, and for plans behind slow ones of up to 60 s each.
// All others wait for the store at most.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/control/messages.h"
#include "daemon/soak/draws.h"
#include "daemon/soak/fault_sites.h"
#include "daemon/soak/judge.h"
#include "daemon/soak/plant.h"
#include "protocol/base/rng.h"

namespace focalfleet::soak {

class Operators {
 public:
  struct Parts {
    const Draws* draws = nullptr;
    const Plant* plant = nullptr;
    Judge* judge = nullptr;
    const Troubles* troubles = nullptr;
    FaultCounts* reached = nullptr;
    /// Puts a line into the daemon that lives; nothing where none does.
    std::function<void(std::uint64_t client, const std::string& line)> put;
    std::function<bool()> is_busy;  // a configuration is under way
  };
  explicit Operators(const Parts& parts);

  [[nodiscard]] HostInstant next() const { return next_; }
  /// Sends what occurs to them now.
  void Act(HostInstant now);

  /// Sends a request; the number by which Answer knows it.
  std::uint64_t Ask(const std::string& verb, Json args);
  /// The answer; none: it has not come.
  [[nodiscard]] const ControlAnswer* Answer(std::uint64_t request) const;
  /// Targets for the fleet, as the text of a file.
  std::string DrawTargets(double share);

  /// A line of the daemon. False: the client is gone.
  bool Hear(std::uint64_t client, std::string_view line, bool last);
  /// Looks for requests that should have been answered by now.
  void LookForUnanswered(HostInstant now);
  /// Everything is over: no request may be open that is older than a person's pause.
  void LookAtEnd(HostInstant now);
  /// Clients of a daemon that died hear no more.
  void DaemonDied() { open_.clear(); }

  [[nodiscard]] std::uint64_t digest() const { return digest_; }
  [[nodiscard]] std::uint64_t answers() const { return answered_; }

 private:
  struct Open {
    std::string verb;
    HostInstant asked = {};
    std::optional<UnitId> unit;
    std::vector<std::uint32_t> changes = {};  // units that it enables or disables
    bool gone = false;
  };
  bool Wants(FaultSite site, double chance);
  Json OneUnit(UnitId* unit);
  void ChangeModel();
  void ActAtRandom();
  void CheckAnswer(std::uint64_t client, const Open& open, const ControlAnswer& answer);

  Parts parts_;
  Rng rng_;
  HostInstant now_{0};
  HostInstant next_;
  std::uint64_t client_ = 0;
  std::map<std::uint64_t, Open> open_;
  std::map<std::uint32_t, std::uint64_t> newest_change_;  // the request to enable or disable a unit
  std::map<std::uint64_t, ControlAnswer> answers_;
  std::uint64_t answered_ = 0;
  std::uint64_t digest_ = 0xcbf29ce484222325u;
};

}  // namespace focalfleet::soak
