// Replays a journal: another coordinator begins as the recorded one did, takes in the same, and
// must decide the same, to the bit. Plans are made anew, so a replay takes as long as the planner
// took.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "daemon/journal/journal_file.h"
#include "protocol/base/result.h"

namespace focalfleet::journal {

struct ReplayReport {
  std::string version;  // of the program that wrote the journal
  WallTime begun;
  std::size_t units = 0;
  std::uint64_t steps = 0;  // that were decided alike
  double host_s = 0;        // from the first step to the last
  std::uint64_t bytes = 0;  // of the journal
  JournalReader::End end = JournalReader::End::kWhole;
};

/// `progress` gets the number of steps now and then. Errors: as JournalReader; kRefused: a step
/// decides otherwise; the text has its number, its instant and what differs, and both versions
/// where `own_version` is another than the journal's.
Result<ReplayReport> ReplayJournal(const std::string& path, const std::string& own_version,
                                   const std::function<void(std::uint64_t)>& progress);

}  // namespace focalfleet::journal
