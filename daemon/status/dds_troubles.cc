#include "daemon/status/dds_troubles.h"

#include <utility>

namespace focalfleet {

void DdsTroubles::Report(const std::string& what, const std::string& trouble) {
  {
    const std::lock_guard lock(mutex_);
    if (trouble.empty()) {
      lasting_.erase(what);
      notes_.push_back({Severity::kInfo, "DDS is there again for " + what});
    } else {
      ++reported_;
      lasting_[what] = trouble;
      notes_.push_back(
          {Severity::kError,
           "no DDS for " + what + ", the rest goes on and it is tried again: " + trouble});
    }
  }
  wake_();
}

void DdsTroubles::Note(ShellNote note) {
  {
    const std::lock_guard lock(mutex_);
    notes_.push_back(std::move(note));
  }
  wake_();
}

std::vector<ShellNote> DdsTroubles::TakeNotes() {
  const std::lock_guard lock(mutex_);
  return std::exchange(notes_, {});
}

std::string DdsTroubles::Summary() const {
  const std::lock_guard lock(mutex_);
  std::string text;
  for (const auto& [what, trouble] : lasting_)
    text += (text.empty() ? "" : "; ") + what + ": " + trouble;
  return text;
}

std::uint64_t DdsTroubles::reported() const {
  const std::lock_guard lock(mutex_);
  return reported_;
}

}  // namespace focalfleet
