#include "daemon/verbs/requested_command.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "daemon/campaign/compensation.h"
#include "fleet/files/line_limit.h"
#include "fleet/files/targets_file.h"
#include "fleet/targets.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr double kCorrectionsMax = 10;

Result<Axis> AxisArgument(const Json& args) {
  FOCALFLEET_TRY_ASSIGN(const std::string name, TextArgument(args, "axis"));
  for (const Axis axis : kAxes)
    if (name == Name(axis)) return axis;
  return Fail(ErrorCode::kInvalid, "there is no axis '" + name + "'; they are theta and phi");
}

Result<Parameter> ParameterArgument(const Json& args) {
  FOCALFLEET_TRY_ASSIGN(const std::string name, TextArgument(args, "parameter"));
  for (std::uint8_t p = 0; p < kParameterCount; ++p)
    if (name == Name(static_cast<Parameter>(p))) return static_cast<Parameter>(p);
  return Fail(ErrorCode::kInvalid, "there is no parameter '" + name + "'");
}

/// Offsets by which each unit's place will exceed its count at its target, by the model in force. A
/// measured configuration ends each way with the piece `last_deg`.
std::vector<std::optional<Pose>> OffsetsOf(const FleetView& view,
                                           const std::vector<std::optional<Pose>>& targets,
                                           const std::array<double, kAxisCount>& last_deg) {
  std::vector<std::optional<Pose>> offsets(targets.size());
  for (std::uint32_t n = 0; n < targets.size(); ++n) {
    const UnitView& unit = view.coordinator->unit({n});
    if (!targets[n] || unit.phase != UnitPhase::kReady || !IsPlace(unit.knowledge)) continue;
    offsets[n] = view.compensation->OffsetFor({n},
                                              {.unit = &view.layout->unit({n}),
                                               .drive = &view.coordinator->drives()[n],
                                               .place = PlaceOf(unit.knowledge),
                                               .offset = unit.offset,
                                               .last_deg = last_deg},
                                              *targets[n]);
  }
  return offsets;
}

Result<ApplyCommand> ApplyOf(const Json& args, const FleetView& view) {
  FOCALFLEET_TRY_ASSIGN(const std::string source, TextArgumentOr(args, "source", "targets"));
  FOCALFLEET_TRY_ASSIGN(const std::string csv,
                        TextArgument(args, "targets_csv", limits::kControlLineBytes));
  FOCALFLEET_TRY(CheckLines(csv, source, std::size_t{2} * limits::kUnits));
  FOCALFLEET_TRY_ASSIGN(const bool fixed, FlagArgumentOr(args, "fixed", false));
  // This check comes first: the operator needs this answer whatever the file holds.
  if (view.coordinator->busy())
    return Fail(ErrorCode::kRefused, "configuration " +
                                         std::to_string(view.coordinator->configuration().id) +
                                         " is under way: stop it or wait until it ends");
  FOCALFLEET_TRY_ASSIGN(const Targets targets, ReadTargets(csv, source));
  std::vector<UnitKnowledge> now;
  now.reserve(view.layout->size());
  for (std::uint32_t n = 0; n < view.layout->size(); ++n)
    now.push_back(view.coordinator->unit({n}).knowledge);
  FOCALFLEET_TRY_ASSIGN(const auto measure, MeasureArgument(args));
  ApplyCommand command{.source = source, .targets = {}, .fixed = fixed, .measure = measure};
  FOCALFLEET_TRY_ASSIGN(command.targets,
                        ResolveTargets(targets, *view.layout, view.coordinator->drives(), now));
  command.target_ids.resize(view.layout->size());
  for (const TargetRow& row : targets.rows)
    if (const auto i = view.layout->Find(row.unit)) command.target_ids[i->value] = row.target_id;
  const bool observe = measure && measure->observe;
  if (view.compensation != nullptr && !observe)
    command.offsets = OffsetsOf(
        view, command.targets,
        measure ? view.coordinator->config().approach_deg : std::array<double, kAxisCount>{});
  return command;
}

/// Where the unit will stand; the elbow side of its neighbours is chosen by it.
UnitKnowledge GoesTo(const UnitView& unit) {
  const bool goes = unit.target && (unit.outcome == TargetOutcome::kPending ||
                                    unit.outcome == TargetOutcome::kArrived);
  return goes ? Exactly(Witness::kReported, *unit.target) : unit.knowledge;
}

