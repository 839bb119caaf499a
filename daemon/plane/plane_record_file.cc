#include "daemon/plane/plane_record_file.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "daemon/files/text_file.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using nlohmann::json;

json JsonOf(const PlaneConfiguration& configuration, const Layout& layout) {
  json targets = json::array();
  for (std::uint32_t n = 0; n < configuration.targets.size(); ++n) {
    if (!configuration.targets[n]) continue;
    const Pose& pose = *configuration.targets[n];
    const bool named = !configuration.target_ids.empty();
    targets.push_back({layout.units()[n].id.value, pose[0], pose[1],
                       named ? configuration.target_ids[n] : std::string()});
  }
  json to_home = json::array();
  for (const PositionerIndex i : configuration.to_home) to_home.push_back(layout.unit(i).id.value);
  json changes = json::array();
  for (const auto& [number, i] : configuration.changes)
    changes.push_back({number, layout.unit(i).id.value});
  const auto& measure = configuration.measure;
  json measured = measure ? json{{"corrections", measure->corrections},
                                 {"tolerance_um", measure->tolerance_um},
                                 {"observe", measure->observe}}
                          : json();
  return {{"id", configuration.id},
          {"source", configuration.source},
          {"fixed", configuration.fixed},
          {"targets", std::move(targets)},
          {"kind", Name(configuration.kind)},
          {"to_home", std::move(to_home)},
          {"unproven", configuration.unproven},
          {"changes", std::move(changes)},
          {"measure", std::move(measured)}};
}

constexpr ConfigurationState kOverStates[] = {
    ConfigurationState::kDone, ConfigurationState::kStopped, ConfigurationState::kFailed};

/// None: no state in which a configuration is over.
std::optional<ConfigurationState> OverStateOf(const json& from) {
  if (!from.is_string()) return std::nullopt;
  for (const ConfigurationState state : kOverStates)
    if (from.get<std::string>() == Name(state)) return state;
  return std::nullopt;
}

tl::unexpected<Error> Bad(const std::string& path, const std::string& why) {
  return Fail(ErrorCode::kInvalid, path + ": this is no record of a plane: " + why);
}

/// Empty: beyond all ranges. Pre: an integer.
std::optional<std::int32_t> VectorsOf(const json& number) {
  if (number.is_number_unsigned() && number.get<std::uint64_t>() > INT64_MAX) return std::nullopt;
  const auto vectors = number.get<std::int64_t>();
  if (vectors < -limits::kPositionMax || vectors > limits::kPositionMax) return std::nullopt;
  return static_cast<std::int32_t>(vectors);
}

std::optional<PositionerIndex> UnitOf(const json& id, const Layout& layout) {
  if (!id.is_number_unsigned() || id.get<std::uint64_t>() > UINT32_MAX) return std::nullopt;
  return layout.Find(UnitId{id.get<std::uint32_t>()});
}

constexpr ConfigurationKind kKinds[] = {ConfigurationKind::kApply, ConfigurationKind::kHome,
                                        ConfigurationKind::kMeasure};

/// Takes the task of a configuration that is more than targets. Records of earlier versions have
/// none.
Status TakeTask(const json& from, const std::string& path, const Layout& layout,
                PlaneConfiguration* configuration) {
  const json kind = from.value("kind", json());
  if (kind.is_null()) return {};
  const auto known = std::ranges::find_if(
      kKinds, [&](ConfigurationKind one) { return kind.is_string() && kind == Name(one); });
  const json unproven = from.value("unproven", json(false));
  const json to_home = from.value("to_home", json::array());
  const json changes = from.value("changes", json::array());
  if (known == std::end(kKinds) || !unproven.is_boolean() || !to_home.is_array() ||
      !changes.is_array())
    return Bad(path, "the task of a configuration");
  configuration->kind = *known;
  configuration->unproven = unproven.get<bool>();
  for (const json& id : to_home) {
    const auto unit = UnitOf(id, layout);
    if (!unit) return Bad(path, "a unit to home that the units file has not");
    configuration->to_home.push_back(*unit);
  }
  std::ranges::sort(configuration->to_home);
  if (const json measure = from.value("measure", json()); !measure.is_null()) {
    const auto has = [&measure](const char* key) {
      return measure.is_object() && measure.contains(key);
    };
    if (!has("corrections") || !has("tolerance_um") || !has("observe") ||
        !measure["corrections"].is_number_unsigned() || measure["corrections"] > UINT8_MAX ||
        !measure["tolerance_um"].is_number() || !measure["observe"].is_boolean())
      return Bad(path, "how a configuration is measured");
    configuration->measure = {.corrections = measure["corrections"].get<std::uint8_t>(),
                              .tolerance_um = measure["tolerance_um"].get<double>(),
                              .observe = measure["observe"].get<bool>()};
  }
  for (const json& change : changes) {
    const auto unit =
        change.is_array() && change.size() == 2 ? UnitOf(change[1], layout) : std::nullopt;
    if (!unit || !change[0].is_number_unsigned() || !configuration->targets[unit->value])
      return Bad(path, "another target of a unit");
    configuration->changes.emplace(change[0].get<std::uint64_t>(), *unit);
  }
  return {};
}

