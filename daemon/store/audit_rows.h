// Rows of the audit, written and read within the store.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "daemon/store/audit_chain.h"
#include "daemon/store/cells.h"
#include "daemon/store/sqlite.h"

namespace focalfleet::store_internal {

/// The query of all columns, in the order of ReadAuditEntry; what follows it begins with a blank.
inline constexpr const char* kAuditColumns =
    "SELECT entry, at_ns, boot_id, door, name, role, uid, gid, pid, program, address, verb, "
    "request, request_bytes, request_sha256, taken, code, reason, configuration, previous_sha256, "
    "sha256 FROM audit";
inline constexpr const char* kAuditInsert =
    "INSERT INTO audit(entry, at_ns, boot_id, door, name, role, uid, gid, pid, program, address, "
    "verb, request, request_bytes, request_sha256, taken, code, reason, configuration, "
    "previous_sha256, sha256) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, "
    "?15, ?16, ?17, ?18, ?19, ?20, ?21)";
inline constexpr const char* kAuditHeadSql =
    "SELECT entry, sha256 FROM audit ORDER BY entry DESC LIMIT 1";

AuditEntry ReadAuditEntry(Cells& cells);
/// `insert` is of kAuditInsert.
void BindAuditEntry(const AuditEntry& entry, Statement* insert);
/// The last entry, or BeforeAudit; `head` is of kAuditHeadSql.
Result<AuditHead> ReadAuditHead(Statement* head);
/// The whole chain is followed; the entries of `known` have these hashes.
Result<AuditVerdict> CheckChain(Connection& connection,
                                const std::multimap<std::uint64_t, std::string>& known);

}  // namespace focalfleet::store_internal
