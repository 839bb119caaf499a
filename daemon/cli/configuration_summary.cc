#include "daemon/cli/configuration_summary.h"

#include <fmt/format.h>

#include "daemon/cli/client.h"

namespace focalfleet::cli {
namespace {

constexpr std::size_t kUnservedShown = 50;

std::string DescribeUnserved(const Json& unit) {
  std::string line =
      fmt::format("  unit {}: {}", CountIn(unit, "unit_id"), TextIn(unit, "outcome"));
  if (const std::string reason = TextIn(unit, "reason"); !reason.empty()) line += ": " + reason;
  if (const std::string state = TextIn(unit, "state"); !state.empty()) {
    line += fmt::format(" (now {})", state);
  }
  return line + "\n";
}

Colour ColourOf(ExitCode exit) {
  return exit == ExitCode::kOk             ? Colour::kGreen
         : exit == ExitCode::kSomeUnserved ? Colour::kYellow
                                           : Colour::kRed;
}

}  // namespace

ExitCode ExitCodeOf(const Json& configuration) {
  const std::string state = TextIn(configuration, "state");
  if (state == "stopped" || state == "failed") return ExitCode::kBroken;
  if (!TextIn(configuration, "error").empty()) return ExitCode::kBroken;
  const bool all = CountIn(configuration, "refused") == 0 &&
                   CountIn(configuration, "failed") == 0 &&
                   CountIn(configuration, "arrived") == CountIn(configuration, "targeted");
  return all ? ExitCode::kOk : ExitCode::kSomeUnserved;
}

std::string DescribeConfiguration(const Json& configuration, bool colour_on) {
  const Json& c = configuration;
  const std::string state = TextIn(c, "state");
  const bool over = state == "done" || state == "stopped" || state == "failed";
  const Colour colour = over ? ColourOf(ExitCodeOf(c)) : Colour::kPlain;
  std::string text =
      fmt::format("configuration {} ({}): {}, round {}\n", CountIn(c, "id"), TextIn(c, "source"),
                  Paint(colour_on, colour, state), CountIn(c, "round"));
  text += fmt::format("  {} of {} units arrived, {} refused, {} failed\n", CountIn(c, "arrived"),
                      CountIn(c, "targeted"), CountIn(c, "refused"), CountIn(c, "failed"));
  text += fmt::format("  makespan {} (predicted {}), energy {}, peak power {}, {} frames",
                      Shown(c, "makespan_s", "s", 1), Shown(c, "makespan_predicted_s", "s", 1),
                      Shown(c, "energy_J", "J", 1), Shown(c, "peak_power_W", "W", 1),
                      CountIn(c, "frames"));
  if (const std::string error = TextIn(c, "error"); !error.empty()) {
    text += fmt::format("\n  {}", Paint(colour_on, Colour::kRed, error));
  }
  const Json& unserved = ListIn(c, "unserved");
  if (unserved.empty()) return text;
  text += "\n";
  for (std::size_t i = 0; i < unserved.size() && i < kUnservedShown; ++i) {
    text += DescribeUnserved(unserved[i]);
  }
  if (unserved.size() > kUnservedShown) {
    text += fmt::format("  and {} more; --json names them all\n", unserved.size() - kUnservedShown);
  }
  text.pop_back();
  return text;
}

Json ApplySummary(const Json& configuration, const Json& status) {
  Json summary;
  summary["configuration"] = CountIn(configuration, "id");
  summary["state"] = TextIn(configuration, "state");
  summary["units"] = CountIn(status, "units");
  for (const char* key : {"targeted", "arrived", "refused", "failed", "frames"}) {
    summary[key] = CountIn(configuration, key);
  }
  for (const char* key : {"makespan_predicted_s", "makespan_s", "energy_J", "peak_power_W"}) {
    summary[key] = NumberIn(configuration, key);
  }
  summary["bus_load_max"] =
      NumberIn(configuration, "bus_load_max", NumberIn(status, "bus_load_max"));
  // Only where it failed on the way: the reason.
  if (const std::string error = TextIn(configuration, "error"); !error.empty()) {
    summary["error"] = {{"code", "unavailable"}, {"text", error}};
  }
  summary["unserved"] = Json::array();
  for (const Json& unit : ListIn(configuration, "unserved")) {
    summary["unserved"].push_back({{"unit_id", CountIn(unit, "unit_id")},
                                   {"outcome", TextIn(unit, "outcome")},
                                   {"reason", TextIn(unit, "reason")},
                                   {"state", TextIn(unit, "state")}});
  }
  return summary;
}

}  // namespace focalfleet::cli
