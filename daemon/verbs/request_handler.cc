#include "daemon/verbs/request_handler.h"

#include <algorithm>
#include <utility>

#include "daemon/access/rights.h"
#include "daemon/control/asker.h"
#include "daemon/status/history_json.h"
#include "daemon/status/status_json.h"
#include "daemon/verbs/alarm_requests.h"
#include "daemon/verbs/audit_requests.h"
#include "daemon/verbs/history_requests.h"
#include "daemon/verbs/model_upkeep.h"
#include "daemon/verbs/preview_json.h"
#include "daemon/verbs/replay_request.h"
#include "daemon/verbs/requested_command.h"
#include "daemon/verbs/unit_selection.h"
#include "fleet/files/bad_rows.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr double kWaitMaxS = 1e6;

/// The numbers of the units that the request chooses.
Result<Json> AskSelection(const ControlRequest& request, const FleetView& view) {
  FOCALFLEET_TRY_ASSIGN(const auto units, SelectUnits(request.args, view));
  Json ids = Json::array();
  for (const PositionerIndex i : units) ids.push_back(view.layout->unit(i).id.value);
  return Json{{"unit_ids", std::move(ids)}};
}

Result<Json> AskUnit(const FleetView& view, const ControlRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(request.args, *view.layout));
  return UnitJson(view, i);
}

/// Open alarms are known here, also where the store cannot be read.
std::optional<Result<Json>> AskOpenAlarms(const FleetView& view, const ControlRequest& request,
                                          const AlarmRegister& alarms) {
  const auto all = FlagArgumentOr(request.args, "all", false);
  if (all && *all) return std::nullopt;  // AskStore
  const auto reading = AskAlarms(request, alarms, view.at);
  if (!reading) return Result<Json>(tl::unexpected<Error>(reading.error()));
  return (*reading)(nullptr);
}

/// The question to the store that the request asks; none: the verb asks nothing of it.
std::optional<Result<StoreReading>> AskStore(const FleetView& view, const ControlRequest& request,
                                             const AlarmRegister& alarms) {
  if (request.verb == "params") return AskParameters(request, view);
  if (request.verb == "audit") return AskAudit(request);
  if (request.verb == "audit_check") return AskAuditCheck(request);
  if (request.verb == "history") return AskHistory(request, view);
  if (request.verb == "events") return AskEvents(request, view);
  if (request.verb == "alarms") return AskAlarms(request, alarms, view.at);
  if (request.verb == "measurements") return AskMeasurements(request, view);
  if (request.verb == "replay") return AskReplay(request, view);
  return std::nullopt;
}

bool HasMoved(const ConfigurationView& configuration) {
  return configuration.started != kNever || configuration.makespan_s > 0;
}

// A sentence on the command, beside the coordinator's own answer.
std::string NoteOn(const FleetView& view, const Command& command, const ModelRegistry& models) {
  const auto* adopt = std::get_if<AdoptCommand>(&command.what);
  if (adopt == nullptr || view.compensation == nullptr || !view.compensation->Knows(adopt->unit))
    return "";
  return "; the model in force (" + models.name() +
         ") was measured on the robot before it, so its commands go without one";
}

// The answer may take minutes: progress shows the client that the daemon lives.
bool GetsProgress(const auto& pending) { return pending.wait || pending.is_retarget; }

}  // namespace

void RequestHandler::Service(const FleetView& view, std::vector<Command>* commands) {
  stops_.clear();
  server_->Service(&stops_);
  for (const IncomingLine& line : stops_) Handle(view, line, commands);
  // A flood of stops must not keep other clients out, so every second turn is for all.
  stopped_ = !stops_.empty() && !stopped_;
  if (stopped_) return;
  spent_bytes_ = 0;
  while (spent_bytes_ < kTurnBytes) {
    const auto line = server_->Next();
    if (!line) return;
    spent_bytes_ += kLineBytes + line->text.size();
    Handle(view, *line, commands);
  }
}

