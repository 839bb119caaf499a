// The blame judge looks at alarms that speak ill of a unit. The rule is:
//
//   blame      No unit is said to be silent, and no clock is said to be off, where neither the unit
//              nor its bus has had a fault: a host that stood still, died, or had no stamps of its
//              kernel is no fault of the unit. A clock within what plans allow for is not off,
//              whatever buses do to its answers.
//
// A unit that answers late or under another number may be blamed, and so may one without power.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>

#include "daemon/soak/plant.h"
#include "daemon/soak/troubles.h"
#include "fleet/records.h"

namespace focalfleet::soak {

class BlameJudge {
 public:
  using Broken = std::function<void(const std::string& rule, const std::string& what)>;
  BlameJudge(const Plant* plant, const Troubles* troubles, Broken broken)
      : plant_(plant), troubles_(troubles), broken_(std::move(broken)) {}

  void Committed(std::span<const Row> rows, HostInstant now);

 private:
  /// The unit itself has had no fault since then.
  [[nodiscard]] bool IsWell(std::size_t row, HostInstant since) const;
  [[nodiscard]] bool IsHeard(std::size_t row, HostInstant since) const;

  const Plant* plant_;
  const Troubles* troubles_;
  Broken broken_;
};

}  // namespace focalfleet::soak
