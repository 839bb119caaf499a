#include "daemon/process/config.h"

#define TOML_EXCEPTIONS 0
#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <utility>

namespace focalfleet {
namespace {

constexpr const char* kLogLevels[] = {"trace", "debug", "info", "warning", "error"};
constexpr const char* kModes[] = {"asymmetric", "five_segment", "seven_segment"};
constexpr const char* kSpreads[] = {"nominal", "real"};

template <class T>
struct Range {
  T low;
  T high;
};
constexpr Range<std::int64_t> kMillisecondRange{1, 3'600'000};

/// The one list of keys stands here and in VisitTimingKeys. `visit` is a reader or a writer; both
/// visit every key once, in the order of the file.
template <class Config, class Visitor>
void VisitKeys(Config* c, Visitor* visit) {
  visit->Section("fleet");
  visit->Path("units", &c->fleet.units);
  visit->Path("obstacles", &c->fleet.obstacles);
  visit->Real("clearance_mm", &c->fleet.clearance_mm, {0, 1000});
  visit->Section("store");
  visit->Path("path", &c->store.path);
  visit->Section("control");
  visit->Path("socket", &c->control.socket);
  visit->Section("dds");
  visit->Flag("enabled", &c->dds.enabled);
  visit->Whole("domain", &c->dds.domain, {0, 230});
  visit->Real("rate_hz", &c->dds.rate_hz, {0.1, 100});
  visit->Path("config", &c->dds.config);
  visit->Section("log");
  visit->Choice("level", &c->log.level, kLogLevels);
  visit->Path("file", &c->log.file);
  visit->Flag("journal", &c->log.journal);
  visit->Section("bus");
  visit->Index("port", &c->bus.port, kPortKindNames);
  visit->Whole("bit_rate_bps", &c->bus.bit_rate_bps, {10'000, 1'000'000});
  visit->Flag("can_fd", &c->bus.can_fd);
  visit->Whole("data_bit_rate_bps", &c->bus.data_bit_rate_bps, {10'000, 8'000'000});
  visit->Path("unix_directory", &c->bus.unix_directory);
  visit->Texts("interfaces", &c->bus.interfaces);
  visit->Section("sync");
  visit->Path("chip", &c->sync.chip);
  visit->Whole("line", &c->sync.line, {0, 1023});
  visit->Flag("active_low", &c->sync.active_low);
  visit->Section("camera");
  visit->Path("directory", &c->camera.directory);
  visit->Flag("dds", &c->camera.dds);
  visit->Path("fiducials", &c->camera.fiducials);
  visit->Real("columns_px", &c->camera.sensor.columns_px, {1, 1e6});
  visit->Real("rows_px", &c->camera.sensor.rows_px, {1, 1e6});
  visit->Real("pixels_per_mm", &c->camera.model.pixels_per_mm, {1e-3, 1e4});
  visit->Real("rotation_deg", &c->camera.model.rotation_deg, {-360, 360});
  visit->Real("centre_x_px", &c->camera.model.centre_x_px, {-1e6, 1e6});
  visit->Real("centre_y_px", &c->camera.model.centre_y_px, {-1e6, 1e6});
  visit->Flag("mirrored", &c->camera.model.mirrored);
  visit->Real("centroid_sigma_um", &c->camera.centroid_sigma_um, {0.01, 1000});
  visit->Wait("patience_ms", &c->camera.patience);
  visit->Section("hall");
  visit->Path("model", &c->hall.model);
  visit->Real("noise_mT", &c->hall.noise_mT, {1e-5, 10});
  visit->Real("tilt_max_deg", &c->hall.tilt_max_deg, {1, 60});
  visit->Section("clock");
  visit->Real("speed", &c->clock.speed, {0.01, 1000});
  visit->Section("drive");
  visit->Real("v_bus_V", &c->drive.v_bus_V, {0.1, 60});
  auto* axis = &c->drive.axis[0];  // both axes alike
  visit->Whole("counter1", &axis->counter1, {1, 65'535});
  visit->Whole("repeat", &axis->repeat, {1, 255});
  visit->Whole("subdivision", &axis->subdivision, {6, 65'535});
  visit->Index("mode", &c->drive.mode, kModes);
}

template <class Config, class Visitor>
void VisitTimingKeys(Config* c, Visitor* visit) {
  visit->Section("timing");
  visit->Wait("reply_wait_ms", &c->timing.reply_wait);
  visit->Wait("identify_period_ms", &c->timing.identify_period);
  visit->Wait("poll_period_ms", &c->timing.poll_period);
  visit->Wait("notice_ms", &c->timing.notice);
  visit->Wait("clock_period_ms", &c->timing.clock_period);
  visit->Wait("start_delay_ms", &c->timing.start_delay);
  visit->Wait("sync_lead_ms", &c->timing.sync_lead);
  visit->Wait("settle_margin_ms", &c->timing.settle_margin);
  visit->Wait("silence_limit_ms", &c->timing.silence_limit);
  visit->Section("simulated");
  visit->Whole("seed", &c->simulated.seed, {0, std::numeric_limits<std::int64_t>::max()});
  visit->Choice("spread", &c->simulated.spread, kSpreads);
}

/// Waits that have to cover the host's own processes stay what they are in real time: a simulated
/// fleet that runs faster than real time does not make the host faster.
void ScaleDefaults(double speed, CoordinatorConfig* timing) {
  for (DurationNs* wait :
       {&timing->reply_wait, &timing->start_delay, &timing->settle_margin, &timing->silence_limit})
    *wait = Seconds(wait->seconds() * std::max(1.0, speed));
}

std::string ListOf(std::span<const char* const> names) {
  std::string list;
  for (const char* name : names) list += (list.empty() ? "'" : ", '") + std::string(name) + "'";
  return list;
}

class Reader {
 public:
  Reader(const toml::table& root, std::string file) : root_(root), file_(std::move(file)) {}

  void Section(const char* name) {
    name_ = name;
    section_ = nullptr;
    known_.insert(name_);
    const toml::node* node = root_.get(name);
    if (node == nullptr) return;
    section_ = node->as_table();
    if (section_ == nullptr) Wrong(*node, name_ + " must be a table: [" + name_ + "]");
  }
  void Text(const char* key, std::string* out) {
    if (const toml::node* node = Find(key)) {
      if (const auto value = node->value_exact<std::string>())
        *out = *value;
      else
        WrongType(*node, key, "a text in quotes");
    }
  }
  void Path(const char* key, std::string* out) {
    Text(key, out);
    if (out->empty()) return;
    const std::filesystem::path directory = std::filesystem::path(file_).parent_path();
    *out = (directory / *out).lexically_normal().string();
  }
  void Flag(const char* key, bool* out) {
    if (const toml::node* node = Find(key)) {
      if (const auto value = node->value_exact<bool>())
        *out = *value;
      else
        WrongType(*node, key, "true or false");
    }
  }
  void Real(const char* key, double* out, Range<double> range) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const auto value = node->is_number() ? node->value<double>() : std::nullopt;
    if (!value) return WrongType(*node, key, "a number");
    if (!(*value >= range.low && *value <= range.high)) return WrongRange(*node, key, range);
    *out = *value;
  }
  template <class T>
  void Whole(const char* key, T* out, Range<std::int64_t> range) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::int64_t>();
    if (!value) return WrongType(*node, key, "a whole number");
    if (*value < range.low || *value > range.high) return WrongRange(*node, key, range);
    *out = static_cast<T>(*value);
  }
  void Wait(const char* key, DurationNs* out) {
    std::int64_t ms = out->ns / 1'000'000;
    Whole(key, &ms, kMillisecondRange);
    *out = Milliseconds(ms);
  }
  void Choice(const char* key, std::string* out, std::span<const char* const> names) {
    std::string value = *out;
    Text(key, &value);
    if (std::ranges::find(names, value) != names.end())
      *out = value;
    else
      Wrong(*Find(key), Full(key) + " must be one of " + ListOf(names) + ", not '" + value + "'");
  }
  template <class Enum>
  void Index(const char* key, Enum* out, std::span<const char* const> names) {
    std::string value = names[static_cast<std::size_t>(*out)];
    Choice(key, &value, names);
    *out = static_cast<Enum>(std::ranges::find(names, value) - names.begin());
  }
  void Texts(const char* key, std::vector<std::string>* out) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const toml::array* array = node->as_array();
    if (array == nullptr) return WrongType(*node, key, "a list of texts");
    out->clear();
    for (const toml::node& item : *array) {
      const auto value = item.value_exact<std::string>();
      if (!value) return WrongType(item, key, "a list of texts");
      out->push_back(*value);
    }
  }

  /// Each key of the file that was not read is a problem. Pre: all keys were read.
  void CheckUnknown() {
    for (const auto& [name, node] : root_) {
      if (!known_.contains(std::string(name.str())))
        WrongLine(name.source(), "unknown key '" + std::string(name.str()) + "'");
      const toml::table* table = node.as_table();
      if (table == nullptr) continue;
      for (const auto& [key, value] : *table) {
        const std::string full = std::string(name.str()) + "." + std::string(key.str());
        if (known_.contains(std::string(name.str())) && !known_.contains(full))
          WrongLine(key.source(), "unknown key '" + full + "'");
      }
    }
  }
  /// A condition on several keys. The problem stands at the line of `section.key`, or of the
  /// section where the key is absent.
  void Require(bool condition, const char* section, const char* key, const std::string& text) {
    if (!condition) problems_.emplace(LineOf(section, key), text);
  }
  /// file:line of a key, for faults that show only when its value is used. The line is that of
  /// Require.
  [[nodiscard]] std::string At(const char* section, const char* key) const {
    return file_ + ":" + std::to_string(LineOf(section, key));
  }

  [[nodiscard]] Status Verdict() const {
    if (problems_.empty()) return {};
    const auto& [line, text] = *problems_.begin();
    const std::string more =
        problems_.size() > 1 ? " (and " + std::to_string(problems_.size() - 1) + " more)" : "";
    return Fail(ErrorCode::kInvalid, file_ + ":" + std::to_string(line) + ": " + text + more);
  }

 private:
  [[nodiscard]] std::string Full(const char* key) const { return name_ + "." + key; }
  const toml::node* Find(const char* key) {
    known_.insert(Full(key));
    return section_ == nullptr ? nullptr : section_->get(key);
  }
  static toml::source_index LineOf(const toml::source_region& source) {
    return std::max(source.begin.line, toml::source_index{1});
  }
  [[nodiscard]] toml::source_index LineOf(const char* section, const char* key) const {
    const auto at = root_.at_path(std::string(section) + "." + key);
    if (at.node() != nullptr) return LineOf(at.node()->source());
    const toml::node* table = root_.get(section);
    return table != nullptr ? LineOf(table->source()) : 1;
  }
  void Wrong(const toml::node& node, const std::string& text) { WrongLine(node.source(), text); }
  void WrongLine(const toml::source_region& source, const std::string& text) {
    problems_.emplace(LineOf(source), text);
  }
  void WrongType(const toml::node& node, const char* key, const char* expected) {
    Wrong(node, Full(key) + " must be " + expected);
  }
  template <class T>
  void WrongRange(const toml::node& node, const char* key, Range<T> range) {
    std::ostringstream text;
    text << Full(key) << " must be in " << range.low << ".." << range.high;
    Wrong(node, text.str());
  }

  const toml::table& root_;
  std::string file_;
  std::string name_;
  const toml::table* section_ = nullptr;
  std::set<std::string> known_;
  std::multimap<toml::source_index, std::string> problems_;  // by line
};

class Writer {
 public:
  void Section(const char* name) { out_ << (out_.tellp() > 0 ? "\n[" : "[") << name << "]\n"; }
  void Path(const char* key, const std::string* value) {
    Put(key) << toml::value<std::string>(*value) << "\n";
  }
  void Choice(const char* key, const std::string* value, std::span<const char* const>) {
    Path(key, value);
  }
  void Flag(const char* key, const bool* value) { Put(key) << (*value ? "true" : "false") << "\n"; }
  void Real(const char* key, const double* value, Range<double>) {
    Put(key) << toml::value<double>(*value) << "\n";
  }
  template <class T>
  void Whole(const char* key, const T* value, Range<std::int64_t>) {
    Put(key) << std::to_string(*value) << "\n";
  }
  void Wait(const char* key, const DurationNs* value) { Put(key) << value->ns / 1'000'000 << "\n"; }
  template <class Enum>
  void Index(const char* key, const Enum* value, std::span<const char* const> names) {
    Put(key) << "\"" << names[static_cast<std::size_t>(*value)] << "\"\n";
  }
  void Texts(const char* key, const std::vector<std::string>* value) {
    toml::array array;
    for (const std::string& text : *value) array.push_back(text);
    Put(key) << array << "\n";
  }
  [[nodiscard]] std::string text() const { return out_.str(); }

 private:
  std::ostream& Put(const char* key) { return out_ << key << " = "; }
  std::ostringstream out_;
};

void CheckTogether(const DaemonConfig& config, Reader* reader) {
  const bool socketcan = config.bus.port == PortKind::kSocketCan;
  reader->Require(!socketcan || !config.bus.interfaces.empty(), "bus", "interfaces",
                  "bus.interfaces must name one interface a bus for bus.port = \"socketcan\"");
  const std::set<std::string> names(config.bus.interfaces.begin(), config.bus.interfaces.end());
  reader->Require(names.size() == config.bus.interfaces.size() && !names.contains(""), "bus",
                  "interfaces", "bus.interfaces must name each interface once");
  reader->Require(!config.bus.can_fd || socketcan, "bus", "can_fd",
                  "bus.can_fd needs bus.port = \"socketcan\": simulated buses and UNIX sockets "
                  "carry classic frames only");
  reader->Require(!config.bus.can_fd || config.bus.data_bit_rate_bps >= config.bus.bit_rate_bps,
                  "bus", "data_bit_rate_bps",
                  "bus.data_bit_rate_bps must not be below bus.bit_rate_bps");
  reader->Require(config.bus.port != PortKind::kUnix || !config.bus.unix_directory.empty(), "bus",
                  "unix_directory",
                  "bus.unix_directory must say where bus<ID>.sock are for bus.port = \"unix\"");
  reader->Require(config.sync.chip.empty() || config.clock.speed == 1, "sync", "chip",
                  "sync.chip asks for clock.speed = 1: a pulse is one of real time");
  // Source of the 20 ms: the window in which a unit takes an edge, docs/protocol.md.
  reader->Require(config.timing.sync_lead < Milliseconds(20), "timing", "sync_lead_ms",
                  "timing.sync_lead_ms must be below 20: units take an edge only so short before "
                  "their start");
  reader->Require(!config.camera.present() || !config.camera.fiducials.empty(), "camera",
                  "fiducials", "camera.fiducials must name a file where there is a camera");
  reader->Require(!config.camera.dds || config.camera.directory.empty(), "camera", "dds",
                  "a camera answers through camera.directory or through camera.dds, not both");
  reader->Require(!config.fleet.units.empty(), "fleet", "units", "fleet.units must name a file");
  reader->Require(!config.store.path.empty(), "store", "path", "store.path must name a file");
  reader->Require(!config.control.socket.empty(), "control", "socket",
                  "control.socket must name a file");
}

}  // namespace

Result<DaemonConfig> ParseConfig(std::string_view text, const std::string& path) {
  const toml::parse_result parsed = toml::parse(text, path);
  if (!parsed) {
    const toml::parse_error& error = parsed.error();
    return Fail(ErrorCode::kInvalid, path + ":" + std::to_string(error.source().begin.line) + ": " +
                                         std::string(error.description()));
  }
  DaemonConfig config;
  Reader reader(parsed.table(), path);
  VisitKeys(&config, &reader);
  ScaleDefaults(config.clock.speed, &config.timing);
  VisitTimingKeys(&config, &reader);
  reader.CheckUnknown();
  FOCALFLEET_TRY(reader.Verdict());  // a misspelt key is the likely reason of a missing one
  CheckTogether(config, &reader);
  FOCALFLEET_TRY(reader.Verdict());
  config.drive.axis[1] = config.drive.axis[0];
  config.timing.bit_rate_bps = config.bus.bit_rate_bps;
  config.timing.has_camera = config.camera.present();
  config.timing.reads_sensors = !config.hall.model.empty();
  config.timing.data_bit_rate_bps = config.bus.can_fd ? config.bus.data_bit_rate_bps : 0;
  config.timing.sync_line = !config.sync.chip.empty();
  config.sync.chip_at = reader.At("sync", "chip");
  config.bus.interfaces_at = reader.At("bus", "interfaces");
  config.log.file_at = reader.At("log", "file");
  return config;
}

Result<DaemonConfig> LoadConfig(const std::string& path) {
  std::error_code failed;
  if (std::filesystem::is_directory(path, failed))
    return Fail(ErrorCode::kUnavailable, path + " is a directory");
  std::ifstream file(path, std::ios::binary);
  if (!file) return Fail(ErrorCode::kUnavailable, "cannot read " + path);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (file.bad()) return Fail(ErrorCode::kUnavailable, "cannot read " + path);
  return ParseConfig(text, path);
}

std::string EffectiveConfig(const DaemonConfig& config) {
  Writer writer;
  VisitKeys(&config, &writer);
  VisitTimingKeys(&config, &writer);
  return writer.text();
}

}  // namespace focalfleet
