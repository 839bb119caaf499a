#include "daemon/plane/plane_requests.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "daemon/access/rights.h"
#include "daemon/control/asker.h"
#include "daemon/plane/plane_commands.h"
#include "daemon/plane/plane_refusal.h"
#include "daemon/status/status_json.h"
#include "daemon/usage/build_version.h"
#include "daemon/verbs/preview_json.h"

namespace focalfleet {
namespace {

Json SectorJson(const PlaneInstant& plane, std::uint32_t sector) {
  const SectorBook& book = plane.coordinator->sectors();
  const SectorBook::Entry& entry = book[sector];
  Json json{{"sector", sector},
            {"units", entry.units},
            {"heard", book.IsHeard(sector)},
            {"trouble", entry.trouble}};
  const auto clock = entry.clock.At(plane.now);
  json["clock_bound_ms"] = clock ? Json(clock->bound.seconds() * 1e3) : Json();
  json["clock_ahead_s"] = clock ? Json(clock->ahead.seconds()) : Json();
  if (!entry.report) return json;
  json["stage"] = Name(entry.report->stage);
  json["life"] = entry.report->incarnation;
  json["configuration"] = entry.report->configuration.number;
  json["arrived"] = entry.report->counts.arrived;
  json["targeted"] = entry.report->counts.targeted;
  json["last_word"] = entry.report->trouble;
  json["door"] = entry.report->door;
  return json;
}

Json GuaranteeJson(const PlaneView& view) {
  Json pairs = Json::array();
  for (const UnnoticedPair& pair : view.unnoticed)
    pairs.push_back(
        {{"ends", pair.ends.value}, {"follower", pair.follower.value}, {"at_s", pair.at_s}});
  return {{"follows_beyond", view.follows_beyond}, {"unnoticed", std::move(pairs)}};
}

/// Units that were not served, as their sectors publish them; these have the reasons.
Json UnservedJson(const PlaneInstant& plane) {
  Json rows = Json::array();
  for (std::uint32_t n = 0; n < plane.plane->layout().size(); ++n) {
    const UnitStatusValue* unit = plane.table->unit({n});
    if (unit == nullptr || unit->outcome <= TargetOutcome::kArrived) continue;
    const std::uint32_t sector = plane.plane->SectorOf({n});
    const auto& report = plane.coordinator->sectors()[sector].report;
    std::string reason = "the daemon of " + NameOfSector(sector) + " has the reason";
    if (report && !report->door.empty()) reason += " (" + report->door + ")";
    rows.push_back({{"unit_id", unit->unit.value},
                    {"outcome", Name(unit->outcome)},
                    {"reason", std::move(reason)}});
  }
  return rows;
}

/// The table of rights, without the verbs that a coordinator does not carry out.
Json AccessOf(const PlaneInstant& plane, const Caller& caller) {
  Json access = AccessJson(caller);
  Json verbs = Json::array();
  for (const Json& right : access["verbs"]) {
    const auto verb = right["verb"].get<std::string>();
    const bool asks = verb == "access" || verb == "status" || verb == "state" || verb == "wait" ||
                      verb == "preview";
    const bool measures = verb != "measure" || plane.has_camera;
    if (measures && (asks || IsPlaneCommand(verb) || PlaneAlarms::IsAbout(verb)))
      verbs.push_back(right);
  }
  access["verbs"] = std::move(verbs);
  return access;
}

Json ProgressJson(const PlaneInstant& plane) {
  const PlaneView& view = plane.coordinator->view();
  const OutcomeCounts& counts = view.counts;
  return {{"id", view.configuration},
          {"kind", Name(view.kind)},
          {"state", Name(view.state)},
          {"round", view.rounds},
          {"targeted", counts.targeted},
          {"arrived", counts.arrived},
          {"refused", counts.refused},
          {"failed", counts.failed},
          {"stopped", counts.stopped},
          {"unmeasured", counts.unmeasured},
          {"makespan_predicted_s", Number(view.makespan_predicted_s)},
          {"waiting_for", view.waiting_for},
          {"fraction", counts.targeted == 0 ? 0.0 : double(counts.arrived) / counts.targeted}};
}

}  // namespace

Json PlaneConfigurationJson(const PlaneInstant& plane) {
  const PlaneView& view = plane.coordinator->view();
  Json json = ProgressJson(plane);
  json["source"] = view.source;
  const OutcomeCounts& c = view.counts;
  const std::uint32_t counted = c.arrived + c.refused + c.failed + c.stopped + c.unmeasured;
  json["left_out"] = c.targeted > counted ? c.targeted - counted : 0;
  json["guarantee"] = GuaranteeJson(view);
  json["measured"] = MeasuredJson(view.measured);
  json["not_measured"] = view.not_measured.empty() ? Json() : Json(view.not_measured);
  return json;
}

Json PlaneStatusJson(const PlaneInstant& plane) {
  const PlaneView& view = plane.coordinator->view();
  Json sectors = Json::array();
  for (std::uint32_t n = 0; n < plane.coordinator->sectors().size(); ++n)
    sectors.push_back(SectorJson(plane, n));
  Json configuration = PlaneConfigurationJson(plane);
  if (plane.table != nullptr) configuration["unserved"] = UnservedJson(plane);
  return {{"version", BuildVersion()},
          {"units", plane.plane->layout().size()},
          {"page", plane.page.empty() ? Json() : Json(plane.page)},
          {"time", ToIso8601(plane.at)},
          {"busy", plane.coordinator->busy()},
          {"alarms", plane.alarms->CountsJson(plane.at)},
          {"plane",
           {{"phase", Name(view.phase)},
            {"epoch", view.epoch.number},
            {"waiting_for", view.waiting_for},
            {"sectors", std::move(sectors)},
            {"messages",
             {{"sent", plane.link.sent},
              {"sent_bytes", plane.link.sent_bytes},
              {"received", plane.link.received},
              {"received_bytes", plane.link.received_bytes},
              {"refused", plane.link.refused}}}}},
          {"configuration", std::move(configuration)}};
}

void PlaneRequests::Service(const PlaneInstant& plane, std::vector<PlaneCommand>* commands) {
  std::vector<IncomingLine> stops;
  server_->Service(&stops);
  for (const IncomingLine& line : stops) Handle(plane, line, commands);
  for (int n = 0; n < 16; ++n) {  // stops that come meanwhile wait no longer than these
    const auto line = server_->Next();
    if (!line) return;
    Handle(plane, *line, commands);
  }
}

void PlaneRequests::Handle(const PlaneInstant& plane, const IncomingLine& line,
                           std::vector<PlaneCommand>* commands) {
  const auto request = DecodeRequest(line.text);
  Pending pending{.client = line.client, .id = request ? request->id : 0};
  const auto refuse = [&](Error error) {
    Answer(pending, tl::unexpected<Error>(std::move(error)));
  };
  if (!request) return refuse(request.error());
  const std::string& verb = request->verb;
  if (line.reserved && verb != "stop")
    return refuse({ErrorCode::kFull, "too many clients, only stop is taken"});
  const Result<Caller> caller = AskerOf(*request, line, options_.own_pid);
  const Status allowed = caller ? CheckRight(*caller, verb, request->args)
                                : Status(tl::unexpected<Error>(caller.error()));
  if (!allowed) {
    options_.log(verb + " refused: " + allowed.error().text);
    return refuse(allowed.error());
  }
  if (verb == "access") return Answer(pending, AccessOf(plane, *caller));
  if (verb == "preview") return Plan(plane, *request, pending);
  if (verb == "status") {
    options_.read([&](const PlaneTable& table) {
      PlaneInstant shown = plane;
      shown.table = &table;
      Answer(pending, PlaneStatusJson(shown));
    });
    return;
  }
  if (PlaneAlarms::IsAbout(verb)) {
    auto answer = plane.alarms->Answer(*request, NameOf(*caller), plane.at);
    if (verb != "alarms") options_.log(verb + " commanded by " + Describe(*caller));
    return Answer(pending, answer);
  }
  if (verb == "state") {
    // The answer is spliced in as text, into the frame that EncodeResult makes.
    std::string answer = EncodeResult(pending.id, nullptr);
    options_.read([&](const PlaneTable& table) {
      answer.replace(answer.find("null"), 4,
                     table.StateText(plane.coordinator->sectors(), plane.steady));
    });
    server_->Answer(pending.client, answer);
    return;
  }
  if (verb == "wait") {
    if (!plane.coordinator->busy()) return Answer(pending, Json{{"under_way", false}});
    pending.wait = true;
    pending.kind = Pending::Kind::kConfiguration;
    pending_.emplace(next_++, pending);
    return;
  }
  const bool stops_a_unit = verb == "stop" && request->args.contains("unit_id");
  if (!IsPlaneCommand(verb) || stops_a_unit) return refuse(RefusalOf(plane, *request));
  if (line.overtaken && verb != "stop")
    return refuse({ErrorCode::kRefused, "a stop that came before " + verb +
                                            " was begun went ahead of it; command it again if it "
                                            "is still wanted"});
  const auto wait = FlagArgumentOr(request->args, "wait", false);
  if (!wait) return refuse(wait.error());
  std::optional<Result<PlaneCommand>> command;
  options_.read([&](const PlaneTable& table) {
    PlaneInstant with_table = plane;
    with_table.table = &table;
    command = PlaneCommandOf(with_table, *request);
  });
  if (!*command) {
    options_.log(verb + " refused: " + command->error().text);
    return refuse(command->error());
  }
  options_.log(verb + " commanded by " + Describe(*caller));
  pending.kind = verb == "stop"       ? Pending::Kind::kStop
                 : verb == "retarget" ? Pending::Kind::kRetarget
                                      : Pending::Kind::kConfiguration;
  pending.wait = *wait && pending.kind == Pending::Kind::kConfiguration;
  (*command)->request = next_;
  commands->push_back(std::move(**command));
  pending_.emplace(next_++, pending);
}

void PlaneRequests::Plan(const PlaneInstant& plane, const ControlRequest& request,
                         const Pending& pending) {
  if (dry_run_)
    return Answer(pending, Fail(ErrorCode::kFull,
                                "another dry run is being planned; ask again when it is done"));
  std::optional<Result<PlanePreview>> preview;
  options_.read([&](const PlaneTable& table) {
    PlaneInstant with_table = plane;
    with_table.table = &table;
    preview = PlanePreviewOf(with_table, request.args);
  });
  if (!*preview) return Answer(pending, tl::unexpected<Error>(preview->error()));
  preview_ = std::move(**preview);
  preview_->preview.job.job = next_++;  // names the plan for those who want to see its motion
  dry_run_ = {.pending = pending,
              .targeted = preview_->preview.targeted,
              .refused = std::move(preview_->preview.refused),
              .since = plane.now};
}

void PlaneRequests::PreviewDone(const PlaneInstant& plane, const PlanDone& done) {
  if (!dry_run_) return;
  const DryRun run = *std::exchange(dry_run_, std::nullopt);
  if (done.plan)
    return Answer(run.pending, PreviewJson(plane.plane->layout(), done, run.targeted, run.refused));
  Answer(run.pending, tl::unexpected<Error>(done.plan.error()));
}

void PlaneRequests::ShowPlanning(const PlaneInstant& plane) {
  if (!dry_run_) return;
  const Json planning{{"state", Name(ConfigurationState::kPlanning)},
                      {"dry_run", true},
                      {"targeted", dry_run_->targeted},
                      {"elapsed_s", (plane.now - dry_run_->since).seconds()}};
  server_->Progress(dry_run_->pending.client, EncodeProgress(dry_run_->pending.id, planning));
}

void PlaneRequests::Answer(const Pending& pending, const Result<Json>& result) {
  server_->Answer(pending.client, result ? EncodeResult(pending.id, *result)
                                         : EncodeError(pending.id, result.error()));
}

void PlaneRequests::Reply(const PlaneInstant& plane, const ReplyEffect& reply) {
  const auto it = pending_.find(reply.request);
  if (it == pending_.end()) return;
  const Pending pending = it->second;
  if (reply.error) {
    Answer(pending, tl::unexpected<Error>(*reply.error));
  } else if (pending.kind == Pending::Kind::kRetarget) {
    Answer(pending, Json{{"goes", true}, {"text", reply.text}});
  } else if (pending.kind == Pending::Kind::kStop) {
    Answer(pending, Json{{"text", reply.text}});
  } else if (!pending.wait || reply.last) {
    Answer(pending, PlaneConfigurationJson(plane));
  } else {
    return;
  }
  pending_.erase(it);
}

void PlaneRequests::ShowProgress(const PlaneInstant& plane) {
  if ((pending_.empty() && !dry_run_) || plane.now < progress_at_) return;
  progress_at_ = plane.now + options_.progress_period;
  ShowPlanning(plane);
  const Json progress = ProgressJson(plane);
  std::erase_if(pending_, [&](const auto& entry) {
    const Pending& pending = entry.second;
    if (!pending.wait) return false;
    if (!plane.coordinator->busy()) {
      Answer(pending, PlaneConfigurationJson(plane));
      return true;
    }
    return !server_->Progress(pending.client, EncodeProgress(pending.id, progress));
  });
}

void PlaneRequests::Close() {
  if (dry_run_) pending_.emplace(next_++, std::exchange(dry_run_, std::nullopt)->pending);
  for (const auto& [number, pending] : pending_)
    Answer(pending,
           Fail(ErrorCode::kUnavailable, "this coordinator ends; the sectors hold what they have"));
  pending_.clear();
  std::vector<IncomingLine> rest;
  server_->Service(&rest);
}

}  // namespace focalfleet
