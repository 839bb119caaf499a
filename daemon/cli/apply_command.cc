// The command apply FILE sends a targets file to the daemon; wait waits for what is under way.

#include <fmt/format.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <optional>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/configuration_summary.h"
#include "daemon/cli/operator_commands.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table_input.h"
#include "fleet/files/targets_file.h"
#include "protocol/base/limits.h"

namespace focalfleet::cli {
namespace {

struct ApplyOptions {
  std::string file;
  bool wait = false;
  bool fixed = false;
  bool dry_run = false;
  std::optional<std::uint32_t> corrections;  // empty: no corrections by the camera
  double tolerance_um = 10;
};

// Ctrl-C ends the waiting, not the motion; the note tells the operator so.
void InstallInterruptNote() {
  struct sigaction action {};
  action.sa_handler = [](int) {
    static constexpr char kNote[] =
        "\nfocalfleet: no longer waiting; the configuration goes on (`focalfleet stop` ends it, "
        "`focalfleet status` shows it)\n";
    [[maybe_unused]] const auto written = write(STDERR_FILENO, kNote, sizeof kNote - 1);
    _exit(static_cast<int>(ExitCode::kBroken));
  };
  sigaction(SIGINT, &action, nullptr);
}

void ShowProgress(ProgressBar* bar, const Json& progress) {
  const std::string stage =
      fmt::format("round {}: {}", CountIn(progress, "round"), DescribeStage(progress));
  bar->Show(
      NumberIn(progress, "fraction"), stage,
      fmt::format("{} of {} arrived", CountIn(progress, "arrived"), CountIn(progress, "targeted")));
}

ExitCode ReportAccepted(const Context& context, const Json& result) {
  if (context.json) {
    PrintJson(result);
  } else {
    const std::uint64_t id =
        result.contains("configuration") ? CountIn(result, "configuration") : CountIn(result, "id");
    Say(context,
        fmt::format("configuration {} accepted; `focalfleet status` shows how it goes", id));
  }
  return ExitCode::kOk;
}

ExitCode ReportSummary(const Context& context, const Json& configuration) {
  if (context.json) {
    // The daemon's status supplies what the configuration does not state of itself; without an
    // answer these fields stay 0.
    const auto status = Ask(context, {.verb = "status"});
    PrintJson(ApplySummary(configuration, status ? *status : Json::object()));
  }
  Say(context, DescribeConfiguration(configuration, context.colour_out));
  const ExitCode exit = ExitCodeOf(configuration);
  if (exit == ExitCode::kSomeUnserved) NameUnserved(context, DescribeNotServed(configuration));
  return exit;
}

ExitCode ReportDryRun(const Context& context, const tl::expected<Json, Failure>& preview) {
  if (!preview) return Report(context, preview.error());
  if (context.json) PrintJson(*preview);
  const std::uint64_t targeted = CountIn(*preview, "targeted");
  const std::uint64_t served = CountIn(*preview, "served");
  Say(context,
      fmt::format("dry run, nothing moves: {} of {} units served, {} move\n"
                  "  makespan {}, energy {}, peak power {}",
                  served, targeted, CountIn(*preview, "moving"),
                  Shown(*preview, "makespan_s", "s", 1), Shown(*preview, "energy_J", "J", 1),
                  Shown(*preview, "peak_power_W", "W", 1)));
  if (served == targeted) return ExitCode::kOk;
  const std::string unserved = DescribeNotServed(*preview);
  Say(context, unserved);
  NameUnserved(context, unserved);
  return ExitCode::kSomeUnserved;
}

ExitCode RunApply(const Context& context, const ApplyOptions& options) {
  auto text = ReadTable(context, options.file, "unit_id");
  if (!text) return Report(context, text.error());
  constexpr std::size_t kRestOfLine = 4096;
  const std::size_t bytes = EncodeText(*text).size() + kRestOfLine;
  if (bytes > limits::kControlLineBytes) {
    return Report(context, {ErrorCode::kInvalid,
                            fmt::format("{}: a request of {} bytes; the daemon takes at most {}",
                                        options.file, bytes, limits::kControlLineBytes)});
  }
  // The daemon reports errors in the file. Only this program can report the columns that are
  // ignored.
  if (const auto targets = ReadTargets(*text, options.file)) {
    ReportPassedOver(context, options.file, targets->ignored_columns);
  }
  ProgressBar bar(context);
  if (options.dry_run) {
    const auto planned =
        Ask(context, {.verb = "preview",
                      .args = {{"source", SourceOf(options.file)},
                               {"targets_csv", std::move(*text)},
                               {"fixed", options.fixed}},
                      .long_lasting = true,
                      .on_progress = [&bar](const Json& p) {
                        bar.Show(0, "dry run: planning",
                                 fmt::format("{} units, {:.0f} s", CountIn(p, "targeted"),
                                             NumberIn(p, "elapsed_s")));
                      }});
    bar.End();
    return ReportDryRun(context, planned);
  }
  if (options.wait) InstallInterruptNote();
  Question question{.verb = "apply",
                    .args = {{"source", SourceOf(options.file)},
                             {"targets_csv", std::move(*text)},
                             {"fixed", options.fixed},
                             {"wait", options.wait}},
                    .long_lasting = options.wait,
                    .on_progress = [&bar](const Json& p) { ShowProgress(&bar, p); }};
  if (options.corrections) {
    question.args["corrections"] = *options.corrections;
    question.args["tolerance_um"] = options.tolerance_um;
  }
  const auto result = Ask(context, question);
  bar.End();
  if (!result) return Report(context, result.error());
  return options.wait ? ReportSummary(context, *result) : ReportAccepted(context, *result);
}

// ---- wait

struct WaitOptions {
  std::optional<double> timeout_s;
};

ExitCode RunWait(const Context& context, const WaitOptions& options) {
  InstallInterruptNote();
  Json args = Json::object();
  if (options.timeout_s) args["timeout_s"] = *options.timeout_s;
  ProgressBar bar(context);
  const auto result = Ask(
      context,
      {.verb = "wait", .args = args, .long_lasting = true, .on_progress = [&bar](const Json& p) {
         ShowProgress(&bar, p);
       }});
  bar.End();
  if (!result) {
    // A daemon that ends says so first: it is gone, too.
    Failure failure = result.error();
    if (failure.exit == ExitCode::kBroken) failure.exit = ExitCode::kNoDaemon;
    return Report(context, failure);
  }
  if (result->contains("under_way")) {
    if (context.json) PrintJson(*result);
    Say(context, "nothing is under way");
    return ExitCode::kOk;
  }
  return ReportSummary(context, *result);
}

}  // namespace

void AddApplyCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "apply", "Move the fleet to the targets of a file",
                 "  focalfleet apply targets.csv --dry-run\n"
                 "  focalfleet apply targets.csv --wait\n"
                 "  focalfleet apply targets.csv --wait --json > summary.json\n"
                 "  focalfleet apply targets.csv --wait --correct 2 --tolerance-um 10");
  auto options = std::make_shared<ApplyOptions>();
  AddFile(command, "FILE", &options->file,
          "targets.csv: unit_id and x_mm, y_mm or theta_deg, phi_deg")
      ->required();
  CLI::Option* wait = command->add_flag("--wait", options->wait,
                                        "Wait until the configuration is over, with its progress");
  command->add_flag("--fixed", options->fixed,
                    "Units that the file does not name may not step aside");
  CLI::Option* correct =
      command
          ->add_option(
              "--correct", options->corrections,
              "Measure with the camera when all have arrived, and correct at most so often")
          ->check(CLI::Range(0, 10));
  command->add_option("--tolerance-um", options->tolerance_um, "Who is farther off is corrected")
      ->check(NumberBetween(0.1, 1e6))
      ->capture_default_str()
      ->needs(correct);
  command
      ->add_flag("--dry-run", options->dry_run,
                 "Plan from where the units stand now, and report; nothing moves")
      ->excludes(wait)
      ->excludes(correct);
  OnChosen(line, command, options, RunApply);
}

void AddWaitCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "wait", "Wait until the configuration under way is over",
                 "  focalfleet wait\n  focalfleet wait --timeout 600");
  auto options = std::make_shared<WaitOptions>();
  command->add_option("--timeout", options->timeout_s, "Give up after so many seconds (1)")
      ->check(NumberBetween(0, 1e6));
  OnChosen(line, command, options, RunWait);
}

}  // namespace focalfleet::cli