bool RequestHandler::IsStop(std::string_view line) {
  constexpr std::size_t kBytesMax = 512;
  if (line.size() > kBytesMax || line.find("\"stop\"") == std::string_view::npos) return false;
  const auto request = DecodeRequest(line);
  return request && request->verb == "stop";
}

void RequestHandler::Handle(const FleetView& view, const IncomingLine& line,
                            std::vector<Command>* commands) {
  const auto request = DecodeRequest(line.text);
  Pending pending{.client = line.client, .id = request ? request->id : 0};
  if (!request) return Answer(pending, tl::unexpected<Error>(request.error()));
  if (line.reserved && request->verb != "stop")
    return Answer(pending,
                  Fail(ErrorCode::kFull, "too many clients, only stop is taken: all " +
                                             std::to_string(limits::kControlClients) +
                                             " places have requests open, try again later"));
  const Result<Caller> asker = AskerOf(*request, line, options_.own_pid);
  if (!asker) {
    NoteRefusal(view, line, {*request, line.caller}, asker.error());
    return Answer(pending, tl::unexpected<Error>(asker.error()));
  }
  Do(view, line, {*request, *asker}, commands);
}

void RequestHandler::NoteRefusal(const FleetView& view, const IncomingLine& line,
                                 const Asked& asked, const Error& why) {
  const std::string text =
      refusals_.Admit({view.now.ns}, asked.request.verb + " refused: " + why.text);
  if (!text.empty()) options_.log(text);
  if (options_.audit != nullptr)
    options_.audit->Refused(view.at, asked.caller, asked.request.verb, line.text, why);
}

void RequestHandler::Do(const FleetView& view, const IncomingLine& line, const Asked& asked,
                        std::vector<Command>* commands) {
  const ControlRequest* const request = &asked.request;
  Pending pending{.client = line.client, .id = request->id};
  if (const Status permitted = CheckRight(asked.caller, request->verb, request->args); !permitted) {
    if (permitted.error().code == ErrorCode::kRefused)
      NoteRefusal(view, line, asked, permitted.error());
    else
      options_.log(request->verb + " refused: " + FirstRow(permitted.error().text));
    return Answer(pending, tl::unexpected<Error>(permitted.error()));
  }
  if (request->verb == "access") return Answer(pending, AccessJson(asked.caller));
  if (request->verb == "state") {
    if (const Status waits = states_.Add(line.client, request->id); !waits)
      Answer(pending, tl::unexpected<Error>(waits.error()));
    return;
  }
  if (const auto answer = Ask(view, *request)) return Answer(pending, *answer);
  if (auto reading = AskStore(view, *request, *options_.alarms))
    return Queue(pending, std::move(*reading));
  if (request->verb == "wait") return Wait(view, *request, pending);
  if (request->verb == "preview") {
    const Status planned = Plan(view, *request, pending);
    if (!planned) Answer(pending, tl::unexpected<Error>(planned.error()));
    return;
  }
  pending.is_configuration =
      request->verb == "apply" || request->verb == "home" || request->verb == "measure";
  pending.is_retarget = request->verb == "retarget";
  if (line.overtaken && (pending.is_configuration || pending.is_retarget))
    return Answer(pending, Fail(ErrorCode::kRefused,
                                "a stop that came before " + request->verb +
                                    " was begun went ahead of it; command it again if it is still "
                                    "wanted"));
  const Status room = request->verb == "stop" ? Status() : options_.room_for_rows();
  if (!room) {
    NoteRefusal(view, line, asked, room.error());
    return Answer(pending, tl::unexpected<Error>(room.error()));
  }
  const auto wait = FlagArgumentOr(request->args, "wait", false);
  if (!wait) return Answer(pending, tl::unexpected<Error>(wait.error()));
  pending.wait = *wait && pending.is_configuration;
  auto change = ChangeModel(view, *request);
  if (!change) change = ChangeAlarms(*request, options_.alarms, NameOf(asked.caller), view.at);
  auto command = change ? std::move(*change) : CommandOf(*request, view);
  if (!command) {
    options_.log(request->verb + " refused: " + FirstRow(command.error().text));
    if (options_.audit != nullptr)
      options_.audit->Refused(view.at, asked.caller, request->verb, line.text, command.error());
    return Answer(pending, tl::unexpected<Error>(command.error()));
  }
  options_.log(request->verb + " commanded by " + Describe(asked.caller));
  pending.note = NoteOn(view, *command, *options_.models);
  command->request = next_request_++;
  if (options_.audit != nullptr)
    options_.audit->Commanded(command->request, asked.caller, request->verb, line.text);
  pending_.emplace(command->request, pending);
  waiting_ += GetsProgress(pending) ? 1u : 0u;
  commands->push_back(std::move(*command));
}

