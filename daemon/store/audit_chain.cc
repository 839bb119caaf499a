#include "daemon/store/audit_chain.h"

#include <algorithm>
#include <charconv>

#include "daemon/access/sha256.h"

namespace focalfleet {
namespace {

constexpr std::size_t kSha256Digits = 64;

/// Each value with its name and length, so that no two rows have one text.
class CanonicalEntry {
 public:
  void Add(const char* name, const std::string& value) {
    text_ += std::string(name) + " " + std::to_string(value.size()) + " " + value + "\n";
  }
  void Add(const char* name, std::uint64_t value) { Add(name, std::to_string(value)); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

}  // namespace

AuditHead BeforeAudit() { return {0, std::string(kSha256Digits, '0')}; }

std::string ChainedSha256(const AuditEntry& entry) {
  const AuditRow& row = entry.row;
  CanonicalEntry canonical;
  canonical.Add("previous_sha256", entry.previous_sha256);
  canonical.Add("entry", entry.entry);
  canonical.Add("at_ns", std::to_string(entry.at.ns));
  canonical.Add("boot_id", row.boot_id);
  canonical.Add("door", row.door);
  canonical.Add("name", row.name);
  canonical.Add("role", row.role);
  if (row.process) {
    canonical.Add("uid", row.process->uid);
    canonical.Add("gid", row.process->gid);
    canonical.Add("pid", row.process->pid);
    canonical.Add("program", row.process->program);
  }
  canonical.Add("address", row.address);
  canonical.Add("verb", row.verb);
  canonical.Add("request", row.request);
  canonical.Add("request_bytes", row.request_bytes);
  canonical.Add("request_sha256", row.request_sha256);
  canonical.Add("taken", row.taken ? "1" : "0");
  canonical.Add("code", row.code);
  canonical.Add("reason", row.reason);
  canonical.Add("configuration", row.configuration);
  return Sha256Hex(canonical.text());
}

std::optional<AuditHead> HeadOf(const std::string& text) {
  AuditHead head;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), head.entry);
  const auto at = static_cast<std::size_t>(end - text.data());
  if (error != std::errc() || at >= text.size() || text[at] != ':') return std::nullopt;
  head.sha256 = text.substr(at + 1);
  const bool hex = std::ranges::all_of(
      head.sha256, [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
  if (!hex || head.sha256.size() != kSha256Digits) return std::nullopt;
  return head;
}

std::string Text(const AuditHead& head) { return std::to_string(head.entry) + ":" + head.sha256; }

}  // namespace focalfleet
