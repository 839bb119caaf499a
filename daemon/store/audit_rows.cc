#include "daemon/store/audit_rows.h"

#include <utility>

namespace focalfleet::store_internal {
namespace {

/// The first fault of an entry that follows `before`; empty: none.
std::string FlawOf(const AuditEntry& entry, const AuditHead& before) {
  if (entry.entry != before.entry + 1)
    return before.entry == 0 ? "the first entries are missing"
                             : "entries after " + std::to_string(before.entry) + " are missing";
  if (entry.previous_sha256 != before.sha256)
    return "it does not follow the entry before it: one of them was changed";
  if (entry.sha256 != ChainedSha256(entry)) return "it was changed";
  return {};
}

}  // namespace

AuditEntry ReadAuditEntry(Cells& cells) {
  AuditEntry entry;
  entry.entry = cells.Whole<std::uint64_t>(0);
  entry.at = cells.Time(1);
  AuditRow& row = entry.row;
  row.boot_id = cells.Text(2);
  row.door = cells.Text(3);
  row.name = cells.Text(4);
  row.role = cells.Text(5);
  if (!cells.IsNull(6))
    row.process = AuditRow::Process{.pid = cells.Whole<std::uint32_t>(8),
                                    .uid = cells.Whole<std::uint32_t>(6),
                                    .gid = cells.Whole<std::uint32_t>(7),
                                    .program = cells.Text(9)};
  else
    cells.Require(cells.IsNull(7) && cells.IsNull(8) && cells.Text(9).empty(),
                  "it has a process without a user");
  row.address = cells.Text(10);
  row.verb = cells.Text(11);
  row.request = cells.Text(12);
  row.request_bytes = cells.Whole<std::uint64_t>(13);
  row.request_sha256 = cells.Text(14);
  row.taken = cells.Flag(15);
  row.code = cells.Text(16);
  row.reason = cells.Text(17);
  row.configuration = cells.Whole<std::uint64_t>(18);
  entry.previous_sha256 = cells.Text(19);
  entry.sha256 = cells.Text(20);
  return entry;
}

void BindAuditEntry(const AuditEntry& entry, Statement* insert) {
  const AuditRow& row = entry.row;
  Statement& s = *insert;
  s.Bind(1, static_cast<std::int64_t>(entry.entry));
  s.Bind(2, entry.at.ns);
  s.BindText(3, row.boot_id);
  s.BindText(4, row.door);
  s.BindText(5, row.name);
  s.BindText(6, row.role);
  row.process ? s.Bind(7, row.process->uid) : s.BindNull(7);
  row.process ? s.Bind(8, row.process->gid) : s.BindNull(8);
  row.process ? s.Bind(9, row.process->pid) : s.BindNull(9);
  s.BindText(10, row.process ? row.process->program : std::string_view(""));
  s.BindText(11, row.address);
  s.BindText(12, row.verb);
  s.BindText(13, row.request);
  s.Bind(14, static_cast<std::int64_t>(row.request_bytes));
  s.BindText(15, row.request_sha256);
  s.Bind(16, row.taken ? 1 : 0);
  s.BindText(17, row.code);
  s.BindText(18, row.reason);
  s.Bind(19, static_cast<std::int64_t>(row.configuration));
  s.BindText(20, entry.previous_sha256);
  s.BindText(21, entry.sha256);
}

Result<AuditHead> ReadAuditHead(Statement* head) {
  FOCALFLEET_TRY_ASSIGN(const bool found, head->Next());
  if (!found) return BeforeAudit();
  Cells cells(*head, "audit", 1);
  AuditHead last{cells.Whole<std::uint64_t>(0), cells.Text(1)};
  sqlite3_reset(head->get());
  if (cells.error()) return tl::unexpected<Error>(*cells.error());
  return last;
}

Result<AuditVerdict> CheckChain(Connection& connection,
                                const std::multimap<std::uint64_t, std::string>& known) {
  FOCALFLEET_TRY_ASSIGN(Statement rows,
                        connection.Prepare(std::string(kAuditColumns) + " ORDER BY entry"));
  AuditVerdict verdict{.head = BeforeAudit()};
  for (;;) {
    const auto more = rows.Next();
    if (!more) return tl::unexpected<Error>(connection.Named(more.error()));
    if (!*more) break;
    Cells cells(rows, "audit", 1);
    const AuditEntry entry = ReadAuditEntry(cells);
    std::string flaw = cells.error() ? cells.error()->text : FlawOf(entry, verdict.head);
    const auto [first, last] = known.equal_range(entry.entry);
    for (auto it = first; it != last; ++it)
      if (flaw.empty() && it->second != entry.sha256)
        flaw = "its hash is not the one that was reported outside";
    if (!flaw.empty()) {
      verdict.flaw = "audit entry " + std::to_string(entry.entry) + ": " + flaw;
      return verdict;
    }
    ++verdict.entries;
    verdict.head = {entry.entry, entry.sha256};
  }
  FOCALFLEET_TRY_ASSIGN(const std::int64_t counted,
                        connection.Integer("SELECT coalesce((SELECT value FROM meta WHERE key = "
                                           "'audit_entries' AND checksum = row_checksum(key, "
                                           "value)), -1)"));
  const auto reported = known.empty() ? 0 : known.rbegin()->first;
  if (counted < 0 || static_cast<std::uint64_t>(counted) != verdict.entries ||
      reported > verdict.entries)
    verdict.flaw = "the audit ends at entry " + std::to_string(verdict.entries) +
                   ", and there were more: its tail was cut off";
  return verdict;
}

}  // namespace focalfleet::store_internal