std::optional<Result<Json>> RequestHandler::Ask(const FleetView& view,
                                                const ControlRequest& request) {
  if (request.verb == "status") return Result<Json>(StatusJson(view, options_.facts()));
  if (request.verb == "unit") return AskUnit(view, request);
  if (request.verb == "alarms") return AskOpenAlarms(view, request, *options_.alarms);
  if (request.verb == "select") return AskSelection(request, view);
  if (request.verb == "model")
    return Result<Json>(options_.models->Show(ModelRegistry::kChangesMax));
  return std::nullopt;
}

/// The question waits for the reader's thread.
void RequestHandler::Queue(const Pending& pending, Result<StoreReading> reading) {
  if (!reading) return Answer(pending, tl::unexpected<Error>(std::move(reading).error()));
  if (asked_.size() >= limits::kControlClients)  // each client has one, and most wait for it
    return Answer(pending, Fail(ErrorCode::kFull, std::to_string(asked_.size()) +
                                                      " questions wait for the store; ask again "
                                                      "when they are answered"));
  const std::uint64_t number = next_request_++;
  asked_.emplace(number, pending);
  questions_.push_back({number, pending.id, std::move(*reading)});
}

void RequestHandler::SubmitQuestions(const std::function<bool(StoreQuestion*)>& submit) {
  while (!questions_.empty() && submit(&questions_.front())) questions_.pop_front();
}

void RequestHandler::Answered(const StoreAnswer& answer) {
  const auto it = asked_.find(answer.number);
  if (it == asked_.end()) return;
  Send(it->second.client, answer.line);
  asked_.erase(it);
}

std::optional<Result<Command>> RequestHandler::ChangeModel(const FleetView& view,
                                                           const ControlRequest& request) {
  ModelRegistry& models = *options_.models;
  const auto change = [&]() -> Result<ModelRow> {
    if (request.verb == "model_unload") return models.Unload();
    if (request.verb == "model_rollback")
      return models.Rollback([this](const std::string& sha256) -> Result<std::string> {
        FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
        return reader->ModelText(sha256);
      });
    FOCALFLEET_TRY_ASSIGN(const std::string text,
                          TextArgument(request.args, "model_toml", limits::kModelLineBytes));
    FOCALFLEET_TRY_ASSIGN(const std::string source,
                          TextArgumentOr(request.args, "source", "model.toml"));
    return models.Load(text, source);
  };
  if (request.verb != "model_load" && request.verb != "model_unload" &&
      request.verb != "model_rollback")
    return std::nullopt;
  // A change gets the number after those that the store has.
  const auto know_changes = [&]() -> Status {
    if (models.changes_known()) return {};
    FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
    return TakeModelChanges(reader, &models);
  };
  const auto forget_strangers = [&]() -> Status {
    if (models.compensation() == nullptr) return {};
    FOCALFLEET_TRY_ASSIGN(StoreReader* const reader, Reader());
    return ForgetStrangers(reader, &models);
  };
  const Status known = know_changes();
  auto row = known ? change() : Result<ModelRow>(tl::unexpected<Error>(known.error()));
  if (!row) return Result<Command>(tl::unexpected<Error>(std::move(row).error()));
  if (const Status forgot = forget_strangers(); !forgot)
    options_.log("model: " + forgot.error().text);
  NoteRests(view, models.compensation());
  Command command;
  command.what = KeepRowsCommand{{std::move(*row)}};
  return command;
}

