// SyncLine is the SYNC line: one output that marks an instant for all units of all buses at once.
// The interface hides its realisation: a line of a GPIO chip (gpio_line.h), or a recorder in a
// test.
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

  /// Sets the line active or to rest from now on. Cost: one system call.
  virtual Status Set(bool active) = 0;
  /// Chip and line, for messages.
  [[nodiscard]] virtual const std::string& name() const = 0;
};

}  // namespace focalfleet