Result<RetargetCommand> RetargetOf(const Json& args, const FleetView& view) {
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(args, *view.layout));
  std::vector<UnitKnowledge> now;
  now.reserve(view.layout->size());
  for (std::uint32_t n = 0; n < view.layout->size(); ++n)
    now.push_back(i.value == n ? view.coordinator->KnowledgeAt(i, view.now)
                               : GoesTo(view.coordinator->unit({n})));
  FOCALFLEET_TRY_ASSIGN(const Pose pose,
                        TargetArgument(args, i, *view.layout, view.coordinator->drives(), now));
  return RetargetCommand{i, pose};
}

/// The units whose place is not known and that can be homed now.
std::vector<PositionerIndex> NotKnown(const FleetView& view) {
  std::vector<PositionerIndex> units;
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) {
    const UnitView& unit = view.coordinator->unit({n});
    if (unit.enabled && unit.phase == UnitPhase::kReady && !IsPlace(unit.knowledge))
      units.push_back({n});
  }
  return units;
}

Result<HomeCommand> HomeOf(const Json& args, const FleetView& view) {
  FOCALFLEET_TRY_ASSIGN(const bool not_known, FlagArgumentOr(args, "not_known", false));
  FOCALFLEET_TRY_ASSIGN(const bool unproven, FlagArgumentOr(args, "unproven", false));
  if (not_known) {
    HomeCommand command{NotKnown(view), unproven};
    if (command.units.empty())
      return Fail(ErrorCode::kRefused, "every unit that could be homed knows where it stands");
    return command;
  }
  FOCALFLEET_TRY_ASSIGN(const auto ids, UnsignedListArgument(args, "unit_ids"));
  FOCALFLEET_TRY_ASSIGN(auto units, UnitsArgument(*view.layout, ids));
  return HomeCommand{std::move(units), unproven};
}

Result<StopCommand> StopOf(const Json& args, const FleetView& view) {
  if (!args.contains("unit_id")) return StopCommand{};
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(args, *view.layout));
  return StopCommand{i};
}

Result<EnableCommand> EnableOf(const Json& args, const FleetView& view, bool enabled) {
  FOCALFLEET_TRY_ASSIGN(const auto ids, UnsignedListArgument(args, "unit_ids"));
  FOCALFLEET_TRY_ASSIGN(auto units, UnitsArgument(*view.layout, ids));
  EnableCommand command{.units = std::move(units), .enabled = enabled, .reason = {}};
  if (enabled) return command;
  FOCALFLEET_TRY_ASSIGN(command.reason, TextArgument(args, "reason"));
  if (command.reason.empty())
    return Fail(ErrorCode::kInvalid, "say why: whoever finds the unit disabled will ask");
  return command;
}

/// Ranges as in docs/protocol.md. The unit may still refuse a value within them, by its own state.
struct ParameterRange {
  std::int64_t low;
  std::int64_t high;
  std::int64_t step = 1;
};
ParameterRange RangeOf(Parameter parameter) {
  switch (parameter) {
    case Parameter::kCounter1:
      return {50, 20'000};
    case Parameter::kRepeat:
      return {1, 255};
    case Parameter::kSubdivision:
      return {6, 1536, 6};
    case Parameter::kMode:
      return {0, 2};
    case Parameter::kHostTimeoutMs:
      return {100, 3'600'000};
    case Parameter::kPosition:
    case Parameter::kMinPosition:
    case Parameter::kMaxPosition:
    case Parameter::kHomePosition:
      break;
  }
  return {-limits::kPositionMax, limits::kPositionMax};
}

Result<WriteParameterCommand> WriteOf(const Json& args, const FleetView& view) {
  WriteParameterCommand command;
  FOCALFLEET_TRY_ASSIGN(command.unit, UnitArgument(args, *view.layout));
  FOCALFLEET_TRY_ASSIGN(command.axis, AxisArgument(args));
  FOCALFLEET_TRY_ASSIGN(command.parameter, ParameterArgument(args));
  FOCALFLEET_TRY_ASSIGN(const std::int64_t value, IntegerArgument(args, "value"));
  const ParameterRange range = RangeOf(command.parameter);
  if (value < range.low || value > range.high || value % range.step != 0)
    return Fail(ErrorCode::kInvalid,
                std::string(Name(command.parameter)) + " must be " + std::to_string(range.low) +
                    ".." + std::to_string(range.high) +
                    (range.step > 1 ? " in steps of " + std::to_string(range.step) : "") +
                    ", not " + std::to_string(value));
  command.value = static_cast<std::int32_t>(value);
  return command;
}

template <class T>
Result<Command> Wrapped(Result<T> what) {
  if (!what) return tl::unexpected<Error>(std::move(what).error());
  Command command;
  command.what = std::move(*what);
  return command;
}

}  // namespace