/// Adopted hardware is not driven by the model of the hardware before it, and the answer says so.
Result<StoreReader*> RequestHandler::Reader() {
  if (reader_ == nullptr) {
    FOCALFLEET_TRY_ASSIGN(reader_, StoreReader::Open(options_.store_path, options_.store));
  }
  return reader_.get();
}

void RequestHandler::Answer(const Pending& pending, const Result<Json>& result) {
  Send(pending.client,
       result ? EncodeResult(pending.id, *result) : EncodeError(pending.id, result.error()));
}

void RequestHandler::Send(ClientId client, const std::string& answer) {
  spent_bytes_ += answer.size();
  server_->Answer(client, answer);
}

void RequestHandler::Reply(const FleetView& view, const ReplyEffect& reply) {
  const auto it = pending_.find(reply.request);
  if (it == pending_.end()) return;
  const Pending pending = it->second;
  // The first reply on a configuration says that it began; clients that wait need the last one.
  it->second.began = true;
  if (!reply.last && (pending.wait || pending.is_retarget)) return;
  pending_.erase(it);
  waiting_ -= GetsProgress(pending) ? 1u : 0u;
  if (reply.error) {
    options_.log("refused or failed: " + reply.error->text);
    if (pending.is_retarget && pending.began)
      return Answer(pending, Json{{"goes", false}, {"text", reply.error->text}});
    // An error means that nothing happened. A failure after motion is a summary with a reason.
    if (!pending.began || !HasMoved(view.coordinator->configuration()))
      return Answer(pending, tl::unexpected<Error>(*reply.error));
    Json summary = ConfigurationJson(view);
    summary["error"] = reply.error->text;
    return Answer(pending, summary);
  }
  if (pending.is_retarget) return Answer(pending, Json{{"goes", true}, {"text", reply.text}});
  if (!pending.is_configuration) return Answer(pending, Json{{"text", reply.text + pending.note}});
  if (!pending.wait)
    return Answer(pending, Json{{"configuration", view.coordinator->configuration().id}});
  Answer(pending, ConfigurationJson(view));
}

/// {timeout_s?}: the answer is the configuration when it is over, by whomever it was commanded.
void RequestHandler::Wait(const FleetView& view, const ControlRequest& request, Pending pending) {
  if (!view.coordinator->busy()) return Answer(pending, Json{{"under_way", false}});
  if (request.args.contains("timeout_s")) {
    const auto timeout_s = NumberArgument(request.args, "timeout_s");
    if (!timeout_s) return Answer(pending, tl::unexpected<Error>(timeout_s.error()));
    if (!(*timeout_s >= 0 && *timeout_s <= kWaitMaxS))
      return Answer(pending, Fail(ErrorCode::kInvalid, "timeout_s must be 0 to 1e6"));
    pending.give_up =
        view.now +
        DurationNs{static_cast<std::int64_t>(*timeout_s * static_cast<double>(options_.second.ns))};
  }
  if (waiting_ >= kOpenRequestsMax)
    return Answer(pending, Fail(ErrorCode::kFull, std::to_string(waiting_) +
                                                      " requests wait for the configuration; ask "
                                                      "again in a second"));
  pending.wait = true;
  pending.awaits = view.coordinator->configuration().id;
  pending_.emplace(next_request_++, pending);
  ++waiting_;
}

