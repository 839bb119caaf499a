// The daemon's journal (daemon/journal): where it is kept, and its replay by `focalfleetd
// --replay`.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/journal/journal_thread.h"
#include "daemon/process/config.h"
#include "fleet/coordinator.h"
#include "fleet/layout.h"

namespace focalfleet {

/// The journal of a coordinator that is about to begin from these; none where the configuration has
/// none. `note` receives when the journal cannot be written, and when it can again, on another
/// thread. Errors: kUnavailable: no descriptors left.
Result<std::unique_ptr<journal::JournalThread>> OpenJournal(const DaemonConfig& config,
                                                            const Layout& layout,
                                                            const std::vector<UnitDrive>& drives,
                                                            const StoredFleet& stored,
                                                            std::function<void(ShellNote)> note);

/// Gives each step to the journal, which outlives the function; null: to none.
std::function<void(const Inputs&, const Effects&)> Journalling(journal::JournalThread* journal);

/// Replays a life and prints what it found. Returns the exit code: 0: every step decided as
/// recorded; 1: one did not, or the journal cannot be read.
int ReplayAndPrint(const std::string& path);

}  // namespace focalfleet
