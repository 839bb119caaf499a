#include "daemon/cli/command_line.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <sstream>

#include "daemon/cli/operator_commands.h"
#include "daemon/cli/versions.h"
#include "daemon/usage/complaint.h"
#include "daemon/usage/help.h"
#include "daemon/usage/option_text.h"

namespace focalfleet::cli {
namespace {

constexpr const char* kEveryCommand =
    "Every command takes --json, --quiet, --socket, --timeout and --color; `focalfleet --help` "
    "has them, and lists the exit codes.";

const usage::HelpClosing kClosing{
    .of_commands = kEveryCommand, .manual = "focalfleet", .page_a_command = true};

struct Group {
  const char* name;
  std::vector<std::string> commands;
};

/// The groups of the commands in help, in their order. A command of no group is under kTools.
const std::vector<Group>& Groups() {
  static const std::vector<Group> groups = {
      {"Prepare a configuration", {"import", "layout", "targets", "plan", "estimate", "export"}},
      {"Operate the fleet", {"apply", "wait", "retarget", "stop", "home", "measure"}},
      {"Watch the fleet",
       {"status", "doctor", "unit", "state", "alarms", "events", "history", "watch",
        "measurements"}},
      {"Maintain units", {"disable", "enable", "adopt", "params"}},
      {"Access", {"access", "audit", "token", "page"}},
      {"Study and tune",
       {"campaign", "diagnose", "model", "simulate", "tune", "reproduce", "hall"}},
  };
  return groups;
}
constexpr const char* kTools = "Tools";  // can, completion, help, incident, store

/// Puts each command into its group. Help lists groups in the order of their first command.
void AssignGroups(CLI::App* app) {
  for (CLI::App* command : app->get_subcommands({})) {
    const auto group = std::ranges::find_if(Groups(), [&](const Group& each) {
      return std::ranges::find(each.commands, command->get_name()) != each.commands.end();
    });
    command->group(group != Groups().end() ? group->name : kTools);
  }
}

std::string ExitCodesHelp() {
  std::string text = "Exit codes:";
  for (const ExitCodeText& each : kExitCodeTexts)
    text += fmt::format("\n  {}  {}", static_cast<int>(each.code), each.text);
  return text;
}

void AddGlobalOptions(CommandLine* line) {
  CLI::App& app = line->app;
  app.set_version_flag("--version", std::string("focalfleet ") + ClientVersion(),
                       "Show the version");
  app.add_flag("--json", line->context.json, "One JSON object on stdout, nothing else there");
  app.add_flag("-q,--quiet", line->context.quiet,
               "No progress, no summary; errors are still reported");
  app.add_option("--socket", line->context.socket,
                 fmt::format("Control socket of the daemon (default: $FOCALFLEET_SOCKET, else {})",
                             kDefaultSocket))
      ->type_name("FILE");
  app.add_option("--timeout", line->context.timeout_s,
                 "How long the daemon may be silent, s (otherwise 10; 120 while units move)")
      ->check(NumberBetween(0.01, 86'400));
  OneOf(app.add_option("--color", line->context.colour, "Colours in what is shown"),
        {"auto", "always", "never"})
      ->capture_default_str();
}

// Commands that never ask a daemon. They end with kRefused where their answer cannot be written.
constexpr std::array<std::string_view, 15> kOffline = {
    "can",    "completion", "diagnose",  "estimate", "export", "hall",    "help", "import",
    "layout", "plan",       "reproduce", "simulate", "store",  "targets", "tune"};

// Fills standard streams that the caller closed. Otherwise an opened file would get the number of a
// closed stream, and messages would end in it. The file /dev/null, opened in the wrong direction,
// takes and gives nothing.
void HoldStandardStreams() {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(fd, F_GETFD) >= 0) continue;
    [[maybe_unused]] const int held =
        open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY);  // the lowest number is free
  }
}

/// True if the result file goes to stdout.
bool OutIsStdout(const CLI::App& app) {
  const CLI::Option* out = usage::Chosen(app).get_option_no_throw("--out");
  return out != nullptr && out->count() == 1 && out->results().front() == "-";
}

/// The daemon's version beside this program's, where a daemon answers.
void ShowDaemonVersion(CommandLine* line) {
  // --version ends the parser before it stores the values of other options.
  const auto& socket = line->app.get_option("--socket")->results();
  if (!socket.empty()) line->context.socket = socket.back();
  line->context.LookAtTerminals();
  const auto version = DaemonVersion(line->context);
  if (!version) return;
  PrintText(fmt::format("focalfleetd {}\n", *version));
  if (const std::string difference = DifferenceFrom(*version); !difference.empty())
    Complain(fmt::format("focalfleet: {} {}\n",
                         Paint(line->context.colour_err, Colour::kYellow, "warning:"), difference));
}

/// `exit`, unless the answer could not be written.
int AfterOutput(const CommandLine& line, ExitCode exit) {
  const bool good = exit == ExitCode::kOk || exit == ExitCode::kSomeUnserved;
  if (OutputError() == 0 || !good) return static_cast<int>(exit);
  Complain(fmt::format("focalfleet: {} standard output cannot be written: {}\n",
                       Paint(line.context.colour_err, Colour::kRed, "error:"),
                       std::strerror(OutputError())));
  const auto commands = line.app.get_subcommands();
  const bool offline =
      commands.empty() ||
      std::find(kOffline.begin(), kOffline.end(), commands.front()->get_name()) != kOffline.end();
  return static_cast<int>(offline ? ExitCode::kRefused : ExitCode::kBroken);
}

/// Reports a line that was not understood: the reason, and where no command was named the commands
/// there are.
int ReportUsage(const CommandLine& line, const CLI::ParseError& error) {
  const CLI::App& chosen = usage::Chosen(line.app);
  const bool names_no_command =
      chosen.get_require_subcommand_min() > 0 && line.app.remaining(true).empty();
  if (names_no_command) Complain(usage::ShortHelp(chosen) + "\n");
  const std::string more =
      names_no_command ? "" : fmt::format(" (`{} --help` shows the usage)", usage::PathOf(chosen));
  return static_cast<int>(Report(
      line.context,
      Failure{ExitCode::kUsage, {ErrorCode::kInvalid, usage::Complaint(line.app, error) + more}}));
}

}  // namespace

