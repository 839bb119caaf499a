#include "daemon/control_desk.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fleet/files/targets_file.h"
#include "fleet/targets.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr std::uint64_t kHistoryRowsMax = 1000;

Result<PositionerIndex> UnitArgument(const Json& args, const Layout& layout) {
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t id, UnsignedArgument(args, "unit_id"));
  if (id <= std::numeric_limits<std::uint32_t>::max())
    if (const auto i = layout.Find(UnitId{static_cast<std::uint32_t>(id)})) return *i;
  return Fail(ErrorCode::kInvalid, "there is no unit " + std::to_string(id));
}

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

constexpr double kCorrectionsMax = 10;

/// {corrections?, tolerance_um?, observe?}: nothing of it, and the camera is left alone.
Result<std::optional<ApplyCommand::Measure>> MeasureOf(const Json& args) {
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

AxisAngles CountOf(const FleetView& view, PositionerIndex i, const Pose& place) {
  const Pose& offset = view.coordinator->unit(i).offset;
  return AnglesOf(view.layout->unit(i), view.coordinator->drives()[i.value],
                  {place[0] - offset[0], place[1] - offset[1]});
}

/// How much more than its count a unit's place will be at its target, by the model in force.
/// A measured configuration ends each way with the piece `last_deg`.
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
  FOCALFLEET_TRY_ASSIGN(const std::string csv, TextArgument(args, "targets_csv"));
  FOCALFLEET_TRY_ASSIGN(const bool fixed, FlagArgumentOr(args, "fixed", false));
  // First, because it is the answer that the operator needs whatever is in the file.
  if (view.coordinator->busy())
    return Fail(ErrorCode::kRefused, "configuration " +
                                         std::to_string(view.coordinator->configuration().id) +
                                         " is under way: stop it or wait until it ends");
  FOCALFLEET_TRY_ASSIGN(const Targets targets, ReadTargets(csv, source));
  std::vector<UnitKnowledge> now;
  now.reserve(view.layout->size());
  for (std::uint32_t n = 0; n < view.layout->size(); ++n)
    now.push_back(view.coordinator->unit({n}).knowledge);
  FOCALFLEET_TRY_ASSIGN(const auto measure, MeasureOf(args));
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

/// Where it will stand, for choosing a side of its neighbours' elbows.
UnitKnowledge GoesTo(const UnitView& unit) {
  const bool goes = unit.target && (unit.outcome == TargetOutcome::kPending ||
                                    unit.outcome == TargetOutcome::kArrived);
  return goes ? Exactly(Witness::kReported, *unit.target) : unit.knowledge;
}

Result<RetargetCommand> RetargetOf(const Json& args, const FleetView& view) {
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(args, *view.layout));
  TargetRow row{.unit = view.layout->unit(i).id, .place = {}, .target_id = {}};
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
  std::vector<UnitKnowledge> now;
  now.reserve(view.layout->size());
  for (std::uint32_t n = 0; n < view.layout->size(); ++n)
    now.push_back(i.value == n ? view.coordinator->KnowledgeAt(i, view.now)
                               : GoesTo(view.coordinator->unit({n})));
  const auto poses = ResolveTargets({.source = "retarget", .rows = {row}}, *view.layout,
                                    view.coordinator->drives(), now);
  if (!poses) {
    // There is no file whose line would have to be named.
    const std::string& text = poses.error().text;
    return Fail(poses.error().code, text.substr(text.find(": ") + 2));
  }
  return RetargetCommand{i, *(*poses)[i.value]};
}

/// Units whose place is not known and that can be homed now.
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
  FOCALFLEET_TRY_ASSIGN(auto units, FindUnits(*view.layout, ids));
  return HomeCommand{std::move(units), unproven};
}

Result<StopCommand> StopOf(const Json& args, const FleetView& view) {
  if (!args.contains("unit_id")) return StopCommand{};
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(args, *view.layout));
  return StopCommand{i};
}

Result<EnableCommand> EnableOf(const Json& args, const FleetView& view, bool enabled) {
  FOCALFLEET_TRY_ASSIGN(const auto ids, UnsignedListArgument(args, "unit_ids"));
  FOCALFLEET_TRY_ASSIGN(auto units, FindUnits(*view.layout, ids));
  EnableCommand command{.units = std::move(units), .enabled = enabled, .reason = {}};
  if (enabled) return command;
  FOCALFLEET_TRY_ASSIGN(command.reason, TextArgument(args, "reason"));
  if (command.reason.empty())
    return Fail(ErrorCode::kInvalid, "say why: whoever finds the unit disabled will ask");
  return command;
}

