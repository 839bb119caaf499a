#include "daemon/cli/configuration_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "daemon/cli/client.h"

namespace focalfleet::cli {
namespace {

// Reasons shared by at most this many units are listed unit by unit. More units give one line for
// each reason.
constexpr std::size_t kUnitsShownSingly = 3;
constexpr std::size_t kReasonsShown = 20;
constexpr std::size_t kUnitsOfReasonShown = 5;

std::string ReasonOf(const Json& unit) {
  std::string text = TextIn(unit, "outcome");
  if (const std::string reason = TextIn(unit, "reason"); !reason.empty()) text += ": " + reason;
  if (const std::string state = TextIn(unit, "state"); !state.empty()) {
    text += fmt::format(" (now {})", state);
  }
  return text;
}

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

/// A reason split at its numbers: "12.3 um from unit 7" is {"", " um from unit ", ""} and {"12.3",
/// "7"}.
struct TakenApart {
  std::vector<std::string> words;
  std::vector<std::string> numbers;
};
TakenApart TakeApart(const std::string& text) {
  TakenApart parts{{""}, {}};
  for (std::size_t at = 0; at < text.size();) {
    if (!IsDigit(text[at])) {
      parts.words.back() += text[at++];
      continue;
    }
    std::size_t end = at;
    while (end < text.size() && (IsDigit(text[end]) || (text[end] == '.' && end + 1 < text.size() &&
                                                        IsDigit(text[end + 1]))))
      ++end;
    parts.numbers.push_back(text.substr(at, end - at));
    parts.words.emplace_back();
    at = end;
  }
  return parts;
}

/// Units whose reasons differ by their numbers alone.
struct Alike {
  TakenApart first;
  std::vector<std::pair<std::string, std::string>> range;  // of each number: lowest, highest
  std::vector<std::size_t> members;                        // rows of the unserved

