#include "fleet/files/bad_rows.h"

#include <algorithm>
#include <utility>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr std::size_t kTextMax = 400;      // of one row; a file's name and a cell may be long
constexpr std::size_t kKindMax = 80;       // bytes of a kind
constexpr std::size_t kKindsCounted = 16;  // further kinds are counted as one
constexpr std::size_t kKindsReported = 5;  // the commonest; the rest is counted as one
constexpr const char* kOther = "other reasons";

// The text as a single line, not cut within a character of UTF-8.
std::string OneLine(std::string_view text, std::size_t size_max) {
  const bool cut = text.size() > size_max;
  if (cut) {
    while (size_max > 0 && (static_cast<unsigned char>(text[size_max]) & 0xC0u) == 0x80) --size_max;
    text = text.substr(0, size_max);
  }
  std::string line(text);
  for (char& c : line)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return cut ? line + "..." : line;
}

}  // namespace

void BadRows::Add(std::string_view text, std::string_view kind) {
  ++count_;
  if (reported_.size() < limits::kBadRowsReported) reported_.push_back(OneLine(text, kTextMax));
  std::string named = OneLine(kind, kKindMax);
  if (of_kind_.size() >= kKindsCounted && of_kind_.find(named) == of_kind_.end()) named = kOther;
  ++of_kind_[named];
}

Status BadRows::Check() const {
  if (empty()) return {};
  std::string text = reported_.front();
  for (std::size_t k = 1; k < reported_.size(); ++k) text += "\n  " + reported_[k];
  if (const std::size_t more = count_ - reported_.size(); more > 0)
    text += "\n  and " + std::to_string(more) + (more == 1 ? " more row" : " more rows") +
            "; all " + std::to_string(count_) + ": " + Totals();
  return Fail(ErrorCode::kInvalid, std::move(text));
}

// The kinds of fault with their counts, the commonest first.
std::string BadRows::Totals() const {
  std::vector<std::pair<std::string, std::size_t>> kinds(of_kind_.begin(), of_kind_.end());
  std::stable_sort(kinds.begin(), kinds.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  std::string totals;
  std::size_t others = 0;  // some kinds, or faults beyond the list of kinds
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    if (k >= kKindsReported || kinds[k].first == kOther) {
      others += kinds[k].second;
      continue;
    }
    totals += (totals.empty() ? "" : ", ") + kinds[k].first + " (" +
              std::to_string(kinds[k].second) + ")";
  }
  if (others > 0) totals += ", " + std::string(kOther) + " (" + std::to_string(others) + ")";
  return totals;
}

std::string FirstRow(std::string_view text) {
  const auto more = std::count(text.begin(), text.end(), '\n');
  std::string first(text.substr(0, text.find('\n')));
  if (more > 0) first += " (and " + std::to_string(more) + " more)";
  return first;
}

}  // namespace focalfleet