/// As docs/protocol.md has them; the unit says the last word, on its own state too.
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

/// The newest value of each axis and parameter; `history` is newest first.
Json NewestOf(const std::vector<ParameterHistory>& history) {
  std::vector<ParameterHistory> newest;
  for (const ParameterHistory& entry : history) {
    const bool known = std::ranges::any_of(newest, [&](const ParameterHistory& other) {
      return other.row.axis == entry.row.axis && other.row.parameter == entry.row.parameter;
    });
    if (!known) newest.push_back(entry);
  }
  return HistoryJson(newest);
}

/// The newest of each axis; `history` is newest first.
Json NewestOf(const std::vector<TuningHistory>& history) {
  std::vector<TuningHistory> newest;
  for (const TuningHistory& entry : history)
    if (std::ranges::none_of(
            newest, [&](const TuningHistory& other) { return other.row.axis == entry.row.axis; }))
      newest.push_back(entry);
  return HistoryJson(newest);
}

bool HasMoved(const ConfigurationView& configuration) {
  return configuration.started != kNever || configuration.makespan_s > 0;
}

/// What all units count that rest.
void NoteRests(const FleetView& view, Compensation* compensation) {
  if (compensation == nullptr) return;
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) NoteRest(view, {n}, compensation);
}

}  // namespace

void NoteRest(const FleetView& view, PositionerIndex i, Compensation* compensation) {
  const UnitView& unit = view.coordinator->unit(i);
  if (unit.phase != UnitPhase::kReady || !IsPlace(unit.knowledge)) return;
  compensation->Rests(i, CountOf(view, i, PlaceOf(unit.knowledge)));
}

Result<std::vector<PositionerIndex>> FindUnits(const Layout& layout,
                                               const std::vector<std::uint32_t>& ids) {
  if (ids.empty()) return Fail(ErrorCode::kInvalid, "no unit named");
  std::vector<PositionerIndex> units;
  units.reserve(ids.size());
  for (const std::uint32_t id : ids) {
    const auto i = layout.Find(UnitId{id});
    if (!i) return Fail(ErrorCode::kInvalid, "there is no unit " + std::to_string(id));
    units.push_back(*i);
  }
  return units;
}

Result<Command> CommandOf(const ControlRequest& request, const FleetView& view) {
  const std::string& verb = request.verb;
  const Json& args = request.args;
  if (verb == "apply") return Wrapped(ApplyOf(args, view));
  if (verb == "retarget") return Wrapped(RetargetOf(args, view));
  if (verb == "stop") return Wrapped(StopOf(args, view));
  if (verb == "home") return Wrapped(HomeOf(args, view));
  if (verb == "disable") return Wrapped(EnableOf(args, view, false));
  if (verb == "enable") return Wrapped(EnableOf(args, view, true));
  if (verb == "adopt") {
    FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(args, *view.layout));
    return Wrapped(Result<AdoptCommand>(AdoptCommand{i}));
  }
  if (verb == "params_set") return Wrapped(WriteOf(args, view));
  return Fail(ErrorCode::kInvalid, "there is no verb '" + verb + "'");
}

void ControlDesk::Service(const FleetView& view, std::vector<Command>* commands) {
  lines_.clear();
  server_.Service(&lines_);
  for (const IncomingLine& line : lines_) Handle(view, line, commands);
}

void ControlDesk::Handle(const FleetView& view, const IncomingLine& line,
                         std::vector<Command>* commands) {
  const auto request = DecodeRequest(line.text);
  Pending pending{.client = line.client, .id = request ? request->id : 0};
  if (!request) return Answer(pending, tl::unexpected<Error>(request.error()));
  if (request->verb == "state") {
    // Spliced in as text; the frame around it is the one that EncodeResult makes.
    std::string answer = EncodeResult(request->id, nullptr);
    const std::size_t place = answer.find("null");
    answer.replace(place, 4, StateText(view));
    server_.Answer(line.client, answer);
    return;
  }
  if (const auto answer = Ask(view, *request)) return Answer(pending, *answer);
  pending.pursues = request->verb == "apply" || request->verb == "home";
  pending.retargets = request->verb == "retarget";
  const auto wait = FlagArgumentOr(request->args, "wait", false);
  if (!wait) return Answer(pending, tl::unexpected<Error>(wait.error()));
  pending.wait = *wait && pending.pursues;
  auto change = ChangeModel(view, *request);
  auto command = change ? std::move(*change) : CommandOf(*request, view);
  if (!command) {
    options_.log(request->verb + " refused: " + command.error().text);
    return Answer(pending, tl::unexpected<Error>(command.error()));
  }
  options_.log(request->verb + " commanded");
  command->request = next_request_++;
  pending_.emplace(command->request, pending);
  waiting_ += pending.wait ? 1u : 0u;
  commands->push_back(std::move(*command));
}

