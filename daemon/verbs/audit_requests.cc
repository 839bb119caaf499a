#include "daemon/verbs/audit_requests.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "daemon/verbs/history_requests.h"

namespace focalfleet {
namespace {

constexpr std::uint64_t kAuditRowsMax = 1000;
constexpr std::size_t kHeadsMax = 10'000;  // a year of hours

Result<std::vector<AuditHead>> HeadsArgument(const Json& args) {
  std::vector<AuditHead> heads;
  const auto list = args.find("heads");
  if (list == args.end()) return heads;
  if (!list->is_array() || list->size() > kHeadsMax)
    return Fail(ErrorCode::kInvalid,
                "argument 'heads' must be a list of texts, at most " + std::to_string(kHeadsMax));
  for (const Json& text : *list) {
    const auto head = text.is_string() ? HeadOf(text.get<std::string>()) : std::nullopt;
    if (!head)
      return Fail(ErrorCode::kInvalid,
                  "a head of the audit is ENTRY:SHA256, as the log shows it each hour");
    heads.push_back(*head);
  }
  return heads;
}

}  // namespace

Json AuditJson(const AuditEntry& entry) {
  const AuditRow& row = entry.row;
  const auto number = [&](std::uint32_t AuditRow::Process::*which) {
    return row.process ? Json((*row.process).*which) : Json();
  };
  return {{"entry", entry.entry},
          {"at", ToIso8601(entry.at)},
          {"at_ns", entry.at.ns},
          {"door", row.door},
          {"name", row.name},
          {"role", row.role},
          {"uid", number(&AuditRow::Process::uid)},
          {"gid", number(&AuditRow::Process::gid)},
          {"pid", number(&AuditRow::Process::pid)},
          {"program", row.process ? row.process->program : ""},
          {"address", row.address},
          {"boot_id", row.boot_id},
          {"verb", row.verb},
          {"request", row.request},
          {"request_bytes", row.request_bytes},
          {"request_sha256", row.request_sha256},
          {"taken", row.taken},
          {"code", row.code},
          {"reason", row.reason},
          {"configuration", row.configuration},
          {"sha256", entry.sha256}};
}

Json AuditJson(const AuditVerdict& verdict) {
  return {{"whole", !verdict.flaw},
          {"entries", verdict.entries},
          {"head", Text(verdict.head)},
          {"flaw", verdict.flaw.value_or("")}};
}

Result<StoreReading> AskAudit(const ControlRequest& request) {
  AuditFilter filter;
  FOCALFLEET_TRY_ASSIGN(filter.period, PeriodArgument(request.args));
  FOCALFLEET_TRY_ASSIGN(filter.name, TextArgumentOr(request.args, "name", ""));
  FOCALFLEET_TRY_ASSIGN(filter.verb, TextArgumentOr(request.args, "verb", ""));
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t limit,
                        UnsignedArgumentOr(request.args, "limit", kAuditRowsMax));
  filter.limit = static_cast<std::uint32_t>(std::min(limit, kAuditRowsMax));
  return StoreReading([filter](StoreReader* store) -> Result<Json> {
    FOCALFLEET_TRY_ASSIGN(const auto entries, store->Audit(filter));
    Json list = Json::array();
    for (auto entry = entries.rbegin(); entry != entries.rend(); ++entry)
      list.push_back(AuditJson(*entry));
    return Json{{"entries", std::move(list)}};
  });
}

Result<StoreReading> AskAuditCheck(const ControlRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const auto heads, HeadsArgument(request.args));
  return StoreReading([heads](StoreReader* store) -> Result<Json> {
    FOCALFLEET_TRY_ASSIGN(const AuditVerdict verdict, store->CheckAudit(heads));
    return AuditJson(verdict);
  });
}

}  // namespace focalfleet