  void Add(std::size_t row, const TakenApart& parts) {
    if (members.empty()) {
      first = parts;
      for (const std::string& number : parts.numbers) range.emplace_back(number, number);
    }
    members.push_back(row);
    for (std::size_t k = 0; k < range.size(); ++k) {
      const double value = std::stod(parts.numbers[k]);
      if (value < std::stod(range[k].first)) range[k].first = parts.numbers[k];
      if (value > std::stod(range[k].second)) range[k].second = parts.numbers[k];
    }
  }
  /// The common words, with each number that differs as "low to high".
  [[nodiscard]] std::string Text() const {
    std::string text = first.words[0];
    for (std::size_t k = 0; k < range.size(); ++k) {
      text += range[k].first == range[k].second
                  ? range[k].first
                  : fmt::format("{} to {}", range[k].first, range[k].second);
      text += first.words[k + 1];
    }
    return text;
  }
};

/// The groups, the most frequent reason first, else in the order of the units.
std::vector<Alike> GroupByReason(const Json& unserved) {
  std::map<std::vector<std::string>, std::size_t> group_of;
  std::vector<Alike> groups;
  for (std::size_t row = 0; row < unserved.size(); ++row) {
    const TakenApart parts = TakeApart(ReasonOf(unserved[row]));
    const auto [it, is_new] = group_of.emplace(parts.words, groups.size());
    if (is_new) groups.emplace_back();
    groups[it->second].Add(row, parts);
  }
  std::ranges::stable_sort(groups, std::greater{},
                           [](const Alike& group) { return group.members.size(); });
  return groups;
}

std::string DescribeGroup(const Json& unserved, const Alike& group) {
  const auto id = [&](std::size_t row) { return CountIn(unserved[row], "unit_id"); };
  std::string text;
  if (group.members.size() <= kUnitsShownSingly) {
    for (const std::size_t row : group.members)
      text += fmt::format("  unit {}: {}\n", id(row), ReasonOf(unserved[row]));
    return text;
  }
  std::vector<std::uint64_t> ids;
  for (const std::size_t row : group.members)
    if (ids.size() < kUnitsOfReasonShown) ids.push_back(id(row));
  return fmt::format("  {} units ({}{}): {}\n", group.members.size(), fmt::join(ids, ", "),
                     group.members.size() > ids.size() ? ", ..." : "", group.Text());
}

/// The text on upload and starts, as far as known: nothing before the upload, nothing on starts
/// before units have reported.
std::string DescribeUploadAndStarts(const Json& c) {
  std::string text;
  if (NumberIn(c, "upload_s") > 0) {
    text += fmt::format("\n  upload {:.3f} s (its bits take {:.3f} s), {} bits ({} predicted)",
                        NumberIn(c, "upload_s"), NumberIn(c, "upload_predicted_s"),
                        CountIn(c, "upload_bits"), CountIn(c, "upload_bits_predicted"));
  }
  if (CountIn(c, "starts_known") > 0) {
    text += fmt::format(
        "\n  units began within at most {:.1f} ms of each other, at least {:.1f} ms (likely "
        "{:.1f}; "
        "{} of {} reported; plans allow for {:.0f} ms)",
        1e3 * NumberIn(c, "start_skew_most_s"), 1e3 * NumberIn(c, "start_skew_least_s"),
        1e3 * NumberIn(c, "start_skew_s"), CountIn(c, "starts_known"), CountIn(c, "starts"),
        1e3 * NumberIn(c, "start_skew_allowed_s"));
  }
  return text;
}

/// A line for each exposure: the first before any correction, then one after each correction.
std::string DescribeMeasured(const Json& c) {
  std::string text;
  std::size_t correction = 0;
  for (const Json& round : ListIn(c, "measured")) {
    text += fmt::format(
        "\n  {}: rms {:.1f} um, median {:.1f} um, worst {:.1f} um; {} of {} within the tolerance",
        TextIn(c, "kind") == "measure" ? "measured"
        : correction == 0              ? "measured as they came"
                                       : fmt::format("after correction {}", correction),
        NumberIn(round, "rms_um"), NumberIn(round, "median_um"), NumberIn(round, "worst_um"),
        CountIn(round, "within_tolerance"), CountIn(round, "measured"));
    if (const std::uint64_t unknown = CountIn(round, "unknown"); unknown > 0)
      text += fmt::format(", {} not found", unknown);
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
  const bool all = CountIn(configuration, "arrived") == CountIn(configuration, "targeted");
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
  const std::string kind = TextIn(c, "kind");
  text += fmt::format("  {} of {} units {}, {} refused, {} failed", CountIn(c, "arrived"),
                      CountIn(c, "targeted"),
                      kind == "home"      ? "homed"
                      : kind == "measure" ? "found"
                                          : "arrived",
                      CountIn(c, "refused"), CountIn(c, "failed"));
  for (const char* rarer : {"stopped", "unmeasured"})
    if (const std::uint64_t count = CountIn(c, rarer); count > 0)
      text += fmt::format(", {} {}", count, rarer);
  text += '\n';
  // 0 means that nothing has begun, and that nothing was predicted.
  const auto span = [&](const char* key) {
    return NumberIn(c, key) > 0 || over ? Shown(c, key, "s", 1) : "-";
  };
  text += fmt::format("  makespan {}{} (predicted {}), energy {}, peak power {}, {} frames",
                      span("makespan_s"), over || NumberIn(c, "makespan_s") <= 0 ? "" : " so far",
                      span("makespan_predicted_s"), Shown(c, "energy_J", "J", 1),
                      Shown(c, "peak_power_W", "W", 1), CountIn(c, "frames"));
  text += DescribeUploadAndStarts(c);
  text += DescribeMeasured(c);
  if (const std::string why = TextIn(c, "not_measured"); !why.empty())
    text += fmt::format("\n  {}", Paint(colour_on, Colour::kRed, "not measured: " + why));
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
  // The counts alone describe a stop of all: the units that it cut short are not at fault.
  const bool stopped = TextIn(configuration, "state") == "stopped";
  Json unserved = Json::array();
  for (const Json& unit : ListIn(configuration, "unserved"))
    if (!stopped || TextIn(unit, "outcome") != "stopped") unserved.push_back(unit);
  const std::vector<Alike> groups = GroupByReason(unserved);
  std::string text;
  for (std::size_t g = 0; g < groups.size() && g < kReasonsShown; ++g)
    text += DescribeGroup(unserved, groups[g]);
  if (groups.size() > kReasonsShown)
    text += fmt::format("  and {} more reasons; --json names all units\n",
                        groups.size() - kReasonsShown);
  if (!text.empty()) text.pop_back();
  return text;
}

Json ApplySummary(const Json& configuration, const Json& status) {
  Json summary;
  summary["configuration"] = CountIn(configuration, "id");
  summary["state"] = TextIn(configuration, "state");
  summary["units"] = CountIn(status, "units");
  for (const char* key :
       {"targeted", "arrived", "refused", "failed", "stopped", "unmeasured", "frames"}) {
    summary[key] = CountIn(configuration, key);
  }
  for (const char* key : {"makespan_predicted_s", "makespan_s", "energy_J", "peak_power_W"}) {
    summary[key] = NumberIn(configuration, key);
  }
  for (const char* key : {"upload_bits_predicted", "upload_bits", "starts", "starts_known"}) {
    summary[key] = CountIn(configuration, key);
  }
  for (const char* key : {"upload_predicted_s", "upload_s", "start_skew_s", "start_skew_bound_s",
                          "start_skew_least_s", "start_skew_most_s", "start_skew_allowed_s",
                          "start_first", "start_last"}) {
    summary[key] = configuration.value(key, Json(nullptr));
  }
  summary["measured"] = ListIn(configuration, "measured");
  summary["not_measured"] = configuration.value("not_measured", Json(nullptr));
  summary["bus_load_max"] =
      NumberIn(configuration, "bus_load_max", NumberIn(status, "bus_load_max"));
  // The reason is printed only where the configuration failed on the way.
  if (const std::string error = TextIn(configuration, "error"); !error.empty()) {
    summary["error"] = {{"code", "unavailable"}, {"text", error}};
  }
  summary["unserved"] = Json::array();
  for (const Json& unit : ListIn(configuration, "unserved")) {
    summary["unserved"].push_back({{"unit_id", CountIn(unit, "unit_id")},
                                   {"outcome", TextIn(unit, "outcome")},
                                   {"reason", TextIn(unit, "reason")},
                                   {"sighting", unit.value("sighting", Json(nullptr))},
                                   {"error_um", unit.value("error_um", Json(nullptr))},
                                   {"state", TextIn(unit, "state")}});
  }
  return summary;
}

}  // namespace focalfleet::cli
