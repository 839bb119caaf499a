// The troubles of DDS, for the answer to `status` and for alarms: the event loop takes new reports
// and makes alarms of them. Any thread may report.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "fleet/coordinator.h"

namespace focalfleet {

class DdsTroubles {
 public:
  /// `wake` is called after each report, on the thread that reports.
  explicit DdsTroubles(std::function<void()> wake) : wake_(std::move(wake)) {}

  /// `what` does not work because of `trouble`; an empty text: it works again.
  void Report(const std::string& what, const std::string& trouble);

  /// A note about another part than DDS that works without the core.
  void Note(ShellNote note);

  /// The reports since the last call.
  std::vector<ShellNote> TakeNotes();
  /// All lasting troubles in one text; empty: none.
  [[nodiscard]] std::string Summary() const;
  /// The number of troubles of DDS that were reported, ended or not.
  [[nodiscard]] std::uint64_t reported() const;

 private:
  std::function<void()> wake_;
  mutable std::mutex mutex_;
  std::map<std::string, std::string> lasting_;  // by `what`
  std::vector<ShellNote> notes_;
  std::uint64_t reported_ = 0;
};

}  // namespace focalfleet