std::optional<Result<Json>> ControlDesk::Ask(const FleetView& view, const ControlRequest& request) {
  if (request.verb == "status") return Result<Json>(StatusJson(view, options_.facts()));
  if (request.verb == "unit") return AskUnit(view, request);
  if (request.verb == "params") return AskParameters(view, request);
  if (request.verb == "history") return AskHistory(view, request);
  if (request.verb == "measurements") return AskMeasurements(view, request);
  if (request.verb == "model") return Result<Json>(models_.Show(kHistoryRowsMax));
  return std::nullopt;
}

Result<Json> ControlDesk::AskUnit(const FleetView& view, const ControlRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(request.args, *view.layout));
  return UnitJson(view, i);
}

Result<Json> ControlDesk::AskParameters(const FleetView& view, const ControlRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(request.args, *view.layout));
  const UnitView& unit = view.coordinator->unit(i);
  const SerialNumber serial = unit.bound_serial.value != 0 ? unit.bound_serial : unit.serial;
  FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
  FOCALFLEET_TRY_ASSIGN(const auto history, reader->Parameters(serial, kHistoryRowsMax));
  FOCALFLEET_TRY_ASSIGN(const auto tunings, reader->Tunings(serial, kHistoryRowsMax));
  const Json known = UnitJson(view, i);
  Json drive = {{"mode", known["mode"]}, {"v_bus_V", known["v_bus_V"]}};
  for (const char* axis : {"theta", "phi"})
    for (const char* name : {"counter1", "repeat", "subdivision"})
      drive[std::string(axis) + "_" + name] = known[axis][name];
  return Json{{"unit_id", view.layout->unit(i).id.value},
              {"serial", serial.value},
              {"drive", std::move(drive)},  // what holds now, whether stored or by default
              {"parameters", NewestOf(history)},
              {"tuning", NewestOf(tunings)},
              {"tuning_history", HistoryJson(tunings)},
              {"history", HistoryJson(history)}};
}

Result<Json> ControlDesk::AskHistory(const FleetView& view, const ControlRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t asked, UnsignedArgumentOr(request.args, "limit", 20));
  const auto limit = static_cast<std::uint32_t>(std::min(asked, kHistoryRowsMax));
  FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
  if (!request.args.contains("unit_id")) {
    FOCALFLEET_TRY_ASSIGN(const auto configurations, reader->Configurations(limit));
    FOCALFLEET_TRY_ASSIGN(const auto alarms, reader->Alarms(limit));
    return Json{{"configurations", HistoryJson(configurations)}, {"alarms", HistoryJson(alarms)}};
  }
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(request.args, *view.layout));
  const UnitId id = view.layout->unit(i).id;
  FOCALFLEET_TRY_ASSIGN(const auto moves, reader->Moves(id, limit));
  FOCALFLEET_TRY_ASSIGN(const auto places, reader->Units(id, limit));
  return Json{{"moves", HistoryJson(moves)}, {"unit", HistoryJson(places)}};
}

/// {exposure?}: the newest of the last configuration without it.
Result<Json> ControlDesk::AskMeasurements(const FleetView& view, const ControlRequest& request) {
  FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
  FOCALFLEET_TRY_ASSIGN(std::uint64_t exposure, UnsignedArgumentOr(request.args, "exposure", 0));
  if (exposure == 0) {
    FOCALFLEET_TRY_ASSIGN(const auto last,
                          reader->LastExposure(view.coordinator->configuration().id));
    if (!last) return Fail(ErrorCode::kRefused, "the last configuration was not measured");
    exposure = *last;
  }
  FOCALFLEET_TRY_ASSIGN(const auto rows, reader->Measurements(exposure));
  if (rows.empty())
    return Fail(ErrorCode::kRefused, "there is no exposure " + std::to_string(exposure));
  return Json{{"exposure", exposure}, {"measurements", HistoryJson(rows)}};
}

