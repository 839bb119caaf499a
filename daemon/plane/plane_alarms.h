// The alarms of a plane's coordinator, which has no store: they live as long as its process does.
// Each of them is of a condition that the next life finds anew. The log has them all.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "daemon/control/messages.h"
#include "daemon/dds/status_values.h"
#include "daemon/verbs/alarm_register.h"
#include "fleet/coordinate/inputs.h"

namespace focalfleet {

class PlaneAlarms {
 public:
  /// Alarms and ends of conditions are in the register and in the log; returns them for DDS.
  std::vector<AlarmValue> Take(std::span<const ShellNote> notes, WallTime now);

  /// True: Answer knows the verb.
  static bool IsAbout(const std::string& verb) { return verb.starts_with("alarms"); }
  /// The answer to `alarms`, `alarms_ack`, `alarms_mute` or `alarms_unmute`, as a daemon of its own
  /// gives it; `by` names the operator. Errors: kInvalid, kRefused: also `all`, which asks for what
  /// a store would have.
  Result<Json> Answer(const ControlRequest& request, const std::string& by, WallTime now);

  /// As `status` shows them: {open, muted, worst}.
  [[nodiscard]] Json CountsJson(WallTime now) const;
  [[nodiscard]] AlarmRegister::Counts Count(WallTime now) const { return open_.Count(now); }

 private:
  AlarmRegister open_;
  std::uint64_t next_id_ = 1;
};

}  // namespace focalfleet
