#include <array>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "tests/hidden/score/score.h"

namespace focalfleet::hidden {

namespace {

Result<Requirement> TargetOf(const Figure& figure) {
  return ParseRequirement(figure.id + figure.target);
}

std::string Line(const Figure& f) {
  std::array<char, 256> text{};
  if (f.trials == 0) {
    std::snprintf(text.data(), text.size(), "%-26s %-50s %8s\n", f.id.c_str(), f.text.c_str(), "-");
    return text.data();
  }
  const auto target = TargetOf(f);
  const char* met = !target                    ? ""
                    : Meets(f, *target, false) ? "met"
                    : Meets(f, *target, true)  ? "missed, within the interval"
                                               : "MISSED";
  if (f.is_share) {
    const Interval exact = f.exact();
    const Interval wilson = f.wilson();
    std::snprintf(text.data(), text.size(),
                  "%-26s %-50s %8.4f %4d/%-4d [%.4f, %.4f] [%.4f, %.4f] %-7s %s\n", f.id.c_str(),
                  f.text.c_str(), f.value, f.hits, f.trials, exact.low, exact.high, wilson.low,
                  wilson.high, f.target.c_str(), met);
  } else {
    std::snprintf(text.data(), text.size(), "%-26s %-50s %8.4f %9d %35s %-7s %s\n", f.id.c_str(),
                  f.text.c_str(), f.value, f.trials, "", f.target.c_str(), met);
  }
  return text.data();
}

}  // namespace

Result<Requirement> ParseRequirement(const std::string& text) {
  const std::size_t at = text.find_first_of("<>");
  if (at == std::string::npos || at == 0 || at + 2 >= text.size() || text[at + 1] != '=')
    return Fail(ErrorCode::kInvalid, "'" + text + "' is not FIGURE>=NUMBER or FIGURE<=NUMBER");
  char* end = nullptr;
  const double bound = std::strtod(text.c_str() + at + 2, &end);
  if (*end != '\0') return Fail(ErrorCode::kInvalid, "'" + text + "' does not end in a number");
  return Requirement{text.substr(0, at), text[at] == '>', bound};
}

bool Meets(const Figure& figure, const Requirement& requirement, bool by_interval) {
  if (figure.trials == 0) return false;
  double value = figure.value;
  if (by_interval && figure.is_share) {
    const Interval exact = figure.exact();
    value = requirement.at_least ? exact.high : exact.low;
  }
  return requirement.at_least ? value >= requirement.bound : value <= requirement.bound;
}

std::string TablesOf(const Score& score) {
  std::array<char, 256> head{};
  std::snprintf(head.data(), head.size(), "%-26s %-50s %8s %9s %-17s %-17s %-7s\n", "figure", "",
                "value", "count", "Clopper-Pearson", "Wilson 95 %", "target");
  std::string text = head.data();
  for (const Figure& figure : score.figures) text += Line(figure);
  text += "\nwhat was said first of single causes with lambda >= 50\n";
  for (const auto& [cause, said] : score.confusion) {
    text += "  " + cause + ":";
    for (const auto& [name, count] : said)
      text += " " + (name == cause ? "right" : name) + " " + std::to_string(count) + ",";
    text.back() = '\n';
  }
  text += "\nreliability of the stated probabilities, by ten bins\n" + TableOf(score.reliability);
  if (!score.worst.empty()) text += "\nwrong and sure\n";
  for (const std::string& line : score.worst) text += "  " + line + "\n";
  return text;
}

std::string JsonOf(const Score& score) {
  nlohmann::ordered_json out;
  out["figures"] = nlohmann::ordered_json::array();
  for (const Figure& f : score.figures) {
    nlohmann::ordered_json figure = {{"id", f.id}, {"text", f.text}, {"trials", f.trials}};
    if (f.trials > 0) figure["value"] = f.value;
    if (f.is_share && f.trials > 0) {
      figure["hits"] = f.hits;
      figure["clopper_pearson"] = {f.exact().low, f.exact().high};
      figure["wilson"] = {f.wilson().low, f.wilson().high};
    }
    if (const auto target = TargetOf(f); target) {
      figure["target"] = f.target;
      if (f.trials > 0) figure["met"] = Meets(f, *target, false);
    }
    out["figures"].push_back(figure);
  }
  out["confusion"] = score.confusion;
  out["reliability"] = nlohmann::ordered_json::array();
  for (const ReliabilityBin& bin : score.reliability)
    out["reliability"].push_back(
        {{"stated", bin.stated()}, {"right", bin.right}, {"count", bin.count}});
  out["wrong_and_sure"] = score.worst;
  return out.dump(1) + "\n";
}

}  // namespace focalfleet::hidden
