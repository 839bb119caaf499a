// The command doctor looks at this machine and its daemon, and says what to type where something is
// not as the fleet needs it.

#include <fmt/format.h>

#include "daemon/cli/command_line.h"
#include "daemon/cli/versions.h"
#include "daemon/doctor/examine.h"
#include "daemon/doctor/facts.h"
#include "daemon/doctor/read_facts.h"

namespace focalfleet::cli {
namespace {

using doctor::Check;
using doctor::Verdict;

struct DoctorOptions {
  std::string config = kDefaultConfig;
};

Colour ColourOf(Verdict verdict) {
  constexpr Colour kColours[] = {Colour::kGreen, Colour::kYellow, Colour::kRed};
  return kColours[static_cast<std::size_t>(verdict)];
}

/// A line for each check. Interfaces that are well are only counted.
std::string Describe(const std::vector<Check>& checks, bool colour_on) {
  std::string text;
  std::size_t interfaces = 0;
  for (const Check& check : checks) {
    if (check.verdict == Verdict::kOk && check.name.starts_with("interface ")) {
      ++interfaces;
      continue;
    }
    text += fmt::format(
        "{}  {}: {}\n",
        Paint(colour_on, ColourOf(check.verdict), fmt::format("{:<4}", Name(check.verdict))),
        check.name, check.text);
    if (!check.todo.empty()) text += fmt::format("      do: {}\n", check.todo);
  }
  if (interfaces > 0)
    text += fmt::format("{}  interfaces: {} as they should be\n",
                        Paint(colour_on, Colour::kGreen, "ok  "), interfaces);
  return text;
}

std::string Summary(const std::vector<Check>& checks) {
  std::size_t count[3] = {};
  for (const Check& check : checks) ++count[static_cast<std::size_t>(check.verdict)];
  return fmt::format("{}: {} ok, {}, {}", Count(checks.size(), "check", "checks"), count[0],
                     Count(count[1], "warning", "warnings"),
                     Count(count[2], "failure", "failures"));
}

Json JsonOf(const std::vector<Check>& checks) {
  Json list = Json::array();
  for (const Check& check : checks)
    list.push_back({{"check", check.name},
                    {"result", Name(check.verdict)},
                    {"text", check.text},
                    {"do", check.todo}});
  return {{"result", Name(doctor::Worst(checks))}, {"checks", std::move(list)}};
}

ExitCode RunDoctor(const Context& context, const DoctorOptions& options) {
  const auto checks = doctor::Examine(doctor::ReadFacts({.program_version = ClientVersion(),
                                                         .config_path = options.config,
                                                         .socket = context.NamedSocketPath(),
                                                         .socket_otherwise = kDefaultSocket}));
  if (context.json) PrintJson(JsonOf(checks));
  Say(context, Describe(checks, context.colour_out) + Summary(checks));
  switch (doctor::Worst(checks)) {
    case Verdict::kOk:
      return ExitCode::kOk;
    case Verdict::kWarn:
      return ExitCode::kSomeUnserved;
    case Verdict::kFail:
      return ExitCode::kRefused;
  }
  return ExitCode::kRefused;
}

}  // namespace

void AddDoctorCommand(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "doctor",
      "Check machine and daemon, and say what to type where something is wrong. Exit code 0: all "
      "is well; 3: there are warnings; 1: something fails",
      "  focalfleet doctor\n  focalfleet doctor --config fleet.toml --json");
  auto options = std::make_shared<DoctorOptions>();
  AddFile(command, "--config", &options->config, "The daemon's configuration")
      ->capture_default_str();
  OnChosen(line, command, options, RunDoctor);
}

}  // namespace focalfleet::cli
