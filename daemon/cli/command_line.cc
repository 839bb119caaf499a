#include "daemon/cli/command_line.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <sstream>

#include "daemon/cli/versions.h"

namespace focalfleet::cli {
namespace {

constexpr const char* kEveryCommand =
    "Every command takes --json, --quiet and --socket PATH; `focalfleet --help` lists the exit "
    "codes.";

void AddGlobalOptions(CommandLine* line) {
  CLI::App& app = line->app;
  app.set_version_flag("--version", std::string("focalfleet ") + ClientVersion());
  app.add_flag("--json", line->context.json, "One JSON object on stdout, nothing else there");
  app.add_flag("-q,--quiet", line->context.quiet, "No progress, no summary; errors are still told");
  app.add_option("--socket", line->context.socket,
                 fmt::format("Control socket of the daemon (default: $FOCALFLEET_SOCKET, else {})",
                             kDefaultSocket))
      ->type_name("FILE");
}

// Commands that never ask a daemon. They end with kRefused where their answer cannot be written.
constexpr std::array<std::string_view, 11> kOffline = {
    "can",  "completion", "diagnose", "estimate", "hall", "layout",
    "plan", "reproduce",  "simulate", "targets",  "tune"};

/// The deepest command of the tree that the command line named.
const CLI::App& Chosen(const CLI::App& app) {
  const CLI::App* chosen = &app;
  while (!chosen->get_subcommands().empty()) chosen = chosen->get_subcommands().front();
  return *chosen;
}

std::string Complaint(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App& chosen = Chosen(app);
  if (chosen.get_require_subcommand_min() > 0) {
    for (const std::string& word : app.remaining(true)) {
      if (word.starts_with('-')) continue;
      return fmt::format("there is no command '{}{}'",
                         &chosen == &app ? "" : chosen.get_name() + " ", word);
    }
  }
  return error.what();
}

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
  const CLI::Option* out = Chosen(app).get_option_no_throw("--out");
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

}  // namespace

CLI::App* AddCommand(CLI::App* parent, const char* name, const char* what, const char* examples) {
  CLI::App* command = parent->add_subcommand(name, what);
  command->footer(fmt::format("Examples:\n{}\n{}", examples, kEveryCommand));
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
          ""};
}

std::unique_ptr<CommandLine> MakeCommandLine() {
  auto line = std::make_unique<CommandLine>();
  CLI::App& app = line->app;
  app.name("focalfleet");
  app.description(
      "Operates a fleet of fibre positioners: prepares configurations from files, and talks to "
      "focalfleetd.");
  app.footer(kExitCodesHelp);
  app.fallthrough();  // a global option may stand after the command, too
  app.require_subcommand(1);
  AddGlobalOptions(line.get());
  AddLayoutCommand(line.get());
  AddTargetsCommand(line.get());
  AddPlanCommand(line.get());
  AddEstimateCommand(line.get());
  AddApplyCommand(line.get());
  AddRetargetCommand(line.get());
  AddStatusCommands(line.get());
  AddWatchCommand(line.get());
  AddStopCommand(line.get());
  AddUnitCommands(line.get());
  AddSimulateCommand(line.get());
  AddDiagnoseCommand(line.get());
  AddTuneCommand(line.get());
  AddReproduceCommand(line.get());
  AddHallCommands(line.get());
  AddMeasurementsCommand(line.get());
  AddCampaignCommands(line.get());
  AddModelCommands(line.get());
  AddCanCommands(line.get());
  AddDoctorCommand(line.get());
  AddCompletionCommand(line.get());
  return line;
}

int Main(int argc, char** argv) {
  HoldStandardStreams();
  const std::unique_ptr<CommandLine> line = MakeCommandLine();
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
    return static_cast<int>(
        Report(line->context,
               Failure{ExitCode::kUsage,
                       {ErrorCode::kInvalid, fmt::format("{} (`focalfleet --help` shows the usage)",
                                                         Complaint(line->app, error))}}));
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
