#include "daemon/simulator/verbs.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <string>

#include "daemon/simulator/truth_report.h"
#include "fleet/files/targets_file.h"
#include "protocol/base/limits.h"

namespace focalfleet::simulator {
namespace {

constexpr double kRequestSecondsMax = 86'400;
constexpr std::uint64_t kCopiesMax = 100;

Result<double> SecondsOr(const Json& args, const char* name, double otherwise) {
  const auto found = args.find(name);
  if (found == args.end()) return otherwise;
  if (!found->is_number() || !(found->get<double>() >= 0) ||
      found->get<double>() > kRequestSecondsMax)
    return Fail(ErrorCode::kInvalid, std::string(name) + " is not a number of 0..86400 seconds");
  return found->get<double>();
}

std::optional<FaultCode> FaultNamed(const std::string& name) {
  for (std::uint8_t i = 1; i < kFaultCodeCount; ++i)
    if (name == Name(static_cast<FaultCode>(i))) return static_cast<FaultCode>(i);
  return std::nullopt;
}

}  // namespace

Result<Json> Verbs::Do(const ControlRequest& request) {
  if (request.verb == "truth") return Truth(request.args);
  if (request.verb == "power_cut") return PowerCut(request.args);
  if (request.verb == "power_on") return PowerOn(request.args);
  if (request.verb == "fault") return RaiseFault(request.args);
  if (request.verb == "silence") return Silence(request.args);
  if (request.verb == "misbehave") return Misbehave(request.args);
  if (request.verb == "camera") return FailCamera(request.args);
  if (request.verb == "kill_bus") return SetBuses(request.args, false);
  if (request.verb == "revive_bus") return SetBuses(request.args, true);
  if (request.verb == "status") return StatusOfAll();
  if (request.verb == "quit") {
    quit_ = true;
    return Json::object();
  }
  return Fail(ErrorCode::kInvalid, "focalfleet-sim has no verb '" + request.verb + "'");
}

Result<std::vector<UnitId>> Verbs::Units(const Json& args) const {
  FOCALFLEET_TRY_ASSIGN(const auto numbers, UnsignedListArgument(args, "units"));
  std::vector<UnitId> units;
  for (const std::uint32_t number : numbers) {
    if (!world_->Find(UnitId{number}))
      return Fail(ErrorCode::kInvalid, "no unit " + std::to_string(number) + " in this fleet");
    units.push_back({number});
  }
  if (units.empty()) return Fail(ErrorCode::kInvalid, "no units are named");
  return units;
}

Result<Json> Verbs::Truth(const Json& args) {
  FOCALFLEET_TRY_ASSIGN(const std::string text,
                        TextArgumentOr(args, "targets_csv", "", limits::kControlLineBytes));
  FOCALFLEET_TRY_ASSIGN(const std::string name, TextArgumentOr(args, "targets_name", "targets"));
  std::uint64_t begun_twice = 0;
  std::uint64_t at_work = 0;
  for (std::size_t row = 0; row < world_->units().size(); ++row) {
    const sim::UnitTruth truth = world_->Truth(row);
    begun_twice += truth.begun_twice;
    if (truth.state == UnitState::kMoving || truth.state == UnitState::kHoming) ++at_work;
  }
  Json result = {{"csv", TruthCsv(*world_)},
                 {"units", world_->units().size()},
                 {"moving", at_work},
                 {"begun_twice", begun_twice}};
  if (text.empty()) return result;
  FOCALFLEET_TRY_ASSIGN(const Targets targets, ReadTargets(text, name));
  FOCALFLEET_TRY_ASSIGN(const TrueErrors errors, CompareWithTargets(*world_, targets));
  result["targets"] = {{"units", errors.units},
                       {"disabled", errors.disabled},
                       {"rms_um", errors.rms_um},
                       {"max_um", errors.max_um},
                       {"worst_unit_id", errors.worst.value}};
  return result;
}

Result<Json> Verbs::PowerCut(const Json& args) {
  FOCALFLEET_TRY_ASSIGN(const auto units, Units(args));
  FOCALFLEET_TRY_ASSIGN(const double seconds, SecondsOr(args, "seconds", -1));
  for (const UnitId unit : units) {
    world_->disturb().PowerCut(unit);
    std::erase_if(power_returns_, [&](const PowerReturn& back) { return back.unit == unit; });
    if (seconds >= 0) power_returns_.push_back({world_->now() + Seconds(seconds), unit});
  }
  return Json{{"units", units.size()}};
}

Result<Json> Verbs::PowerOn(const Json& args) {
  FOCALFLEET_TRY_ASSIGN(const auto units, Units(args));
  for (const UnitId unit : units) {
    std::erase_if(power_returns_, [&](const PowerReturn& back) { return back.unit == unit; });
    world_->disturb().PowerOn(unit);
  }
  return Json{{"units", units.size()}};
}

Result<Json> Verbs::RaiseFault(const Json& args) {
  FOCALFLEET_TRY_ASSIGN(const auto units, Units(args));
  FOCALFLEET_TRY_ASSIGN(const std::string name, TextArgument(args, "code"));
  FOCALFLEET_TRY_ASSIGN(const std::string axis_name, TextArgumentOr(args, "axis", "theta"));
  FOCALFLEET_TRY_ASSIGN(const double after_s, SecondsOr(args, "after_s", -1));
  const auto code = FaultNamed(name);
  if (!code) return Fail(ErrorCode::kInvalid, "no fault is called '" + name + "'");
  if (axis_name != "theta" && axis_name != "phi")
    return Fail(ErrorCode::kInvalid, "no axis is called '" + axis_name + "'");
  const Axis axis = axis_name == "phi" ? Axis::kPhi : Axis::kTheta;
  for (const UnitId unit : units) {
    if (after_s < 0) {
      world_->disturb().RaiseFault(unit, *code, axis);
    } else {
      world_->disturb().faults(unit)->in_motion = {Seconds(after_s), *code, axis};
    }
  }
  return Json{{"units", units.size()}};
}

Result<Json> Verbs::Silence(const Json& args) {
  FOCALFLEET_TRY_ASSIGN(const auto units, Units(args));
  FOCALFLEET_TRY_ASSIGN(const bool off, FlagArgumentOr(args, "off", false));
  for (const UnitId unit : units) world_->disturb().faults(unit)->silent = !off;
  return Json{{"units", units.size()}};
}

Result<Json> Verbs::FailCamera(const Json& args) {
  if (camera_ == nullptr) return Fail(ErrorCode::kRefused, "this simulation has no camera");
  FOCALFLEET_TRY_ASSIGN(const std::string name, TextArgument(args, "fault"));
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t exposures, UnsignedArgumentOr(args, "exposures", 1));
  const auto found = std::ranges::find(kCameraFaultNames, name);
  if (found == std::end(kCameraFaultNames))
    return Fail(ErrorCode::kInvalid, "no fault of a camera is called '" + name + "'");
  camera_->Fail(static_cast<CameraFault>(found - std::begin(kCameraFaultNames)),
                static_cast<std::uint32_t>(std::min<std::uint64_t>(exposures, UINT32_MAX)));
  return Json{{"fault", name}, {"exposures", exposures}};
}