std::optional<Result<Command>> ControlDesk::ChangeModel(const FleetView& view,
                                                        const ControlRequest& request) {
  const auto change = [&]() -> Result<ModelRow> {
    if (request.verb == "model_unload") return models_.Unload();
    if (request.verb == "model_rollback")
      return models_.Rollback([this](const std::string& sha256) -> Result<std::string> {
        FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
        return reader->ModelText(sha256);
      });
    FOCALFLEET_TRY_ASSIGN(const std::string text, TextArgument(request.args, "model_toml"));
    FOCALFLEET_TRY_ASSIGN(const std::string source,
                          TextArgumentOr(request.args, "source", "model.toml"));
    return models_.Load(text, source);
  };
  if (request.verb != "model_load" && request.verb != "model_unload" &&
      request.verb != "model_rollback")
    return std::nullopt;
  auto row = change();
  if (!row) return Result<Command>(tl::unexpected<Error>(std::move(row).error()));
  if (auto known = ForgetHomed(); !known) options_.log("model: " + known.error().text);
  NoteRests(view, models_.compensation());
  return Wrapped(Result<KeepModelCommand>(KeepModelCommand{std::move(*row)}));
}

Status ControlDesk::RestoreModel() {
  FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
  FOCALFLEET_TRY_ASSIGN(auto changes, reader->Models(kHistoryRowsMax));
  if (changes.empty()) return {};
  std::string text;
  if (!changes.front().row.sha256.empty()) {
    FOCALFLEET_TRY_ASSIGN(text, reader->ModelText(changes.front().row.sha256));
  }
  FOCALFLEET_TRY(models_.Restore(std::move(changes), text));
  return ForgetHomed();
}

/// Units that were homed since the model came count anew.
Status ControlDesk::ForgetHomed() {
  if (models_.compensation() == nullptr) return {};
  FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
  FOCALFLEET_TRY_ASSIGN(const auto homed, reader->HomedSince(models_.since()));
  for (const UnitId id : homed)
    if (const auto i = options_.layout->Find(id)) models_.compensation()->Forget(*i);
  return {};
}

Result<StoreReader*> ControlDesk::Reader() {
  if (reader_ == nullptr) {
    FOCALFLEET_TRY_ASSIGN(reader_, StoreReader::Open(options_.store_path));
  }
  return reader_.get();
}

void ControlDesk::Answer(const Pending& pending, const Result<Json>& result) {
  server_.Answer(pending.client, result ? EncodeResult(pending.id, *result)
                                        : EncodeError(pending.id, result.error()));
}

void ControlDesk::Reply(const FleetView& view, const ReplyEffect& reply) {
  const auto it = pending_.find(reply.request);
  if (it == pending_.end()) return;
  const Pending pending = it->second;
  // The first word on a configuration is that it began; who waits wants the last.
  it->second.began = true;
  if (!reply.last && (pending.wait || pending.retargets)) return;
  pending_.erase(it);
  waiting_ -= pending.wait ? 1u : 0u;
  if (reply.error) {
    options_.log("refused or failed: " + reply.error->text);
    if (pending.retargets && pending.began)
      return Answer(pending, Json{{"goes", false}, {"text", reply.error->text}});
    // An error means that nothing happened. What failed on the way is a summary with a reason.
    if (!pending.began || !HasMoved(view.coordinator->configuration()))
      return Answer(pending, tl::unexpected<Error>(*reply.error));
    Json summary = ConfigurationJson(view);
    summary["error"] = reply.error->text;
    return Answer(pending, summary);
  }
  if (pending.retargets) return Answer(pending, Json{{"goes", true}, {"text", reply.text}});
  if (!pending.pursues) return Answer(pending, Json{{"text", reply.text}});
  if (!pending.wait)
    return Answer(pending, Json{{"configuration", view.coordinator->configuration().id}});
  Answer(pending, ConfigurationJson(view));
}

void ControlDesk::ShowProgress(const FleetView& view) {
  if (waiting_ == 0 || view.now < progress_at_) return;
  progress_at_ = view.now + options_.progress_period;
  const Json progress = ProgressJson(view);
  for (const auto& [request, pending] : pending_)
    if (pending.wait) server_.Progress(pending.client, EncodeProgress(pending.id, progress));
}

void ControlDesk::Close() {
  for (const auto& [request, pending] : pending_)
    Answer(pending,
           Fail(ErrorCode::kUnavailable,
                "the daemon ends; what moves goes on by itself and is read at the next start"));
  pending_.clear();
  waiting_ = 0;
}

}  // namespace focalfleet
