// The program focalfleetd: buses of one machine, their store and their status.

#include <unistd.h>

#include <cstdio>

#include "daemon/control/printable.h"
#include "daemon/process/command_line.h"
#include "daemon/process/config.h"
#include "daemon/process/daemon.h"
#include "daemon/usage/complaint.h"

namespace {

constexpr int kCannotRun = 1;
constexpr int kUsage = 2;

int Report(const focalfleet::Error& error, int code = kCannotRun) {
  std::fprintf(stderr, "focalfleetd: %s\n", focalfleet::PrintableLines(error.text).c_str());
  return code;
}

int Check(const focalfleet::DaemonConfig& config) {
  const auto text = focalfleet::CheckDaemon(config);
  if (!text) return Report(text.error());
  std::fputs(focalfleet::PrintableLines(*text).c_str(), stdout);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const auto line = focalfleet::MakeDaemonCommandLine();
  try {
    line->app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {  // CLI11 throws to end, also after --help
    if (error.get_exit_code() == 0) return line->app.exit(error);
    return Report({focalfleet::ErrorCode::kInvalid, focalfleet::usage::Complaint(line->app, error) +
                                                        " (`focalfleetd --help` shows the usage)"},
                  kUsage);
  }
  const auto config = focalfleet::LoadConfig(line->config);
  if (!config) return Report(config.error());
  if (line->check) return Check(*config);
  const auto ended = focalfleet::RunDaemon(*config);
  const int code = ended.status ? 0 : Report(ended.status.error());
  if (ended.left) ::_exit(code);  // no destructor may destroy what a hanging part uses
  return code;
}
