#include "daemon/page/diagnosis_routes.h"

#include <string>
#include <utility>

#include "daemon/control/messages.h"

namespace focalfleet {
namespace {

HttpAnswer RefusalOf(const Error& error) {
  const int status = error.code == ErrorCode::kInvalid   ? 400
                     : error.code == ErrorCode::kRefused ? 409
                                                         : 503;
  return HttpFailure(status, CodeName(error.code), error.text);
}

Result<DiagnosisJob::Campaign> CampaignIn(const HttpRequest& request, const Caller& caller) {
  FOCALFLEET_TRY_ASSIGN(const Json args, DecodeObject(request.body));
  DiagnosisJob::Campaign campaign{
      .name = {}, .moves_csv = {}, .units_csv = {}, .by = NameOf(caller)};
  FOCALFLEET_TRY_ASSIGN(campaign.name, TextArgument(args, "name"));
  FOCALFLEET_TRY_ASSIGN(campaign.moves_csv, TextArgument(args, "moves_csv", kControlLineBytesMax));
  FOCALFLEET_TRY_ASSIGN(campaign.units_csv, TextArgument(args, "units_csv", kControlLineBytesMax));
  return campaign;
}

HttpAnswer ShowDiagnosis(DiagnosisJob* job) {
  return {.content_type = "application/json",
          .body = job->Show().dump(-1, ' ', false, Json::error_handler_t::replace) + "\n"};
}

HttpAnswer BeginDiagnosis(DiagnosisJob* job, const HttpRequest& request, const Caller& caller) {
  const auto campaign = CampaignIn(request, caller);
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

void AddDiagnosisRoutes(DiagnosisJob* job, HttpRouter* router) {
  router->Add({.path = "/diagnosis",
               .verb = "status",
               .answer = [job](const HttpRequest&, const Caller&) { return ShowDiagnosis(job); }});
  router->Add({.method = "POST",
               .path = "/diagnosis",
               .verb = "diagnose",
               .answer = [job](const HttpRequest& request, const Caller& caller) {
                 return BeginDiagnosis(job, request, caller);
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
