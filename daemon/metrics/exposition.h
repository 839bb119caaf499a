// Text in the exposition format of Prometheus, version 0.0.4. A family is a name with its help, its
// type and its samples. The writer checks nothing: promtool does so in the tests.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "daemon/metrics/histogram.h"

namespace focalfleet {

class Exposition {
 public:
  /// Families of one sample without labels.
  void Gauge(std::string_view name, std::string_view help, double value);
  void Counter(std::string_view name, std::string_view help, double value);
  void Write(std::string_view name, std::string_view help, const HistogramReading& histogram);

  /// A family whose samples follow, each with labels.
  void BeginGauge(std::string_view name, std::string_view help) { Begin(name, help, "gauge"); }
  void BeginCounter(std::string_view name, std::string_view help) { Begin(name, help, "counter"); }
  void Sample(std::string_view label, std::string_view value_of_label, double value);
  void Sample(std::string_view label, std::uint32_t value_of_label, double value);
  /// `labels` as they stand between the braces.
  void SampleOf(std::string_view labels, double value);

  [[nodiscard]] std::string text() const { return fmt::to_string(text_); }

 private:
  void Begin(std::string_view name, std::string_view help, std::string_view type);
  void Line(std::string_view suffix, std::string_view labels, double value);

  fmt::memory_buffer text_;
  std::string family_;
};

/// A label's value between quotes: backslash, quote and line feed are escaped.
std::string EscapedLabel(std::string_view value);

}  // namespace focalfleet
