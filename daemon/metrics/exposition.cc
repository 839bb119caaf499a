#include "daemon/metrics/exposition.h"

#include <fmt/compile.h>

#include <cmath>
#include <iterator>

namespace focalfleet {
namespace {

std::string NumberText(double value) {
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value > 0 ? "+Inf" : "-Inf";
  return fmt::format(FMT_COMPILE("{}"), value);
}

}  // namespace

std::string EscapedLabel(std::string_view value) {
  std::string out;
  for (const char c : value) {
    if (c == '\\' || c == '"') out += '\\';
    out += c == '\n' ? std::string("\\n") : std::string(1, c);
  }
  return out;
}

void Exposition::Begin(std::string_view name, std::string_view help, std::string_view type) {
  family_ = name;
  fmt::format_to(std::back_inserter(text_), FMT_COMPILE("# HELP {} {}\n# TYPE {} {}\n"), name, help,
                 name, type);
}

void Exposition::Line(std::string_view suffix, std::string_view labels, double value) {
  const auto out = std::back_inserter(text_);
  if (labels.empty())
    fmt::format_to(out, FMT_COMPILE("{}{} {}\n"), family_, suffix, NumberText(value));
  else
    fmt::format_to(out, FMT_COMPILE("{}{}{{{}}} {}\n"), family_, suffix, labels, NumberText(value));
}

void Exposition::Gauge(std::string_view name, std::string_view help, double value) {
  Begin(name, help, "gauge");
  Line("", "", value);
}

void Exposition::Counter(std::string_view name, std::string_view help, double value) {
  Begin(name, help, "counter");
  Line("", "", value);
}

void Exposition::Write(std::string_view name, std::string_view help,
                       const HistogramReading& histogram) {
  Begin(name, help, "histogram");
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    count += histogram.counts[i];
    const std::string bound =
        i < histogram.bounds.size() ? NumberText(histogram.bounds[i]) : "+Inf";
    Line("_bucket", "le=\"" + bound + "\"", static_cast<double>(count));
  }
  Line("_sum", "", histogram.sum);
  Line("_count", "", static_cast<double>(count));
}

void Exposition::Sample(std::string_view label, std::string_view value_of_label, double value) {
  SampleOf(fmt::format(FMT_COMPILE("{}=\"{}\""), label, EscapedLabel(value_of_label)), value);
}

void Exposition::Sample(std::string_view label, std::uint32_t value_of_label, double value) {
  SampleOf(fmt::format(FMT_COMPILE("{}=\"{}\""), label, value_of_label), value);
}

void Exposition::SampleOf(std::string_view labels, double value) { Line("", labels, value); }

}  // namespace focalfleet