void RequestHandler::AnswerWaiters(const FleetView& view) {
  const ConfigurationView& configuration = view.coordinator->configuration();
  std::optional<Json> summary;
  for (auto it = pending_.begin(); it != pending_.end();) {
    const Pending& pending = it->second;
    const bool over = !view.coordinator->busy() || configuration.id != pending.awaits;
    if (pending.awaits == 0 || (!over && view.now < pending.give_up)) {
      ++it;
      continue;
    }
    if (over && !summary) summary = ConfigurationJson(view);
    if (over)
      Answer(pending, *summary);
    else
      Answer(pending, Fail(ErrorCode::kRefused, "configuration " + std::to_string(pending.awaits) +
                                                    " is still under way"));
    it = pending_.erase(it);
    --waiting_;
  }
}

Status RequestHandler::Plan(const FleetView& view, const ControlRequest& request,
                            const Pending& pending) {
  if (dry_run_)
    return Fail(ErrorCode::kFull, "another dry run is being planned; ask again when it is done");
  FOCALFLEET_TRY_ASSIGN(const Command command,
                        CommandOf({.id = request.id, .verb = "apply", .args = request.args}, view));
  FOCALFLEET_TRY_ASSIGN(Preview preview,
                        view.coordinator->PreviewOf(std::get<ApplyCommand>(command.what)));
  dry_run_ = {.pending = pending,
              .targeted = preview.targeted,
              .refused = std::move(preview.refused),
              .since = view.now,
              .job = std::move(preview.job)};
  dry_run_->job->job = next_request_++;  // names the plan for those who want to see its motion
  return {};
}

void RequestHandler::PreviewDone(const FleetView& view, const PlanDone& done) {
  if (!dry_run_) return;
  const DryRun run = *std::exchange(dry_run_, std::nullopt);
  if (done.plan)
    return Answer(run.pending, PreviewJson(*view.layout, done, run.targeted, run.refused));
  Answer(run.pending, tl::unexpected<Error>(done.plan.error()));
}

std::optional<PlanJob> RequestHandler::TakePreview() {
  return dry_run_ ? std::exchange(dry_run_->job, std::nullopt) : std::nullopt;
}

void RequestHandler::ShowProgress(const FleetView& view) {
  if (waiting_ > 0) AnswerWaiters(view);
  if ((waiting_ == 0 && !dry_run_) || view.now < progress_at_) return;
  progress_at_ = view.now + options_.progress_period;
  if (dry_run_) {
    const double second = static_cast<double>(options_.second.ns);
    const Json planning{
        {"state", Name(ConfigurationState::kPlanning)},
        {"dry_run", true},
        {"targeted", dry_run_->targeted},
        {"elapsed_s", static_cast<double>((view.now - dry_run_->since).ns) / second}};
    server_->Progress(dry_run_->pending.client, EncodeProgress(dry_run_->pending.id, planning));
  }
  if (waiting_ == 0) return;
  const std::string progress = EncodeText(ProgressJson(view));
  waiting_ -= std::erase_if(pending_, [&](const auto& entry) {
    const Pending& pending = entry.second;
    const bool is_there = !GetsProgress(pending) ||
                          server_->Progress(pending.client, ProgressLine(pending.id, progress));
    return !is_there && pending.awaits != 0;  // its client is gone, and the wait was all it asked
  });
}

void RequestHandler::Close() {
  if (dry_run_) pending_.emplace(next_request_++, std::exchange(dry_run_, std::nullopt)->pending);
  pending_.merge(asked_);  // their numbers are from one series
  questions_.clear();
  asked_.clear();
  const Error ends{ErrorCode::kUnavailable,
                   "the daemon ends; what moves goes on by itself and is read at the next start"};
  for (const auto& [request, pending] : pending_) Answer(pending, tl::unexpected<Error>(ends));
  states_.Close(ends);
  pending_.clear();
  waiting_ = 0;
  reader_.reset();
}

}  // namespace focalfleet
