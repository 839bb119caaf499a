// The trail of commands: who gave which one by which door, and whether it was taken. A command's
// entry goes to the store in the transaction of the command's own first rows, so neither is there
// without the other. Refusals are kept, too. Questions are not.
//
// Nothing waits for an entry. No caller can fill the disk: of refusals and stops kRepeatsKept a
// minute are kept of each, and the next entry of the caller says how many were left out. While too
// many rows wait for the disk, none of them is kept.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/access/caller.h"
#include "daemon/clock/wall_time.h"
#include "fleet/coordinate/effects.h"
#include "fleet/records.h"
#include "protocol/base/result.h"

namespace focalfleet {

class AuditTrail {
 public:
  /// `boot_id` tells starts of the machine apart, where its clock was set.
  explicit AuditTrail(std::string boot_id = {}) : boot_id_(std::move(boot_id)) {}

  /// A command goes to the coordinator in this turn. `line` is the request as it came.
  void Commanded(std::uint64_t request, const Caller& caller, std::string_view verb,
                 std::string_view line);
  /// A line that is not kept is not hashed: some 5 ms for the longest one.
  void Refused(WallTime now, const Caller& caller, std::string_view verb, std::string_view line,
               const Error& why);

  /// Entries wait for Take.
  [[nodiscard]] bool waiting() const { return !entries_.empty(); }
  struct Turn {
    std::uint64_t configuration = 0;  // under way; 0: none
    WallTime now;
    bool full = false;  // too many rows wait for the disk
  };
  /// The entries of this turn are put before `rows`, with the coordinator's refusals among
  /// `replies` and, for commands that move units, the configuration under way.
  void Take(std::span<const ReplyEffect> replies, const Turn& turn, std::vector<Row>* rows);

  static constexpr std::uint32_t kRepeatsKept = 60;

 private:
  struct Entry {
    std::uint64_t request = 0;  // 0: refused before it became one
    AuditRow row;
  };
  struct Quota {
    std::int64_t began_ns = 0;
    std::uint32_t kept = 0;
    std::uint64_t left_out = 0;
  };
  Quota& QuotaOf(const std::string& name, WallTime now);
  /// Whether the entry is kept; it then tells what was left out before.
  bool Admit(const Turn& turn, Entry* entry);
  void Add(std::uint64_t request, const Caller& caller, std::string_view verb,
           std::string_view line, AuditRow row);

  std::string boot_id_;
  std::vector<Entry> entries_;
  std::map<std::string, Quota> quotas_;  // by name of the caller
  bool full_ = false;                    // as of the last turn
};

}  // namespace focalfleet