Result<Json> Verbs::Misbehave(const Json& args) {
  FOCALFLEET_TRY_ASSIGN(const auto units, Units(args));
  FOCALFLEET_TRY_ASSIGN(const bool off, FlagArgumentOr(args, "off", false));
  FOCALFLEET_TRY_ASSIGN(const double late_s, SecondsOr(args, "late_s", 0));
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t copies, UnsignedArgumentOr(args, "copies", 1));
  FOCALFLEET_TRY_ASSIGN(const bool deaf, FlagArgumentOr(args, "deaf", false));
  FOCALFLEET_TRY_ASSIGN(const bool wrong_digest, FlagArgumentOr(args, "wrong_digest", false));
  FOCALFLEET_TRY_ASSIGN(const bool mute_done, FlagArgumentOr(args, "mute_done", false));
  const bool foreign = args.contains("foreign_serial");
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t serial, UnsignedArgumentOr(args, "foreign_serial", 0));
  if (copies < 1 || copies > kCopiesMax)
    return Fail(ErrorCode::kInvalid, "copies is not within 1.." + std::to_string(kCopiesMax));
  if (serial > UINT32_MAX) return Fail(ErrorCode::kInvalid, "a serial number has 32 bits");
  if (serial != 0 && units.size() > 1)
    return Fail(ErrorCode::kInvalid,
                "one serial number is one unit's; " + std::to_string(units.size()) + " are named");
  for (const UnitId unit : units) {
    sim::UnitFaults& faults = *world_->disturb().faults(unit);
    if (off) {
      const sim::UnitFaults before = faults;
      faults = {};
      faults.silent = before.silent;  // set by other verbs
      faults.in_motion = before.in_motion;
    }
    if (args.contains("late_s")) faults.late = Seconds(late_s);
    if (args.contains("copies")) faults.copies = static_cast<std::uint8_t>(copies);
    faults.deaf |= deaf;
    faults.wrong_digest |= wrong_digest;
    faults.mute_done |= mute_done;
    if (foreign) faults.foreign_serial = SerialNumber{static_cast<std::uint32_t>(serial)};
  }
  return Json{{"units", units.size()}};
}

