#include "daemon/cli/configuration_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <vector>

#include "daemon/cli/client.h"

namespace focalfleet::cli {
namespace {

constexpr std::size_t kUnservedShown = 20;  // one by one; the others by reason
constexpr std::size_t kReasonsShown = 10;
constexpr std::size_t kUnitsOfReasonShown = 5;

std::string ReasonOf(const Json& unit) {
  std::string text = TextIn(unit, "outcome");
  if (const std::string reason = TextIn(unit, "reason"); !reason.empty()) text += ": " + reason;
  if (const std::string state = TextIn(unit, "state"); !state.empty()) {
    text += fmt::format(" (now {})", state);
  }
  return text;
}

/// The units from `first` on: a line a reason, the most frequent one first.
std::string DescribeByReason(const Json& unserved, std::size_t first) {
  std::map<std::string, std::vector<std::uint64_t>> units_of;
  for (std::size_t i = first; i < unserved.size(); ++i) {
    units_of[ReasonOf(unserved[i])].push_back(CountIn(unserved[i], "unit_id"));
  }
  std::vector<std::pair<std::string, std::vector<std::uint64_t>>> reasons(units_of.begin(),
                                                                          units_of.end());
  std::stable_sort(reasons.begin(), reasons.end(),
                   [](const auto& a, const auto& b) { return a.second.size() > b.second.size(); });
  std::string text;
  for (std::size_t r = 0; r < reasons.size() && r < kReasonsShown; ++r) {
    std::vector<std::uint64_t>& ids = reasons[r].second;
    const std::size_t count = ids.size();
    ids.resize(std::min(count, kUnitsOfReasonShown));
    text += fmt::format("  {} {}: {}{}: {}\n", count, count == 1 ? "more unit" : "more units",
                        fmt::join(ids, ", "), count > ids.size() ? " ..." : "", reasons[r].first);
  }
  if (reasons.size() > kReasonsShown) {
    text += fmt::format("  and {} more reasons\n", reasons.size() - kReasonsShown);
  }
  return text + "  --json names them all\n";
}

/// What is known of it: nothing before the upload, nothing of the starts before units told.
std::string DescribeUploadAndStarts(const Json& c) {
  std::string text;
  if (NumberIn(c, "upload_s") > 0) {
    text += fmt::format("\n  upload {:.3f} s (its bits take {:.3f} s), {} bits ({} predicted)",
                        NumberIn(c, "upload_s"), NumberIn(c, "upload_predicted_s"),
                        CountIn(c, "upload_bits"), CountIn(c, "upload_bits_predicted"));
  }
  if (CountIn(c, "starts_known") > 0) {
    text += fmt::format(
        "\n  units began within {:.1f} ms of each other (+- {:.1f}; {} of {} told; plans allow for "
        "{:.0f} ms)",
        1e3 * NumberIn(c, "start_skew_s"), 1e3 * NumberIn(c, "start_skew_bound_s"),
        CountIn(c, "starts_known"), CountIn(c, "starts"),
        1e3 * NumberIn(c, "start_skew_allowed_s"));
  }
  return text;
}

/// A line an exposure: blind, then after each correction.
std::string DescribeMeasured(const Json& c) {
  std::string text;
  std::size_t correction = 0;
  for (const Json& round : ListIn(c, "measured")) {
    text += fmt::format(
        "\n  {}: rms {:.1f} um, median {:.1f} um, worst {:.1f} um; {} of {} within the tolerance",
        correction == 0 ? "measured as they came" : fmt::format("after correction {}", correction),
        NumberIn(round, "rms_um"), NumberIn(round, "median_um"), NumberIn(round, "worst_um"),
        CountIn(round, "within_tolerance"), CountIn(round, "measured"));
    if (const std::uint64_t unknown = CountIn(round, "unknown"); unknown > 0)
      text += fmt::format(", {} not to be told", unknown);
    if (const std::uint64_t sensed = CountIn(round, "by_sensors"); sensed > 0)
      text += fmt::format(", {} by their own sensors{}", sensed,
                          round.value("camera", true) ? "" : " without an exposure");
    ++correction;
  }
  return text;
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
  // Nothing has begun where it is 0, and nothing was predicted.
  const auto span = [&](const char* key) {
    return NumberIn(c, key) > 0 || over ? Shown(c, key, "s", 1) : "-";
  };
  text += fmt::format("  makespan {}{} (predicted {}), energy {}, peak power {}, {} frames",
                      span("makespan_s"), over || NumberIn(c, "makespan_s") <= 0 ? "" : " so far",
                      span("makespan_predicted_s"), Shown(c, "energy_J", "J", 1),
                      Shown(c, "peak_power_W", "W", 1), CountIn(c, "frames"));
  text += DescribeUploadAndStarts(c);
  text += DescribeMeasured(c);
  if (const std::string error = TextIn(c, "error"); !error.empty()) {
    text += fmt::format("\n  {}", Paint(colour_on, Colour::kRed, error));
  }
  const std::string unserved = DescribeNotServed(c);
  return unserved.empty() ? text : text + "\n" + unserved;
}

std::string DescribeStage(const Json& progress) {
  const std::string waiting_for = TextIn(progress, "waiting_for");
  return TextIn(progress, "state") + (waiting_for.empty() ? "" : ", waiting for " + waiting_for);
}

std::string DescribeNotServed(const Json& configuration) {
  const Json& unserved = ListIn(configuration, "unserved");
  if (unserved.empty()) return "";
  std::string text;
  for (std::size_t i = 0; i < unserved.size() && i < kUnservedShown; ++i) {
    text += fmt::format("  unit {}: {}\n", CountIn(unserved[i], "unit_id"), ReasonOf(unserved[i]));
  }
  if (unserved.size() > kUnservedShown) text += DescribeByReason(unserved, kUnservedShown);
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
  for (const char* key : {"upload_bits_predicted", "upload_bits", "starts", "starts_known"}) {
    summary[key] = CountIn(configuration, key);
  }
  for (const char* key : {"upload_predicted_s", "upload_s", "start_skew_s", "start_skew_bound_s",
                          "start_skew_allowed_s", "start_first", "start_last"}) {
    summary[key] = configuration.value(key, Json(nullptr));
  }
  summary["measured"] = ListIn(configuration, "measured");
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
