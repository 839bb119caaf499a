// Why DDS is not there, for everybody who should know: `status` asks, the event loop takes what is
// new to make alarms of it. Any thread may tell.
#pragma once

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

  /// Reports that `what` does not work, and why; an empty text: it works again.
  void Report(const std::string& what, const std::string& trouble);

  /// Takes the reports since the last call.
  std::vector<ShellNote> TakeNotes();
  /// All that lasts; empty: nothing.
  [[nodiscard]] std::string Summary() const;

 private:
  std::function<void()> wake_;
  mutable std::mutex mutex_;
  std::map<std::string, std::string> lasting_;  // by what
  std::vector<ShellNote> notes_;
};

}  // namespace focalfleet
