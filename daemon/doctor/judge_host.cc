#include <fmt/format.h>

#include "daemon/doctor/judge.h"
#include "protocol/base/limits.h"

namespace focalfleet::doctor {
namespace {

/// Descriptors beside buses and clients: store, DDS, signals, threads.
constexpr std::uint64_t kOtherFiles = 64;

Check JudgeClock(const Facts& facts) {
  if (facts.host.clock_synchronised)
    return Ok("clock",
              fmt::format("synchronised, within {:.0f} ms", 1e3 * facts.host.clock_error_s));
  return Warn("clock", "nothing synchronises it: times of exposures and of the history may be off",
              "apt install chrony, or systemctl enable --now systemd-timesyncd");
}

Check JudgeOpenFiles(const Facts& facts) {
  const auto& process = facts.daemon.process;
  const bool of_daemon = process && process->open_files_max;
  const std::uint64_t most = of_daemon ? *process->open_files_max : facts.host.open_files_max;
  const std::uint64_t buses = facts.buses.value_or(0);
  const std::uint64_t needed =
      2 * buses + limits::kControlClients + 2 * limits::kControlClientsReserved + kOtherFiles;
  const std::string text = fmt::format("{} may have {} open files, the fleet needs {}",
                                       of_daemon ? "the daemon" : "this shell", most, needed);
  if (most >= needed) return Ok("open files", text);
  return Fail("open files", text,
              fmt::format("LimitNOFILE={} in the unit, or ulimit -n {}", needed, needed));
}

}  // namespace

void JudgeHost(const Facts& facts, Checks* checks) {
  checks->push_back(JudgeClock(facts));
  checks->push_back(JudgeOpenFiles(facts));
}

}  // namespace focalfleet::doctor
