#include "sim/world/fault_plan.h"

#include <algorithm>
#include <array>

#include "protocol/base/check.h"
#include "protocol/base/limits.h"
#include "protocol/base/rng.h"
#include "protocol/wire/can_frame.h"
#include "sim/world/world.h"

namespace focalfleet::sim {
namespace {

constexpr FaultKindInfo OfSensor(FaultKind kind, const char* name, double last) {
  return {.kind = kind,
          .name = name,
          .of_unit = true,
          .value = "sensor",
          .value_min = 1,
          .value_max = last};
}

constexpr std::array<FaultKindInfo, kFaultKindCount> kKinds{{
    {.kind = FaultKind::kNoise, .name = "noise", .needs_bit_clock = true},
    {.kind = FaultKind::kDrop, .name = "drop"},
    {.kind = FaultKind::kDuplicate, .name = "duplicate"},
    {.kind = FaultKind::kDelay,
     .name = "delay",
     .value = "seconds",
     .value_max = 3600,
     .value_otherwise = 0.005},
    {.kind = FaultKind::kStuck, .name = "stuck", .needs_bit_clock = true},
    {.kind = FaultKind::kDead, .name = "dead"},
    {.kind = FaultKind::kHostOff, .name = "host_off", .needs_bit_clock = true},
    {.kind = FaultKind::kBabble,
     .name = "babble",
     .of_unit = true,
     .needs_bit_clock = true,
     .value = "priority",
     .value_max = 7,
     .value_otherwise = 1},
    {.kind = FaultKind::kUnplugged, .name = "unplugged", .of_unit = true},
    {.kind = FaultKind::kPowerCut, .name = "power_cut", .of_unit = true},
    {.kind = FaultKind::kSilent, .name = "silent", .of_unit = true},
    {.kind = FaultKind::kDeaf, .name = "deaf", .of_unit = true},
    {.kind = FaultKind::kLate,
     .name = "late",
     .of_unit = true,
     .value = "seconds",
     .value_max = 3600},
    {.kind = FaultKind::kCopies,
     .name = "copies",
     .of_unit = true,
     .value = "copies",
     .value_min = 1,
     .value_max = 100},
    {.kind = FaultKind::kWrongDigest, .name = "wrong_digest", .of_unit = true},
    {.kind = FaultKind::kMuteDone, .name = "mute_done", .of_unit = true},
    OfSensor(FaultKind::kSensorStuck, "sensor_stuck", limits::kSensorsPerUnit),
    OfSensor(FaultKind::kSensorSaturated, "sensor_saturated", limits::kSensorsPerUnit),
    OfSensor(FaultKind::kSensorMissing, "sensor_missing", limits::kSensorsPerUnit),
    OfSensor(FaultKind::kSensorSwapped, "sensor_swapped", limits::kSensorsPerUnit - 1),
    OfSensor(FaultKind::kSensorGain, "sensor_gain", limits::kSensorsPerUnit),
}};

/// No function of the protocol has this number: the host counts it as malformed.
constexpr std::uint32_t kNoFunction = 63;

CanFrame Babble(const UnitDescription& unit, double priority) {
  CanFrame frame{static_cast<std::uint32_t>(priority) << 26 | kNoFunction << 20 | 1u << 19 |
                     std::uint32_t{unit.node.value} << 11,
                 8,
                 {}};
  frame.data.fill(0x55);
  return frame;
}

void ApplyToBus(const PlannedFault& fault, bool begins, World* world) {
  BusFaults& faults = *world->disturb().faults(fault.bus);
  const double chance = begins ? fault.chance : 0;
  switch (fault.kind) {
    case FaultKind::kNoise:
      faults.bit_error_rate = chance;
      return;
    case FaultKind::kDrop:
      faults.drop = chance;
      return;
    case FaultKind::kDuplicate:
      faults.duplicate = chance;
      return;
    case FaultKind::kDelay:
      faults.late = chance;
      faults.late_by = Seconds(fault.value);
      return;
    case FaultKind::kStuck:
      begins ? world->disturb().StickBus(fault.bus) : world->disturb().ReleaseBus(fault.bus);
      return;
    case FaultKind::kDead:
      begins ? world->disturb().KillBus(fault.bus) : world->disturb().ReviveBus(fault.bus);
      return;
    default:
      if (begins) world->disturb().ThrowHostOff(fault.bus);
  }
}

UnitFaults::Sensor SensorFault(const PlannedFault& fault) {
  using Kind = UnitFaults::Sensor::Kind;
  const auto sensor = static_cast<std::uint8_t>(fault.value - 1);
  switch (fault.kind) {
    case FaultKind::kSensorSaturated:
      return {Kind::kSaturated, sensor, 0};
    case FaultKind::kSensorMissing:
      return {Kind::kMissing, sensor, 0};
    case FaultKind::kSensorSwapped:
      return {Kind::kSwapped, sensor, static_cast<std::uint8_t>(sensor + 1)};
    case FaultKind::kSensorGain:
      return {Kind::kGain, sensor, 0};
    default:
      return {Kind::kStuck, sensor, 0};
  }
}

void ApplyToUnit(const PlannedFault& fault, bool begins, World* world) {
  UnitFaults& faults = *world->disturb().faults(fault.unit);
  switch (fault.kind) {
    case FaultKind::kBabble: {
      std::optional<CanFrame> frame;
      if (begins) frame = Babble(world->units()[*world->Find(fault.unit)], fault.value);
      world->disturb().Babble(fault.unit, frame);
      return;
    }
    case FaultKind::kUnplugged:
      begins ? world->disturb().Unplug(fault.unit) : world->disturb().Plug(fault.unit);
      return;
    case FaultKind::kPowerCut:
      begins ? world->disturb().PowerCut(fault.unit) : world->disturb().PowerOn(fault.unit);
      return;
    case FaultKind::kSilent:
      faults.silent = begins;
      return;
    case FaultKind::kDeaf:
      faults.deaf = begins;
      return;
    case FaultKind::kLate:
      faults.late = begins ? Seconds(fault.value) : DurationNs{0};
      return;
    case FaultKind::kCopies:
      faults.copies = begins ? static_cast<std::uint8_t>(fault.value) : std::uint8_t{1};
      return;
    case FaultKind::kWrongDigest:
      faults.wrong_digest = begins;
      return;
    case FaultKind::kMuteDone:
      faults.mute_done = begins;
      return;
    default:
      faults.sensor.reset();
      if (begins) faults.sensor = SensorFault(fault);
  }
}

}  // namespace

const FaultKindInfo& InfoOf(FaultKind kind) {
  const FaultKindInfo& info = kKinds[static_cast<std::size_t>(kind)];
  FOCALFLEET_CHECK(info.kind == kind);
  return info;
}

std::optional<FaultKind> FaultKindNamed(std::string_view name) {
  for (const FaultKindInfo& info : kKinds)
    if (name == info.name) return info.kind;
  return std::nullopt;
}

FaultSchedule::FaultSchedule(std::vector<PlannedFault> plan, HostInstant start, std::uint64_t seed)
    : plan_(std::move(plan)) {
  for (std::uint32_t i = 0; i < plan_.size(); ++i) {
    const PlannedFault& fault = plan_[i];
    const bool per_frame = fault.kind <= FaultKind::kDelay;
    if (!per_frame && Rng::Stream(seed, "planned fault", i).Uniform() >= fault.chance) continue;
    edges_.push_back({start + fault.from, i, true});
    if (fault.to.ns != kNever.ns) edges_.push_back({start + fault.to, i, false});
  }
  std::ranges::stable_sort(edges_, [](const Edge& a, const Edge& b) {
    return a.at != b.at ? a.at < b.at : a.begins < b.begins;
  });
}

void FaultSchedule::Apply(World* world) {
  for (; next() <= world->now(); ++done_) {
    const Edge& edge = edges_[done_];
    const PlannedFault& fault = plan_[edge.fault];
    if (InfoOf(fault.kind).of_unit) {
      ApplyToUnit(fault, edge.begins, world);
    } else {
      ApplyToBus(fault, edge.begins, world);
    }
  }
}

}  // namespace focalfleet::sim
