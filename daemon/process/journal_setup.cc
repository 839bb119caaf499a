#include "daemon/process/journal_setup.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

#include "daemon/clock/process_time.h"
#include "daemon/clock/wall_time.h"
#include "daemon/control/printable.h"
#include "daemon/journal/replay.h"
#include "daemon/usage/build_version.h"

namespace focalfleet {
namespace {

ShellNote NoteOf(const std::string& trouble) {
  if (trouble.empty())
    return {AlarmName::kJournalBack, "the journal is written again", AlarmName::kJournalMissing};
  return {AlarmName::kJournalMissing,
          "the journal is not whole, and the fleet works on: " + trouble};
}

const char* Meaning(journal::JournalReader::End end) {
  switch (end) {
    case journal::JournalReader::End::kWhole:
      return "the daemon ended, and the journal is whole";
    case journal::JournalReader::End::kCutOff:
      return "the daemon was killed, or still runs: its last steps may be missing";
    case journal::JournalReader::End::kLastTorn:
      return "the daemon was killed as it wrote: its last steps are missing";
  }
  return "";
}

}  // namespace

Result<std::unique_ptr<journal::JournalThread>> OpenJournal(const DaemonConfig& config,
                                                            const Layout& layout,
                                                            const std::vector<UnitDrive>& drives,
                                                            const StoredFleet& stored,
                                                            std::function<void(ShellNote)> note) {
  if (config.journal.limit_MiB == 0) return std::unique_ptr<journal::JournalThread>();
  journal::LifeRecord life = journal::LifeOf(layout, drives, config.timing, stored);
  life.version = BuildVersion();
  life.at = WallTime::Now();
  return journal::JournalThread::Create(
      {.files = {.folder = config.store.path + ".journal",
                 .limit_bytes = std::uint64_t{config.journal.limit_MiB} << 20},
       .tell = [note = std::move(note)](const std::string& trouble) { note(NoteOf(trouble)); }},
      std::move(life));
}

std::function<void(const Inputs&, const Effects&)> Journalling(journal::JournalThread* journal) {
  return [journal](const Inputs& inputs, const Effects& effects) {
    if (journal != nullptr) journal->Take(inputs, effects);
  };
}

int ReplayAndPrint(const std::string& path) {
  const bool shown = ::isatty(STDERR_FILENO) != 0;
  const std::string own = BuildVersion();
  const auto report = journal::ReplayJournal(path, own, [shown](std::uint64_t steps) {
    if (shown) std::fprintf(stderr, "\r%llu steps", static_cast<unsigned long long>(steps));
  });
  if (shown) std::fputs("\r", stderr);
  if (!report) {
    std::fprintf(stderr, "focalfleetd: %s\n", PrintableLines(report.error().text).c_str());
    return 1;
  }
  std::fputs(fmt::format("life        {}, {} units, {:.1f} s, {:.1f} MB of journal\n"
                         "version     {}{}\n"
                         "steps       {}, all decided as recorded, in {:.1f} s of CPU\n"
                         "end         {}\n",
                         ToIso8601(report->begun), report->units, report->host_s,
                         1e-6 * static_cast<double>(report->bytes), report->version,
                         report->version == own ? "" : "; this program is " + own, report->steps,
                         ProcessCpuSeconds(), Meaning(report->end))
                 .c_str(),
             stdout);
  return 0;
}

}  // namespace focalfleet
