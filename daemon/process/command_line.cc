#include "daemon/process/command_line.h"

#include <utility>

#include "daemon/process/daemon.h"
#include "daemon/usage/help.h"

namespace focalfleet {
namespace {

const usage::HelpClosing kClosing{.manual = "focalfleetd"};

const std::vector<std::pair<std::string, std::string>>& ExitCodes() {
  static const std::vector<std::pair<std::string, std::string>> codes = {
      {"0",
       "ended by SIGTERM or SIGINT with everything stored; --check found no fault, --replay no "
       "difference"},
      {"1",
       "could not start, or could not store everything, or a step of --replay differs; stderr has "
       "the reason"},
      {"2", "wrong usage"},
  };
  return codes;
}

}  // namespace

std::unique_ptr<DaemonCommandLine> MakeDaemonCommandLine() {
  auto line = std::make_unique<DaemonCommandLine>();
  CLI::App& app = line->app;
  app.name("focalfleetd");
  app.description(
      "The daemon of a focal plane: it owns the CAN buses, the store and the DDS status");
  app.formatter(std::make_shared<usage::HelpFormatter>(kClosing));
  app.set_help_flag("-h,--help", "Show this help");
  app.set_version_flag("--version", std::string("focalfleetd ") + Version(), "Show the version");
  CLI::Option* config =
      app.add_option("--config", line->config, "The configuration, focalfleet.toml (required)")
          ->type_name("FILE");
  app.add_flag("--check", line->check, "Read all files, print the effective configuration, and end")
      ->needs(config);
  app.add_option("--replay", line->replay,
                 "Replay a life of a daemon from a file of its journal, or the newest life in a "
                 "folder, and end: each step must be decided as it was recorded")
      ->type_name("FILE")
      ->excludes(config);
  std::string footer = "Exit codes:";
  for (const auto& [code, text] : ExitCodes()) footer += "\n  " + code + "  " + text;
  footer +=
      "\n\nSignals: SIGTERM and SIGINT end it; SIGHUP opens log.file anew, for logrotate.\n"
      "Environment: NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID of systemd: it reports when it "
      "is "
      "ready, how it stands and that all its threads work. JOURNAL_STREAM: events go to the "
      "journal "
      "with fields.";
  app.footer(footer);
  return line;
}

std::vector<usage::ManualPage> DaemonManual() {
  return usage::ManualOf(
      MakeDaemonCommandLine()->app,
      {.closing = kClosing,
       .section = 8,
       .version = FOCALFLEET_VERSION,
       .description =
           {"focalfleetd moves the units of a focal plane over their CAN buses and keeps a record "
            "of every axis in a store that survives power cuts. focalfleet(1) asks and commands it "
            "through a control socket; it publishes status through DDS.",
            "The daemon stays in the foreground. SIGTERM and SIGINT end it within 2 s with "
            "everything stored. Units that move go on by themselves. SIGHUP opens log.file anew, "
            "for "
            "logrotate."},
       .exit_codes = ExitCodes(),
       .environment = {{"NOTIFY_SOCKET, WATCHDOG_USEC, WATCHDOG_PID",
                        "Of systemd: the daemon reports when it is ready, how it stands and that "
                        "all its threads work."},
                       {"JOURNAL_STREAM", "Of systemd: events go to the journal with fields."}},
       .files = {{"focalfleet.toml", "The configuration, see focalfleet.toml(5)."},
                 {"store.path", "The store, an SQLite file. One daemon at a time opens it."},
                 {"store.path.journal", "All that the core took in, in files for --replay."},
                 {"control.socket", "The control socket, for owner and group."}},
       .see_also = "focalfleet(1), focalfleet-sim(1), focalfleet.toml(5), focalfleet-protocol(7)"});
}

}  // namespace focalfleet
