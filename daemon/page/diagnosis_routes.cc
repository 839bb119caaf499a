#include "daemon/page/diagnosis_routes.h"

#include <string>
#include <utility>

#include "daemon/campaign/campaign_files.h"
#include "daemon/campaign/recorded_campaign.h"
#include "daemon/control/messages.h"

namespace focalfleet {
namespace {

HttpAnswer RefusalOf(const Error& error) {
  const int status = error.code == ErrorCode::kInvalid   ? 400
                     : error.code == ErrorCode::kRefused ? 409
                                                         : 503;
  return HttpFailure(status, CodeName(error.code), error.text);
}

/// A bound on the memory that the tables take; a diagnosis searches fewer rows than that.
constexpr std::size_t kRecordedRowsMax = 200'000;
constexpr std::uint32_t kRecordedConfigurationsMax = 5000;

/// The tables of configurations that the store has: {"name", "recorded": {"first", "last"}}.
Result<DiagnosisJob::Campaign> CampaignOfStore(const Json& args, const Recordings& recordings,
                                               const Caller& caller) {
  RecordedList list;
  FOCALFLEET_TRY_ASSIGN(list.name, TextArgument(args, "name"));
  const Json& range = args["recorded"];
  if (!range.is_object()) return Fail(ErrorCode::kInvalid, "recorded must be an object");
  FOCALFLEET_TRY_ASSIGN(list.first, UnsignedArgument(range, "first"));
  FOCALFLEET_TRY_ASSIGN(list.last, UnsignedArgument(range, "last"));
  if (list.first == 0 || list.last < list.first ||
      list.last - list.first >= kRecordedConfigurationsMax)
    return Fail(ErrorCode::kInvalid, "first and last must be the numbers of at most " +
                                         std::to_string(kRecordedConfigurationsMax) +
                                         " configurations");
  FOCALFLEET_TRY_ASSIGN(const auto reader, StoreReader::Open(recordings.store));
  FOCALFLEET_TRY_ASSIGN(const sim::Campaign campaign,
                        RecordedCampaign(reader.get(), *recordings.layout, list, kRecordedRowsMax));
  return DiagnosisJob::Campaign{.name = list.name,
                                .moves_csv = WriteMoves(campaign),
                                .units_csv = WriteCampaignUnits(campaign),
                                .by = NameOf(caller)};
}

Result<DiagnosisJob::Campaign> CampaignIn(const HttpRequest& request, const Recordings& recordings,
                                          const Caller& caller) {
  FOCALFLEET_TRY_ASSIGN(const Json args, DecodeObject(request.body));
  if (args.contains("recorded")) return CampaignOfStore(args, recordings, caller);
  DiagnosisJob::Campaign campaign{
      .name = {}, .moves_csv = {}, .units_csv = {}, .by = NameOf(caller)};
  FOCALFLEET_TRY_ASSIGN(campaign.name, TextArgument(args, "name"));
  FOCALFLEET_TRY_ASSIGN(campaign.moves_csv, TextArgument(args, "moves_csv", request.body.size()));
  FOCALFLEET_TRY_ASSIGN(campaign.units_csv, TextArgument(args, "units_csv", request.body.size()));
  return campaign;
}

HttpAnswer ShowRecordings(const Recordings& recordings) {
  const auto reader = StoreReader::Open(recordings.store);
  if (!reader) return RefusalOf(reader.error());
  const auto lists = RecordedLists(reader->get(), kRecordedConfigurationsMax);
  if (!lists) return RefusalOf(lists.error());
  Json all = Json::array();
  for (const RecordedList& list : *lists)
    all.push_back({{"name", list.name},
                   {"night", list.is_night},
                   {"first", list.first},
                   {"last", list.last},
                   {"configurations", list.configurations},
                   {"began_ms", list.began.ns / 1'000'000}});
  return {.content_type = "application/json",
          .body = Json({{"recordings", std::move(all)}})
                      .dump(-1, ' ', false, Json::error_handler_t::replace) +
                  "\n"};
}

HttpAnswer ShowDiagnosis(DiagnosisJob* job) {
  return {.content_type = "application/json",
          .body = job->Show().dump(-1, ' ', false, Json::error_handler_t::replace) + "\n"};
}

HttpAnswer BeginDiagnosis(DiagnosisJob* job, const Recordings& recordings,
                          const HttpRequest& request, const Caller& caller) {
  const auto campaign = CampaignIn(request, recordings, caller);
  if (!campaign) return RefusalOf(campaign.error());
  if (const Status begun = job->Begin(*campaign); !begun) return RefusalOf(begun.error());
  return ShowDiagnosis(job);
}

HttpAnswer CancelDiagnosis(DiagnosisJob* job) {
  if (const Status cancelled = job->Cancel(); !cancelled) return RefusalOf(cancelled.error());
  return ShowDiagnosis(job);
}

struct ReportRoute {
  const char* path;
  const char* file;
  const char* type;
  bool kept;  // as a file: its own style and script would not be let in here
};
constexpr ReportRoute kReportRoutes[] = {
    {"/diagnosis-report", "report.json", "application/json", false},
    {"/diagnosis-model", "model.toml", "text/plain; charset=utf-8", false},
    {"/diagnosis-page", "report.html", "text/html; charset=utf-8", true}};

HttpAnswer ReportAnswer(DiagnosisJob* job, const ReportRoute& route) {
  auto text = job->ReportFile(route.file);
  if (!text) return RefusalOf(text.error());
  HttpAnswer answer{.content_type = route.type, .body = std::move(*text)};
  if (route.kept)
    answer.headers.emplace_back("Content-Disposition", "attachment; filename=\"report.html\"");
  return answer;
}

}  // namespace

void AddDiagnosisRoutes(DiagnosisJob* job, const Recordings& recordings, HttpRouter* router) {
  router->Add({.path = "/diagnosis",
               .verb = "status",
               .answer = [job](const HttpRequest&, const Caller&) { return ShowDiagnosis(job); }});
  router->Add({.method = "POST",
               .path = "/diagnosis",
               .verb = "diagnose",
               .answer = [job, recordings](const HttpRequest& request, const Caller& caller) {
                 return BeginDiagnosis(job, recordings, request, caller);
               }});
  router->Add({.path = "/recordings",
               .verb = "history",
               .answer = [recordings](const HttpRequest&, const Caller&) {
                 return ShowRecordings(recordings);
               }});
  router->Add(
      {.method = "POST",
       .path = "/diagnosis-cancel",
       .verb = "diagnose",
       .answer = [job](const HttpRequest&, const Caller&) { return CancelDiagnosis(job); }});
  for (const ReportRoute& route : kReportRoutes)
    router->Add({.path = route.path,
                 .verb = "status",
                 .answer = [job, &route](const HttpRequest&, const Caller&) {
                   return ReportAnswer(job, route);
                 }});
}

}  // namespace focalfleet
