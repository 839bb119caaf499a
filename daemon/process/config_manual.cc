#include "daemon/process/config_manual.h"

#include <fmt/format.h>

#include <span>

#include "daemon/process/config_keys.h"
#include "daemon/process/daemon.h"
#include "daemon/usage/roff.h"

namespace focalfleet {
namespace {

std::string Quoted(const std::string& text) { return "\"" + text + "\""; }

/// Visits the keys of a configuration that has its defaults.
class Describer {
 public:
  void Section(const char* name, const char* meaning) { sections_.push_back({name, meaning, {}}); }
  void Text(const char* key, const std::string* value, const char* meaning) {
    Put(key, "text", Quoted(*value), meaning);
  }
  void Path(const char* key, const std::string* value, const char* meaning) {
    Put(key, "path", Quoted(*value), meaning);
  }
  void Flag(const char* key, const bool* value, const char* meaning) {
    Put(key, "true or false", *value ? "true" : "false", meaning);
  }
  void Real(const char* key, const double* value, Range<double> range, const char* meaning) {
    Put(key, fmt::format("number from {:.12g} to {:.12g}", range.low, range.high),
        fmt::format("{:.12g}", *value), meaning);
  }
  template <class T>
  void Whole(const char* key, const T* value, Range<std::int64_t> range, const char* meaning) {
    const bool open = range.high == std::numeric_limits<std::int64_t>::max();
    Put(key,
        open ? fmt::format("whole number from {}", range.low)
             : fmt::format("whole number from {} to {}", range.low, range.high),
        std::to_string(*value), meaning);
  }
  void Wait(const char* key, const DurationNs* value, const char* meaning) {
    const std::int64_t ms = value->ns / 1'000'000;
    Whole(key, &ms, kMillisecondRange, meaning);
  }
  void Choice(const char* key, const std::string* value, std::span<const char* const> names,
              const char* meaning) {
    Put(key, fmt::format("one of {}", fmt::join(names, ", ")), Quoted(*value), meaning);
  }
  template <class Enum>
  void Index(const char* key, const Enum* value, std::span<const char* const> names,
             const char* meaning) {
    const std::string name = names[static_cast<std::size_t>(*value)];
    Choice(key, &name, names, meaning);
  }
  void Texts(const char* key, const std::vector<std::string>*, const char* meaning) {
    Put(key, "list of texts", "[]", meaning);
  }
  [[nodiscard]] std::vector<ConfigSection> sections() const { return sections_; }

 private:
  void Put(const char* key, std::string kind, std::string initial, const char* meaning) {
    ConfigSection& section = sections_.back();
    section.keys.push_back(
        {section.name + "." + key, std::move(kind), std::move(initial), meaning});
  }
  std::vector<ConfigSection> sections_;
};

}  // namespace

std::vector<ConfigSection> DescribeConfig() {
  const DaemonConfig defaults;
  Describer describer;
  VisitKeys(&defaults, &describer);
  VisitTimingKeys(&defaults, &describer);
  return describer.sections();
}

usage::ManualPage ConfigManual() {
  usage::Roff page(
      {"focalfleet.toml", 5, std::string("focalfleet ") + FOCALFLEET_VERSION, "focalfleet manual"},
      "configuration of focalfleetd");
  page.Section("DESCRIPTION");
  page.Paragraph(
      "The configuration of focalfleetd(8) is a TOML file. Every key has a default. A key that the "
      "daemon does not know is an error with its line. Relative paths are relative to the file.");
  page.Paragraph(
      "focalfleetd --config FILE --check reads the file and all that it names, and prints every "
      "key with its effective value.");
  for (const ConfigSection& section : DescribeConfig()) {
    page.Section("[" + section.name + "]");
    page.Paragraph(section.meaning + ".");
    for (const ConfigKey& key : section.keys)
      page.Item(key.name.substr(section.name.size() + 1), "",
                fmt::format("{} ({}; default {}).", key.meaning, key.kind, key.initial));
  }
  page.Section("EXAMPLES");
  page.Literal(
      "[fleet]\nunits = \"units.csv\"\n\n[bus]\nport = \"socketcan\"\n"
      "interfaces = [\"can0\", \"can1\"]");
  page.Section("SEE ALSO");
  page.References("focalfleetd(8), focalfleet(1)");
  return {"focalfleet.toml.5", page.text()};
}

}  // namespace focalfleet