CLI::App* AddCommand(CLI::App* parent, const char* name, const char* what, const char* examples) {
  CLI::App* command = parent->add_subcommand(name, what);
  command->footer(examples);
  return command;
}

CLI::Option* AddFile(CLI::App* command, const char* name, std::string* path, const char* what) {
  return command->add_option(name, *path, what)->type_name("FILE");
}

CLI::Option* OneOf(CLI::Option* option, const std::vector<std::string>& words) {
  option->check(CLI::IsMember(words).description(""));
  option->type_name(fmt::format("{{{}}}", fmt::join(words, ",")));
  return option;
}

CLI::Validator NumberBetween(double low, double high) {
  return {[low, high](const std::string& text) {
            double value = 0;
            const bool good =
                CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
            return good ? std::string()
                        : fmt::format("{} is not a number of {:g} to {:g}", text, low, high);
          },
          fmt::format("from {:.12g} to {:.12g}", low, high)};
}

std::unique_ptr<CommandLine> MakeCommandLine(AddStudy add_study) {
  auto line = std::make_unique<CommandLine>();
  line->add_study = add_study;
  CLI::App& app = line->app;
  app.name("focalfleet");
  app.description(
      "Operates a fleet of fibre positioners: prepares configurations from files, and talks to "
      "focalfleetd.");
  app.formatter(std::make_shared<usage::HelpFormatter>(kClosing));
  app.set_help_flag("-h,--help", "Show this help");
  app.fallthrough();  // a global option may stand after the command, too
  app.require_subcommand(1);
  AddGlobalOptions(line.get());
  AddImportCommands(line.get());
  AddLayoutCommand(line.get());
  AddTargetsCommand(line.get());
  AddPlanCommand(line.get());
  AddEstimateCommand(line.get());
  AddApplyCommand(line.get());
  AddRetargetCommand(line.get());
  AddStatusCommands(line.get());
  AddAlarmCommands(line.get());
  AddEventsCommand(line.get());
  AddWaitCommand(line.get());
  AddWatchCommand(line.get());
  AddStopCommand(line.get());
  AddUnitCommands(line.get());
  add_study(line.get());
  AddMeasurementsCommand(line.get());
  AddCampaignCommands(line.get());
  AddModelCommands(line.get());
  AddStoreCommands(line.get());
  AddAccessCommands(line.get());
  AddPageCommand(line.get());
  AddCanCommands(line.get());
  AddDoctorCommand(line.get());
  AddIncidentCommand(line.get());
  AddCompletionCommand(line.get());
  AddHelpCommand(line.get());
  AssignGroups(&app);
  app.footer(ExitCodesHelp());  // last: commands would inherit it
  return line;
}

std::vector<usage::ManualPage> Manual(AddStudy add_study) {
  usage::ManualFrame frame{
      .closing = kClosing,
      .section = 1,
      .version = FOCALFLEET_VERSION,
      .description =
          {"focalfleet operates a fleet of fibre positioners. Some commands prepare configurations "
           "from files and need no daemon. The others talk to focalfleetd(8) over its control "
           "socket.",
           "stdout carries the answer, stderr everything else. With --json the answer is one JSON "
           "object. Result files appear complete or not at all."},
      .environment = {{"FOCALFLEET_SOCKET", "Control socket of the daemon, without --socket."},
                      {"NO_COLOR", "Where it is not empty, no colours are used."},
                      {"CYCLONEDDS_URI", "Configuration of DDS for focalfleet watch."}},
      .files = {{kDefaultSocket, "Control socket of the daemon."}},
      .see_also = "focalfleetd(8), focalfleet-sim(1), focalfleet.toml(5), focalfleet-protocol(7)"};
  for (const ExitCodeText& each : kExitCodeTexts)
    frame.exit_codes.emplace_back(std::to_string(static_cast<int>(each.code)),
                                  std::string(each.text) + ".");
  return usage::ManualOf(MakeCommandLine(add_study)->app, frame);
}

int Main(int argc, char** argv, AddStudy add_study) {
  HoldStandardStreams();
  const std::unique_ptr<CommandLine> line = MakeCommandLine(add_study);
  try {
    line->app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 reports by exceptions; help and version are exceptions, too, with exit code 0.
    if (error.get_exit_code() == 0) {
      std::ostringstream text;
      line->app.exit(error, text, text);
      PrintText(text.str());
      if (error.get_name() == "CallForVersion") ShowDaemonVersion(line.get());
      return AfterOutput(*line, ExitCode::kOk);
    }
    line->context.LookAtTerminals();
    return ReportUsage(*line, error);
  }
  line->context.LookAtTerminals();
  line->context.stdout_is_file = OutIsStdout(line->app);
  if (line->context.stdout_is_file && line->context.json) {
    return static_cast<int>(
        Report(line->context, {ErrorCode::kInvalid, "--json and --out - both want standard output"},
               ExitCode::kUsage));
  }
  return AfterOutput(*line, line->run(line->context));
}

}  // namespace focalfleet::cli
