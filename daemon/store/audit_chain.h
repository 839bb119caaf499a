// The chain of the audit: each entry's SHA-256 covers all its columns and the SHA-256 of the entry
// before it. A changed, inserted or missing entry breaks the chain from there on. A tail that is
// cut off breaks nothing, so heads of the chain are also reported outside of the store.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "fleet/records.h"

namespace focalfleet {

/// An entry as it is kept.
struct AuditEntry {
  std::uint64_t entry = 0;  // 1 and on
  WallTime at;
  AuditRow row;
  std::string previous_sha256;
  std::string sha256;
  bool operator==(const AuditEntry&) const = default;
};

/// The entry that was the last one at some time, as the journal and readers of DDS know it.
struct AuditHead {
  std::uint64_t entry = 0;  // 0: there is no entry
  std::string sha256;
  bool operator==(const AuditHead&) const = default;
};

/// The place before the first entry.
AuditHead BeforeAudit();

/// The hash of the entry, over its number, time, row and `previous_sha256`.
std::string ChainedSha256(const AuditEntry& entry);

/// `12:0a1b..` as a head; none: the text is none.
std::optional<AuditHead> HeadOf(const std::string& text);
std::string Text(const AuditHead& head);

/// The finding of a check of the whole chain.
struct AuditVerdict {
  std::uint64_t entries = 0;
  AuditHead head;
  std::optional<std::string> flaw = {};  // the first; none: the chain is whole
};

}  // namespace focalfleet
