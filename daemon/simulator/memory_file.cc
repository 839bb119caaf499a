#include "daemon/simulator/memory_file.h"

#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "protocol/base/limits.h"

namespace focalfleet::simulator {
namespace {

using Json = nlohmann::json;
constexpr int kVersion = 1;

Json ToJson(const sim::AxisFlash& flash, const sim::AxisMemory& memory) {
  return {{"vector", flash.vector},
          {"turns", flash.turns},
          {"subdivision", flash.subdivision},
          {"counter1", flash.counter1},
          {"repeat", flash.repeat},
          {"mode", static_cast<int>(flash.mode)},
          {"min_position", flash.min_position},
          {"max_position", flash.max_position},
          {"home_position", flash.home_position},
          {"rotor_turns", memory.rotor_turns},
          {"output_deg", memory.output_deg},
          {"scatter_deg", memory.scatter_deg},
          {"rotor_reference_turns", memory.rotor_reference_turns},
          {"output_reference_deg", memory.output_reference_deg},
          {"moves", memory.moves}};
}

// Reads members by name and checks them; the first wrong one is kept as the error.
class Members {
 public:
  explicit Members(const Json& object) : object_(object) {}

  std::int64_t Integer(const char* name, std::int64_t low, std::int64_t high) {
    const auto found = Find(name);
    if (found == nullptr || !found->is_number_integer()) return Wrong(name), low;
    const auto value = found->get<std::int64_t>();
    if (value < low || value > high) return Wrong(name), low;
    return value;
  }
  double Number(const char* name) {
    const auto found = Find(name);
    if (found == nullptr || !found->is_number()) return Wrong(name), 0;
    const auto value = found->get<double>();
    if (!std::isfinite(value) || std::abs(value) > 1e9) return Wrong(name), 0;
    return value;
  }
  bool Flag(const char* name) {
    const auto found = Find(name);
    if (found == nullptr || !found->is_boolean()) return Wrong(name), false;
    return found->get<bool>();
  }
  [[nodiscard]] const std::string& wrong() const { return wrong_; }

 private:
  const Json* Find(const char* name) const {
    if (!object_.is_object()) return nullptr;
    const auto found = object_.find(name);
    return found == object_.end() ? nullptr : &*found;
  }
  void Wrong(const char* name) {
    if (wrong_.empty()) wrong_ = name;
  }