Result<PlaneConfiguration> ConfigurationOf(const json& from, const std::string& path,
                                           const Layout& layout) {
  const auto has = [&from](const char* key) { return from.is_object() && from.contains(key); };
  if (!has("id") || !has("source") || !has("fixed") || !has("targets") ||
      !from["id"].is_number_unsigned() || !from["source"].is_string() ||
      !from["fixed"].is_boolean() || !from["targets"].is_array())
    return Bad(path, "the configuration under way");
  PlaneConfiguration configuration{.id = from["id"].get<std::uint64_t>(),
                                   .source = from["source"].get<std::string>(),
                                   .fixed = from["fixed"].get<bool>()};
  configuration.targets.resize(layout.size());
  configuration.target_ids.resize(layout.size());
  for (const json& row : from["targets"]) {
    if (!row.is_array() || row.size() != 4 || !row[0].is_number_unsigned() ||
        !row[1].is_number_integer() || !row[2].is_number_integer() || !row[3].is_string())
      return Bad(path, "a target");
    const auto unit = UnitOf(row[0], layout);
    const std::optional<std::int32_t> theta = VectorsOf(row[1]), phi = VectorsOf(row[2]);
    if (!unit || !theta || !phi)
      return Bad(path, "a target of a unit that the units file has not, or beyond all ranges");
    configuration.targets[unit->value] = Pose{*theta, *phi};
    configuration.target_ids[unit->value] = row[3].get<std::string>();
  }
  FOCALFLEET_TRY(TakeTask(from, path, layout, &configuration));
  return configuration;
}

Result<PlaneRecordFile::Content> Parse(const std::string& text, const std::string& path,
                                       const Layout& layout) {
  json read = json::parse(text, nullptr, false);
  if (!read.is_object()) return Bad(path, "it is no JSON object");
  for (const char* key : {"coordinator", "epoch", "next_configuration"})
    if (!read[key].is_number_unsigned()) return Bad(path, key);
  PlaneRecordFile::Content content{.coordinator = read["coordinator"].get<std::uint64_t>(),
                                   .record = {}};
  content.record.epoch = {read["epoch"].get<std::uint64_t>(), content.coordinator};
  content.record.next_configuration = read["next_configuration"].get<std::uint64_t>();
  if (!read["under_way"].is_null()) {
    FOCALFLEET_TRY_ASSIGN(content.record.under_way,
                          ConfigurationOf(read["under_way"], path, layout));
  }
  // Records of earlier versions have none.
  if (read.contains("last") && !read["last"].is_null()) {
    FOCALFLEET_TRY_ASSIGN(content.record.last, ConfigurationOf(read["last"], path, layout));
    const auto state = OverStateOf(read["last_state"]);
    if (!state) return Bad(path, "last_state");
    content.record.last_state = *state;
  }
  return content;
}

}  // namespace

Result<std::unique_ptr<PlaneRecordFile>> PlaneRecordFile::Open(const std::string& path,
                                                               const Layout& layout,
                                                               std::uint64_t otherwise) {
  std::unique_ptr<PlaneRecordFile> file(new PlaneRecordFile(path, &layout));
  FOCALFLEET_TRY_ASSIGN(file->lock_, store_internal::LockFile::Acquire(path + ".lock"));
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    file->content_.coordinator = otherwise;
    FOCALFLEET_TRY(file->Keep({}));
    return file;
  }
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(path));
  FOCALFLEET_TRY_ASSIGN(file->content_, Parse(text, path, layout));
  return file;
}

Status PlaneRecordFile::Keep(const PlaneRecord& record) const {
  const json written{{"coordinator", content_.coordinator},
                     {"epoch", record.epoch.number},
                     {"next_configuration", record.next_configuration},
                     {"under_way", record.under_way ? JsonOf(*record.under_way, layout_) : json()},
                     {"last", record.last ? JsonOf(*record.last, layout_) : json()},
                     {"last_state", Name(record.last_state)}};
  return WriteFileAtomically(path_, written.dump() + "\n");
}

}  // namespace focalfleet
