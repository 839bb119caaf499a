#include "daemon/journal/replay.h"

#include <algorithm>
#include <utility>

#include "daemon/journal/step_record.h"

namespace focalfleet::journal {
namespace {

Result<ReplayReport> Replay(const std::string& path, JournalReader* reader,
                            const std::function<void(std::uint64_t)>& progress) {
  constexpr std::uint64_t kProgressEvery = 10'000;
  const LifeRecord& life = reader->life();
  auto layout =
      Layout::Create(life.units, {.clearance_mm = life.clearance_mm, .obstacles = life.obstacles});
  if (!layout)
    return Fail(layout.error().code, path + ": the recorded layout: " + layout.error().text);
  ReplayReport report{.version = life.version, .begun = life.at, .units = layout->size()};
  Replayer replayer({&*layout, life.drives, life.config, life.stored});
  HostInstant first = kNever;
  for (;;) {
    FOCALFLEET_TRY_ASSIGN(const auto record, reader->Next());
    if (!record) break;
    FOCALFLEET_TRY(replayer.Step(*record));
    first = std::min(first, replayer.now());
    report.host_s = 1e-9 * static_cast<double>((replayer.now() - first).ns);
    if (replayer.steps() % kProgressEvery == 0) progress(replayer.steps());
  }
  report.steps = replayer.steps();
  report.bytes = reader->bytes();
  report.end = reader->end();
  return report;
}

}  // namespace

Result<ReplayReport> ReplayJournal(const std::string& path, const std::string& own_version,
                                   const std::function<void(std::uint64_t)>& progress) {
  FOCALFLEET_TRY_ASSIGN(JournalReader reader, JournalReader::Open(path));
  auto report = Replay(path, &reader, progress);
  if (!report && reader.version() != own_version)
    return Fail(report.error().code, report.error().text + "; version " + reader.version() +
                                         " wrote the journal, and this program is " + own_version);
  return report;
}

}  // namespace focalfleet::journal