  const Json& object_;
  std::string wrong_;
};

std::string ReadAxis(const Json& json, sim::AxisFlash* flash, sim::AxisMemory* memory) {
  constexpr std::int64_t kFar = limits::kPositionMax;
  Members members(json);
  flash->subdivision = static_cast<std::uint16_t>(members.Integer("subdivision", 6, 65'535));
  flash->vector = static_cast<std::uint16_t>(members.Integer("vector", 0, flash->subdivision - 1));
  flash->turns = static_cast<std::int32_t>(
      members.Integer("turns", -kFar / flash->subdivision - 1, kFar / flash->subdivision));
  flash->counter1 = static_cast<std::uint16_t>(members.Integer("counter1", 1, 65'535));
  flash->repeat = static_cast<std::uint8_t>(members.Integer("repeat", 1, 255));
  flash->mode = static_cast<WaveMode>(members.Integer("mode", 0, 2));
  flash->min_position = static_cast<std::int32_t>(members.Integer("min_position", -kFar, kFar));
  flash->max_position =
      static_cast<std::int32_t>(members.Integer("max_position", flash->min_position, kFar));
  flash->home_position = static_cast<std::int32_t>(
      members.Integer("home_position", flash->min_position, flash->max_position));
  memory->rotor_turns = members.Number("rotor_turns");
  memory->output_deg = members.Number("output_deg");
  memory->scatter_deg = members.Number("scatter_deg");
  memory->rotor_reference_turns = members.Number("rotor_reference_turns");
  memory->output_reference_deg = members.Number("output_reference_deg");
  memory->moves = static_cast<std::uint64_t>(members.Integer("moves", 0, INT64_MAX));
  return members.wrong();
}

std::string ReadUnit(const Json& json, sim::UnitMemory* unit) {
  Members members(json);
  unit->id = {static_cast<std::uint32_t>(members.Integer("unit_id", 0, UINT32_MAX))};
  unit->flash.serial = {static_cast<std::uint32_t>(members.Integer("serial", 0, UINT32_MAX))};
  unit->flash.moves_begun =
      static_cast<std::uint32_t>(members.Integer("moves_begun", 0, UINT32_MAX));
  unit->flash.last_begun = {static_cast<std::uint16_t>(members.Integer("last_begun", 0, 65'535))};
  unit->flash.moving = members.Flag("moving");
  unit->flash.lost_axes = static_cast<std::uint8_t>(members.Integer("lost_axes", 0, 3));
  unit->flash.host_timeout_ms =
      static_cast<std::int32_t>(members.Integer("host_timeout_ms", 100, 3'600'000));
  if (!members.wrong().empty()) return members.wrong();
  for (const Axis axis : kAxes) {
    const auto found = json.find(Name(axis));
    if (found == json.end()) return Name(axis);
    const std::string wrong =
        ReadAxis(*found, &unit->flash.axis[Index(axis)], &unit->axis[Index(axis)]);
    if (!wrong.empty()) return std::string(Name(axis)) + "." + wrong;
  }
  return {};
}

}  // namespace

std::string WriteMemory(const MemoryFile& memory) {
  Json units = Json::array();
  for (const sim::UnitMemory& unit : memory.units) {
    Json json = {{"unit_id", unit.id.value},
                 {"serial", unit.flash.serial.value},
                 {"moves_begun", unit.flash.moves_begun},
                 {"last_begun", unit.flash.last_begun.value},
                 {"moving", unit.flash.moving},
                 {"lost_axes", unit.flash.lost_axes},
                 {"host_timeout_ms", unit.flash.host_timeout_ms}};
    for (const Axis axis : kAxes)
      json[Name(axis)] = ToJson(unit.flash.axis[Index(axis)], unit.axis[Index(axis)]);
    units.push_back(std::move(json));
  }
  const Json file = {{"version", kVersion},
                     {"seed", memory.seed},
                     {"spread", memory.spread == sim::Spread::kReal ? "real" : "nominal"},
                     {"units", std::move(units)}};
  return file.dump(1) + "\n";
}

Result<MemoryFile> ReadMemory(std::string_view text, const std::string& file) {
  const auto invalid = [&](const std::string& what) {
    return Fail(ErrorCode::kInvalid, file + ": " + what);
  };
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return invalid("is no FLASH file of focalfleet-sim, or was cut short");
  const auto version = json.find("version");
  if (version == json.end() || !version->is_number_integer()) return invalid("has no version");
  if (version->get<std::int64_t>() > kVersion)
    return Fail(ErrorCode::kNewer, file + ": was written by a later version of focalfleet-sim");
  const auto seed = json.find("seed");
  const auto spread = json.find("spread");
  const auto units = json.find("units");
  if (seed == json.end() || !seed->is_number_unsigned()) return invalid("has no seed");
  if (spread == json.end() || (*spread != "real" && *spread != "nominal"))
    return invalid("has no spread");
  if (units == json.end() || !units->is_array()) return invalid("has no units");
  MemoryFile memory{seed->get<std::uint64_t>(),
                    *spread == "real" ? sim::Spread::kReal : sim::Spread::kNominal,
                    {}};
  memory.units.reserve(units->size());
  for (const Json& each : *units) {
    sim::UnitMemory unit;
    if (const std::string wrong = ReadUnit(each, &unit); !wrong.empty())
      return invalid("unit number " + std::to_string(memory.units.size() + 1) + " in it: '" +
                     wrong + "' is missing or out of range");
    memory.units.push_back(unit);
  }
  return memory;
}

}  // namespace focalfleet::simulator
