// Why DDS is not there, for everybody who should know: `status` asks, the event loop takes what is
// new to make alarms of it. Any thread may tell.
#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/loop/event_signal.h"
#include "fleet/coordinator.h"

namespace focalfleet {

class DdsTroubles {
 public:
  /// `wake` is raised with each news; it outlives this.
  explicit DdsTroubles(const EventSignal* wake) : wake_(wake) {}

  /// Reports that `what` does not work, and why; an empty text: it works again.
  void Tell(const std::string& what, const std::string& trouble);

  /// Takes the reports since the last call.
  std::vector<ShellNote> TakeNotes();
  /// All that lasts; empty: nothing.
  [[nodiscard]] std::string Summary() const;

 private:
  const EventSignal* wake_;
  mutable std::mutex mutex_;
  std::map<std::string, std::string> lasting_;  // by what
  std::vector<ShellNote> notes_;
};

}  // namespace focalfleet
