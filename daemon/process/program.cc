#include "daemon/process/program.h"

#include <unistd.h>

#include <cstdio>

#include "daemon/control/printable.h"
#include "daemon/process/command_line.h"
#include "daemon/process/config.h"
#include "daemon/process/daemon.h"
#include "daemon/process/journal_setup.h"
#include "daemon/usage/complaint.h"

namespace focalfleet {
namespace {

constexpr int kCannotRun = 1;
constexpr int kUsage = 2;

int ReportAtEnd(const Error& error, int code = kCannotRun) {
  std::fprintf(stderr, "focalfleetd: %s\n", PrintableLines(error.text).c_str());
  return code;
}

int Check(const DaemonConfig& config) {
  const auto text = CheckDaemon(config);
  if (!text) return ReportAtEnd(text.error());
  std::fputs(PrintableLines(*text).c_str(), stdout);
  return 0;
}

}  // namespace

int RunFocalfleetd(int argc, char** argv) {
  const auto line = MakeDaemonCommandLine();
  try {
    line->app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {  // CLI11 throws to end, also after --help
    if (error.get_exit_code() == 0) return line->app.exit(error);
    return ReportAtEnd({ErrorCode::kInvalid, usage::Complaint(line->app, error) +
                                                 " (`focalfleetd --help` shows the usage)"},
                       kUsage);
  }
  if (!line->replay.empty()) return ReplayAndPrint(line->replay);
  if (line->config.empty())
    return ReportAtEnd(
        {ErrorCode::kInvalid, "--config is required (`focalfleetd --help` shows the usage)"},
        kUsage);
  const auto config = LoadConfig(line->config);
  if (!config) return ReportAtEnd(config.error());
  if (line->check) return Check(*config);
  const auto ended = RunDaemon(*config);
  const int code = ended.status ? 0 : ReportAtEnd(ended.status.error());
  if (ended.left) ::_exit(code);  // no destructor may destroy what a hanging part uses
  return code;
}

}  // namespace focalfleet
