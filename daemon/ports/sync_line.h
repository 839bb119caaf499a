// One output that tells all units of all buses an instant at once: the SYNC line. What it is made
// of is behind this door: a line of a GPIO chip (gpio_line.h), or what a test records.
#pragma once

#include <string>

#include "protocol/base/result.h"

namespace focalfleet {

class SyncLine {
 public:
  SyncLine() = default;
  SyncLine(const SyncLine&) = delete;
  SyncLine& operator=(const SyncLine&) = delete;
  virtual ~SyncLine() = default;

  /// Active from now on, or at rest. Takes as long as one system call.
  virtual Status Set(bool active) = 0;
  /// Chip and line, for people.
  [[nodiscard]] virtual const std::string& name() const = 0;
};

}  // namespace focalfleet
