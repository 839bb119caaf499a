// The stop judge looks at what stops are worth. The rule is:
//
//   stop       Within a bound after a stop was ordered, no unit that it can reach moves. After a
//              stop of all was answered, no unit begins to move before the next command.
//
// A host that was dead or held up between the order and its bound excuses the first half of the
// rule, and nothing excuses the second one on the host's side: it has answered.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/soak/plant.h"
#include "daemon/soak/troubles.h"
#include "sim/world/world.h"

namespace focalfleet::soak {

class StopJudge {
 public:
  using Broken = std::function<void(const std::string& rule, const std::string& what)>;
  StopJudge(const Plant* plant, const Troubles* troubles, Broken broken)
      : plant_(plant),
        troubles_(troubles),
        broken_(std::move(broken)),
        must_rest_(plant->layout().size(), kNever) {}

  /// A stop is asked for; no unit: of all.
  void Ordered(HostInstant now, std::optional<UnitId> unit);
  /// A stop of all, asked for at `asked`, is answered.
  void AllStopped(HostInstant asked, HostInstant now);
  /// A command that moves units is given.
  void MotionCommanded(HostInstant now);

  void Look(HostInstant now, std::size_t row, const sim::UnitTruth& truth);
  /// The unit has begun a move since the last look.
  void LookAtStart(std::size_t row, const sim::UnitTruth& truth);

 private:
  /// No fault of bus or unit has kept a frame from the unit since then.
  [[nodiscard]] bool IsReached(std::size_t row, HostInstant since) const;

  const Plant* plant_;
  const Troubles* troubles_;
  Broken broken_;
  std::vector<HostInstant> must_rest_;  // Shape: (n)
  HostInstant commanded_{INT64_MIN};
  HostInstant all_stopped_ = kNever;  // kNever: or something was commanded since
};

}  // namespace focalfleet::soak
