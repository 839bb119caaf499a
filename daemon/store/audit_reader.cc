// The part of StoreReader that reads the audit.

#include <map>

#include "daemon/store/audit_rows.h"
#include "daemon/store/store_reader.h"

namespace focalfleet {

using namespace store_internal;

Result<std::vector<AuditEntry>> StoreReader::Audit(const AuditFilter& filter) {
  const std::string sql = std::string(kAuditColumns) +
                          " WHERE at_ns >= ?2 AND at_ns < ?3 AND (?4 = '' OR name = ?4) AND "
                          "(?5 = '' OR verb = ?5) ORDER BY entry DESC LIMIT ?1";
  FOCALFLEET_TRY_ASSIGN(Statement statement, connection_->Prepare(sql));
  statement.Bind(1, filter.limit);
  statement.Bind(2, filter.period.since.ns);
  statement.Bind(3, filter.period.until.ns);
  statement.BindText(4, filter.name);
  statement.BindText(5, filter.verb);
  std::vector<AuditEntry> entries;
  for (;;) {
    const auto row = statement.Next();
    if (!row) return tl::unexpected<Error>(connection_->Named(row.error()));
    if (!*row) return entries;
    Cells cells(statement, "audit", 1);
    entries.push_back(ReadAuditEntry(cells));
    if (cells.error()) return tl::unexpected<Error>(connection_->Named(*cells.error()));
  }
}

Result<AuditVerdict> StoreReader::CheckAudit(const std::vector<AuditHead>& heads) {
  std::multimap<std::uint64_t, std::string> known;
  for (const AuditHead& head : heads) known.emplace(head.entry, head.sha256);
  // A single transaction, so that the count fits the rows.
  connection_->Rollback();
  FOCALFLEET_TRY(connection_->Execute("BEGIN"));
  auto verdict = CheckChain(*connection_, known);
  connection_->Rollback();
  return verdict;
}

}  // namespace focalfleet
