// The requests about the audit: what was commanded or refused and by whom, and whether the record
// of it is whole.
#pragma once

#include "daemon/control/messages.h"
#include "daemon/store/audit_chain.h"
#include "daemon/verbs/store_questions.h"

namespace focalfleet {

/// {entry, at, at_ns, door, name, role, uid, gid, pid, program, address, boot_id, verb, request,
/// request_bytes, request_sha256, taken, code, reason, configuration, sha256}
Json AuditJson(const AuditEntry& entry);
/// {whole, entries, head, flaw}
Json AuditJson(const AuditVerdict& verdict);

/// The answer to `audit`: {entries}, the oldest first. Arguments: {since_ns?, until_ns?, name?,
/// verb?, limit?}. Errors: kInvalid; those of the store.
Result<StoreReading> AskAudit(const ControlRequest& request);
/// The answer to `audit_check`: the whole chain is followed. Arguments: {heads?}, texts of heads
/// that were reported outside. Errors: as AskAudit.
Result<StoreReading> AskAuditCheck(const ControlRequest& request);

}  // namespace focalfleet