Result<Json> Verbs::SetBuses(const Json& args, bool alive) {
  FOCALFLEET_TRY_ASSIGN(const auto numbers, UnsignedListArgument(args, "buses"));
  for (const std::uint32_t number : numbers)
    if (world_->disturb().faults(BusId{number}) == nullptr)
      return Fail(ErrorCode::kInvalid, "no bus " + std::to_string(number) + " in this fleet");
  for (const std::uint32_t number : numbers) {
    if (alive) {
      world_->disturb().ReviveBus(BusId{number});
    } else {
      world_->disturb().KillBus(BusId{number});
    }
  }
  return Json{{"buses", numbers.size()}};
}

Json Verbs::StatusOfAll() const {
  Json buses = Json::array();
  for (const BusId bus : world_->buses()) {
    const sim::BusCounters c = world_->counters(bus);
    buses.push_back({{"bus_id", bus.value},
                     {"dead", world_->dead(bus)},
                     {"host_frames", c.host_frames},
                     {"unit_frames", c.unit_frames},
                     {"bits", c.wire.bits},
                     {"busy_s", c.wire.busy.seconds()},
                     {"dropped", c.mailboxes.dropped},
                     {"host_controller", Name(world_->controller(bus).state)},
                     {"error_frames", c.wire.error_frames()},
                     {"error_bits", c.wire.error_bits},
                     {"repeats", c.repeats},
                     {"received_twice", c.received_twice},
                     {"babbled", c.babbled},
                     {"went_passive", c.controllers.went_passive},
                     {"went_off", c.controllers.went_off},
                     {"recovered", c.controllers.recovered},
                     {"stuck_s", c.wire.stuck.seconds()},
                     {"refused", c.mailboxes.refused},
                     {"waiting_max", c.mailboxes.waiting_max}});
  }
  return {{"units", world_->units().size()}, {"now_ns", world_->now().ns}, {"buses", buses}};
}

void Verbs::Tick(HostInstant now) {
  for (const PowerReturn& back : power_returns_)
    if (back.at <= now) world_->disturb().PowerOn(back.unit);
  std::erase_if(power_returns_, [&](const PowerReturn& back) { return back.at <= now; });
}

HostInstant Verbs::wake_at() const {
  HostInstant soonest = kNever;
  for (const PowerReturn& back : power_returns_) soonest = std::min(soonest, back.at);
  return soonest;
}

}  // namespace focalfleet::simulator
