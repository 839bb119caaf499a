// The program focalfleetd: buses of one machine, their store and their status.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "daemon/control/printable.h"
#include "daemon/process/config.h"
#include "daemon/process/daemon.h"

namespace {

constexpr int kCannotRun = 1;
constexpr int kUsage = 2;

int Report(const focalfleet::Error& error) {
  std::fprintf(stderr, "focalfleetd: %s\n", focalfleet::PrintableLines(error.text).c_str());
  return kCannotRun;
}

int Check(const focalfleet::DaemonConfig& config) {
  const auto text = focalfleet::CheckDaemon(config);
  if (!text) return Report(text.error());
  std::fputs(focalfleet::PrintableLines(*text).c_str(), stdout);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The daemon of a focal plane: it owns the CAN buses, the store and the DDS status.");
  app.footer(
      "Signals: SIGTERM and SIGINT end it; SIGHUP opens log.file anew, for logrotate.\n"
      "Environment: NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID of systemd: it reports when it "
      "is "
      "ready, how it stands and that all its threads work. JOURNAL_STREAM: events go to the "
      "journal "
      "with fields.\n"
      "Exit codes: 0 ended by SIGTERM or SIGINT with everything stored (or --check found no "
      "fault); "
      "1 could not start, or could not store everything, said on standard error; 2 wrong usage.");
  std::string file;
  bool check = false;
  app.add_option("--config", file, "The configuration, a TOML file")->required();
  app.add_flag("--check", check, "Read all files, print the effective configuration, and end");
  app.set_version_flag("--version", std::string("focalfleetd ") + focalfleet::Version());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {  // CLI11 throws to end, also after --help
    return app.exit(error) == 0 ? 0 : kUsage;
  }
  const auto config = focalfleet::LoadConfig(file);
  if (!config) return Report(config.error());
  if (check) return Check(*config);
  const auto ended = focalfleet::RunDaemon(*config);
  const int code = ended.status ? 0 : Report(ended.status.error());
  if (ended.left) ::_exit(code);  // no destructor may destroy what a hanging part uses
  return code;
}
