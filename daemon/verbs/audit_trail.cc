#include "daemon/verbs/audit_trail.h"

#include <algorithm>

#include "daemon/access/rights.h"
#include "daemon/access/sha256.h"
#include "daemon/control/messages.h"

namespace focalfleet {
namespace {

constexpr std::int64_t kQuotaNs = 60'000'000'000;
/// Callers with a quota of their own. Users and tokens of a site are fewer.
constexpr std::size_t kQuotas = 256;

bool MovesUnits(const std::string& verb) {
  return verb == "apply" || verb == "home" || verb == "measure" || verb == "retarget" ||
         verb == "stop";
}

/// The front of a text, cut between characters of UTF-8.
std::string FrontOf(std::string_view text, std::size_t bytes_max) {
  if (text.size() <= bytes_max) return std::string(text);
  std::size_t end = bytes_max;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0u) == 0x80u) --end;
  return std::string(text.substr(0, end));
}

}  // namespace

void AuditTrail::Add(std::uint64_t request, const Caller& caller, std::string_view verb,
                     std::string_view line, AuditRow row) {
  row.door = Name(caller.door);
  row.name = NameOf(caller);
  row.role = Name(caller.role);
  if (caller.peer)
    row.process = AuditRow::Process{.pid = caller.peer->pid,
                                    .uid = caller.peer->uid,
                                    .gid = caller.peer->gid,
                                    .program = caller.peer->program};
  row.address = caller.address;
  row.boot_id = boot_id_;
  row.verb = verb;
  row.request = FrontOf(line, AuditRow::kRequestBytesMax);
  row.request_sha256 = Sha256Hex(line);
  row.request_bytes = line.size();
  entries_.push_back({request, std::move(row)});
}

void AuditTrail::Commanded(std::uint64_t request, const Caller& caller, std::string_view verb,
                           std::string_view line) {
  Add(request, caller, verb, line, {.taken = true});
}

void AuditTrail::Refused(WallTime now, const Caller& caller, std::string_view verb,
                         std::string_view line, const Error& why) {
  Quota& quota = QuotaOf(NameOf(caller), now);
  if (full_ || quota.kept >= kRepeatsKept) {
    ++quota.left_out;
    return;
  }
  Add(0, caller, verb, line,
      {.code = CodeName(why.code), .reason = FrontOf(why.text, AuditRow::kReasonBytesMax)});
}

AuditTrail::Quota& AuditTrail::QuotaOf(const std::string& name, WallTime now) {
  const bool known = quotas_.size() < kQuotas || quotas_.contains(name);
  Quota& quota = quotas_[known ? name : std::string()];
  if (now.ns < quota.began_ns || now.ns - quota.began_ns >= kQuotaNs)
    quota = {.began_ns = now.ns, .left_out = quota.left_out};
  return quota;
}

bool AuditTrail::Admit(const Turn& turn, Entry* entry) {
  AuditRow& row = entry->row;
  if (row.taken && row.verb != "stop") return true;
  Quota& quota = QuotaOf(row.name, turn.now);
  if (turn.full || quota.kept >= kRepeatsKept) {
    ++quota.left_out;
    return false;
  }
  ++quota.kept;
  if (quota.left_out > 0)
    row.reason += (row.reason.empty() ? "" : "; ") + std::to_string(quota.left_out) +
                  " entries before it were left out";
  quota.left_out = 0;
  return true;
}

void AuditTrail::Take(std::span<const ReplyEffect> replies, const Turn& turn,
                      std::vector<Row>* rows) {
  full_ = turn.full;
  std::vector<Row> taken;
  for (Entry& entry : entries_) {
    const auto reply = std::ranges::find_if(replies, [&](const ReplyEffect& one) {
      return entry.request != 0 && one.request == entry.request && one.error;
    });
    if (reply != replies.end()) {
      entry.row.taken = false;
      entry.row.code = CodeName(reply->error->code);
      entry.row.reason = FrontOf(reply->error->text, AuditRow::kReasonBytesMax);
    }
    if (MovesUnits(entry.row.verb) && entry.row.taken) entry.row.configuration = turn.configuration;
    if (Admit(turn, &entry)) taken.push_back(std::move(entry.row));
  }
  entries_.clear();
  rows->insert(rows->begin(), std::make_move_iterator(taken.begin()),
               std::make_move_iterator(taken.end()));
}

}  // namespace focalfleet
