#include "daemon/process/config.h"

#define TOML_EXCEPTIONS 0
#define TOML_HEADER_ONLY 1
#include <arpa/inet.h>
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

#include "daemon/dds/dds_options.h"
#include "daemon/process/config_keys.h"

namespace focalfleet {
namespace {

/// Waits that cover the host's own processes stay the same in real time. A simulated fleet that
/// runs faster does not make the host faster.
void ScaleDefaults(double speed, CoordinatorConfig* timing) {
  for (DurationNs* wait : {&timing->reply_wait, &timing->start_delay, &timing->settle_margin,
                           &timing->silence_limit, &timing->confirm_within})
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

  void Section(const char* name, const char* /*meaning*/) {
    name_ = name;
    section_ = nullptr;
    known_.insert(name_);
    const toml::node* node = root_.get(name);
    if (node == nullptr) return;
    section_ = node->as_table();
    if (section_ == nullptr) Wrong(*node, name_ + " must be a table: [" + name_ + "]");
  }
  void Text(const char* key, std::string* out, const char* /*meaning*/) {
    if (const toml::node* node = Find(key)) {
      if (const auto value = node->value_exact<std::string>())
        *out = *value;
      else
        WrongType(*node, key, "a text in quotes");
    }
  }
  void Path(const char* key, std::string* out, const char* /*meaning*/) {
    Text(key, out, nullptr);
    if (out->empty()) return;
    const std::filesystem::path directory = std::filesystem::path(file_).parent_path();
    *out = (directory / *out).lexically_normal().string();
  }
  void Flag(const char* key, bool* out, const char* /*meaning*/) {
    if (const toml::node* node = Find(key)) {
      if (const auto value = node->value_exact<bool>())
        *out = *value;
      else
        WrongType(*node, key, "true or false");
    }
  }
  void Real(const char* key, double* out, Range<double> range, const char* /*meaning*/) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const auto value = node->is_number() ? node->value<double>() : std::nullopt;
    if (!value) return WrongType(*node, key, "a number");
    if (!(*value >= range.low && *value <= range.high)) return WrongRange(*node, key, range);
    *out = *value;
  }
  template <class T>
  void Whole(const char* key, T* out, Range<std::int64_t> range, const char* /*meaning*/) {
    const toml::node* node = Find(key);
    if (node == nullptr) return;
    const auto value = node->value_exact<std::int64_t>();
    if (!value) return WrongType(*node, key, "a whole number");
    if (*value < range.low || *value > range.high) return WrongRange(*node, key, range);
    *out = static_cast<T>(*value);
  }
  void Wait(const char* key, DurationNs* out, const char* meaning) {
    std::int64_t ms = out->ns / 1'000'000;
    Whole(key, &ms, kMillisecondRange, meaning);
    *out = Milliseconds(ms);
  }
  void Choice(const char* key, std::string* out, std::span<const char* const> names,
              const char* /*meaning*/) {
    std::string value = *out;
    Text(key, &value, nullptr);
    if (std::ranges::find(names, value) != names.end())
      *out = value;
    else
      Wrong(*Find(key), Full(key) + " must be one of " + ListOf(names) + ", not '" + value + "'");
  }
  template <class Enum>
  void Index(const char* key, Enum* out, std::span<const char* const> names, const char* meaning) {
    std::string value = names[static_cast<std::size_t>(*out)];
    Choice(key, &value, names, meaning);
    *out = static_cast<Enum>(std::ranges::find(names, value) - names.begin());
  }
  void Texts(const char* key, std::vector<std::string>* out, const char* /*meaning*/) {
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
  void Section(const char* name, const char* /*meaning*/) {
    out_ << (out_.tellp() > 0 ? "\n[" : "[") << name << "]\n";
  }
  void Text(const char* key, const std::string* value, const char* /*meaning*/) {
    Put(key) << toml::value<std::string>(*value) << "\n";
  }
  void Path(const char* key, const std::string* value, const char* meaning) {
    Text(key, value, meaning);
  }
  void Choice(const char* key, const std::string* value, std::span<const char* const>,
              const char* meaning) {
    Text(key, value, meaning);
  }
  void Flag(const char* key, const bool* value, const char* /*meaning*/) {
    Put(key) << (*value ? "true" : "false") << "\n";
  }
  void Real(const char* key, const double* value, Range<double>, const char* /*meaning*/) {
    Put(key) << toml::value<double>(*value) << "\n";
  }
  template <class T>
  void Whole(const char* key, const T* value, Range<std::int64_t>, const char* /*meaning*/) {
    Put(key) << std::to_string(*value) << "\n";
  }
  void Wait(const char* key, const DurationNs* value, const char* /*meaning*/) {
    Put(key) << value->ns / 1'000'000 << "\n";
  }
  template <class Enum>
  void Index(const char* key, const Enum* value, std::span<const char* const> names,
             const char* /*meaning*/) {
    Put(key) << "\"" << names[static_cast<std::size_t>(*value)] << "\"\n";
  }
  void Texts(const char* key, const std::vector<std::string>* value, const char* /*meaning*/) {
    toml::array array;
    for (const std::string& text : *value) array.push_back(text);
    Put(key) << array << "\n";
  }
  [[nodiscard]] std::string text() const { return out_.str(); }

 private:
  std::ostream& Put(const char* key) { return out_ << key << " = "; }
  std::ostringstream out_;
};

bool IsNumericAddress(const std::string& address) {
  in6_addr place{};  // room for either kind
  return ::inet_pton(AF_INET, address.c_str(), &place) == 1 ||
         ::inet_pton(AF_INET6, address.c_str(), &place) == 1;
}

bool IsLoopback(const std::string& address) {
  return address == "::1" || address.starts_with("127.");
}

void CheckHttp(const DaemonConfig::Http& http, Reader* reader) {
  reader->Require(IsNumericAddress(http.address), "http", "address",
                  "http.address must be a numeric address of this host, such as \"127.0.0.1\"");
  reader->Require(http.certificate.empty() == http.key.empty(), "http", "key",
                  "http.certificate and http.key belong together: give both or none");
  reader->Require(http.port == 0 || http.tls() || IsLoopback(http.address), "http", "certificate",
                  "http.address " + http.address +
                      " is reached from elsewhere: that takes http.certificate and http.key");
  reader->Require(!http.viewer_without_token || IsLoopback(http.address), "http",
                  "viewer_without_token",
                  "http.viewer_without_token needs a loopback address: behind another one a proxy "
                  "would make everybody a viewer");
  reader->Require(http.port == 0 || !http.tokens.empty(), "http", "tokens",
                  "http.tokens must name a file: without tokens nobody is admitted");
}

void CheckTogether(const DaemonConfig& config, Reader* reader) {
  CheckHttp(config.http, reader);
  const bool socketcan = config.bus.port == PortKind::kSocketCan;
  reader->Require(!socketcan || !config.bus.interfaces.empty(), "bus", "interfaces",
                  "bus.interfaces must name one interface a bus for bus.port = \"socketcan\"");
  const std::set<std::string> names(config.bus.interfaces.begin(), config.bus.interfaces.end());
  reader->Require(names.size() == config.bus.interfaces.size() && !names.contains(""), "bus",
                  "interfaces", "bus.interfaces must name each interface once");
  reader->Require(config.bus.opener.empty() || socketcan, "bus", "opener",
                  "bus.opener needs bus.port = \"socketcan\"");
  reader->Require(!config.bus.can_fd || socketcan, "bus", "can_fd",
                  "bus.can_fd needs bus.port = \"socketcan\": simulated buses and UNIX sockets "
                  "carry classic frames only");
  reader->Require(!config.bus.can_fd || config.bus.data_bit_rate_bps >= config.bus.bit_rate_bps,
                  "bus", "data_bit_rate_bps",
                  "bus.data_bit_rate_bps must not be below bus.bit_rate_bps");
  reader->Require(config.plane.coordinates() || config.bus.port != PortKind::kUnix ||
                      !config.bus.unix_directory.empty(),
                  "bus", "unix_directory",
                  "bus.unix_directory must say where bus<ID>.sock are for bus.port = \"unix\"");
  reader->Require(config.sync.chip.empty() || config.clock.speed == 1, "sync", "chip",
                  "sync.chip asks for clock.speed = 1: a pulse is one of real time");
  // Source of the 20 ms: the window in which a unit takes an edge, docs/protocol.md.
  reader->Require(config.timing.sync_lead < Milliseconds(20), "timing", "sync_lead_ms",
                  "timing.sync_lead_ms must be below 20: units take an edge only so short before "
                  "their start");
  reader->Require(!config.camera.present() || !config.camera.fiducials.empty(), "camera",
                  "fiducials", "camera.fiducials must name a file where there is a camera");
  reader->Require(!config.camera.drop_place || !config.camera.directory.empty(), "camera",
                  "drop_place", "camera.drop_place is of camera.directory, which is empty");
  reader->Require(!config.camera.dds || config.camera.directory.empty(), "camera", "dds",
                  "a camera answers through camera.directory or through camera.dds, not both");
  reader->Require(config.dds.security.empty() || config.dds.domain < kDomainBesideFirst, "dds",
                  "domain",
                  "dds.domain is 0..223 with dds.security: the daemon needs the numbers above for "
                  "participants that join with renewed credentials");
  reader->Require(IsNumericAddress(config.metrics.address), "metrics", "address",
                  "metrics.address must be a numeric address of this host, such as \"127.0.0.1\"");
  reader->Require(!config.plane.coordinates() || !config.sector.present(), "sector", "buses",
                  "a daemon is the coordinator of a plane or one of its sectors, not both");
  reader->Require(config.dds.enabled || !(config.plane.coordinates() || config.sector.present()),
                  "dds", "enabled", "the daemons of a plane speak through DDS: dds.enabled");
  reader->Require(!config.sector.present() || !config.camera.present(), "camera", "directory",
                  "a sector of a plane has no camera: configurations are the plane's");
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
  config.timing.has_camera = config.camera.present() || config.sector.present();
  config.timing.reads_sensors = !config.hall.model.empty();
  config.timing.data_bit_rate_bps = config.bus.can_fd ? config.bus.data_bit_rate_bps : 0;
  config.timing.sync_line = !config.sync.chip.empty();
  config.timing.in_plane = config.sector.present();
  config.plane.sectors_at = reader.At("plane", "sectors");
  config.sector.buses_at = reader.At("sector", "buses");
  config.http.tokens_at = reader.At("http", "tokens");
  config.control.roles_at = reader.At("control", "engineers");
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