Result<PositionerIndex> UnitArgument(const Json& args, const Layout& layout) {
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t id, UnsignedArgument(args, "unit_id"));
  if (id <= std::numeric_limits<std::uint32_t>::max())
    if (const auto i = layout.Find(UnitId{static_cast<std::uint32_t>(id)})) return *i;
  return Fail(ErrorCode::kInvalid, "there is no unit " + std::to_string(id));
}

Result<std::vector<PositionerIndex>> UnitsArgument(const Layout& layout,
                                                   const std::vector<std::uint32_t>& ids) {
  if (ids.empty()) return Fail(ErrorCode::kInvalid, "no unit named");
  if (ids.size() > layout.size())
    return Fail(ErrorCode::kInvalid, std::to_string(ids.size()) +
                                         " units are named, and there are " +
                                         std::to_string(layout.size()));
  std::vector<PositionerIndex> units;
  units.reserve(ids.size());
  std::vector<std::uint8_t> named(layout.size(), 0);
  for (const std::uint32_t id : ids) {
    const auto i = layout.Find(UnitId{id});
    if (!i) return Fail(ErrorCode::kInvalid, "there is no unit " + std::to_string(id));
    if (std::exchange(named[i->value], std::uint8_t{1}) == 0) units.push_back(*i);
  }
  return units;
}

Result<std::optional<ApplyCommand::Measure>> MeasureArgument(const Json& args) {
  if (!args.contains("corrections")) return std::optional<ApplyCommand::Measure>();
  ApplyCommand::Measure measure;
  FOCALFLEET_TRY_ASSIGN(const double corrections, NumberArgument(args, "corrections"));
  if (!(corrections >= 0 && corrections <= kCorrectionsMax) ||
      corrections != std::floor(corrections))
    return Fail(ErrorCode::kInvalid, "corrections must be a whole number in 0..10");
  measure.corrections = static_cast<std::uint8_t>(corrections);
  if (args.contains("tolerance_um")) {
    FOCALFLEET_TRY_ASSIGN(measure.tolerance_um, NumberArgument(args, "tolerance_um"));
    if (!(measure.tolerance_um > 0 && measure.tolerance_um <= 1e6))
      return Fail(ErrorCode::kInvalid, "tolerance_um must be above 0 and at most 1e6");
  }
  FOCALFLEET_TRY_ASSIGN(measure.observe, FlagArgumentOr(args, "observe", false));
  if (measure.observe && measure.corrections > 0)
    return Fail(ErrorCode::kInvalid, "observe takes no corrections: what is seen is not used");
  return std::optional(measure);
}

Result<Pose> TargetArgument(const Json& args, PositionerIndex i, const Layout& layout,
                            std::span<const UnitDrive> drives,
                            std::span<const UnitKnowledge> places) {
  TargetRow row{.unit = layout.unit(i).id, .place = {}, .target_id = {}};
  if (args.contains("theta_deg") || args.contains("phi_deg")) {
    TargetAngles angles;
    FOCALFLEET_TRY_ASSIGN(angles.theta_deg, NumberArgument(args, "theta_deg"));
    FOCALFLEET_TRY_ASSIGN(angles.phi_deg, NumberArgument(args, "phi_deg"));
    row.place = angles;
  } else {
    PointFp place;
    FOCALFLEET_TRY_ASSIGN(place.x_mm, NumberArgument(args, "x_mm"));
    FOCALFLEET_TRY_ASSIGN(place.y_mm, NumberArgument(args, "y_mm"));
    row.place = place;
  }
  const auto poses = ResolveTargets({.source = "retarget", .rows = {row}}, layout, drives, places);
  if (poses) return *(*poses)[i.value];
  // The error begins with file and line, and a retarget has no file.
  const std::string& text = poses.error().text;
  return Fail(poses.error().code, text.substr(text.find(": ") + 2));
}

Result<Command> CommandOf(const ControlRequest& request, const FleetView& view) {
  const std::string& verb = request.verb;
  const Json& args = request.args;
  if (verb == "apply") return Wrapped(ApplyOf(args, view));
  if (verb == "retarget") return Wrapped(RetargetOf(args, view));
  if (verb == "stop") return Wrapped(StopOf(args, view));
  if (verb == "home") return Wrapped(HomeOf(args, view));
  if (verb == "measure") return Wrapped(Result<MeasureCommand>(MeasureCommand{}));
  if (verb == "disable") return Wrapped(EnableOf(args, view, false));
  if (verb == "enable") return Wrapped(EnableOf(args, view, true));
  if (verb == "adopt") {
    FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(args, *view.layout));
    return Wrapped(Result<AdoptCommand>(AdoptCommand{i}));
  }
  if (verb == "params_set") return Wrapped(WriteOf(args, view));
  return Fail(ErrorCode::kInvalid, "there is no verb '" + verb + "'");
}

}  // namespace focalfleet
