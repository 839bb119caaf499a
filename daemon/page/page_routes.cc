#include "daemon/page/page_routes.h"

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/page/assets.h"
#include "daemon/page/diagnosis_routes.h"
#include "daemon/page/plate_layout.h"

namespace focalfleet {
namespace {

HttpAnswer Stream(PlateFeed* feed) {
  auto stream = feed->Join();
  if (!stream) return HttpFailure(503, "full", stream.error().text);
  return {.content_type = "application/octet-stream", .body = {}, .stream = std::move(*stream)};
}

/// A whole number of the query; none: it is missing, or no number.
std::optional<std::uint64_t> NumberIn(const HttpRequest& request, const char* name) {
  const auto at = request.query.find(name);
  if (at == request.query.end()) return std::nullopt;
  std::uint64_t number = 0;
  const char* const end = at->second.data() + at->second.size();
  const auto [rest, error] = std::from_chars(at->second.data(), end, number);
  if (error != std::errc() || rest != end) return std::nullopt;
  return number;
}

HttpAnswer NoNumber(const char* name) {
  return HttpFailure(400, "invalid", std::string(name) + " must be a whole number");
}

HttpAnswer MotionsOf(const std::vector<KeptPlans::Motion>& motions) {
  if (motions.empty())
    return HttpFailure(404, "refused", "the rows of this plan are not kept, or no longer");
  HttpAnswer answer{.content_type = "application/octet-stream", .body = {}};
  for (const KeptPlans::Motion& motion : motions) answer.body += *motion;
  return answer;
}

HttpAnswer MotionOfConfiguration(const KeptPlans& plans, const HttpRequest& request) {
  const auto configuration = NumberIn(request, "configuration");
  return configuration ? MotionsOf(plans.Of(*configuration)) : NoNumber("configuration");
}

HttpAnswer MotionOfPreview(const KeptPlans& plans, const HttpRequest& request) {
  const auto plan = NumberIn(request, "plan");
  if (!plan) return NoNumber("plan");
  const KeptPlans::Motion motion = plans.Preview(*plan);
  return MotionsOf(motion != nullptr ? std::vector{motion} : std::vector<KeptPlans::Motion>());
}

HttpAnswer PowerOfPreview(const NightCurves& night, const HttpRequest& request) {
  const auto plan = NumberIn(request, "plan");
  if (!plan) return NoNumber("plan");
  auto text = night.PreviewText(*plan);
  if (!text) return HttpFailure(404, "refused", "the power of this plan is not kept, or no longer");
  return {.content_type = "application/json", .body = std::move(*text)};
}

HttpAnswer Curves(const NightCurves& night, const HttpRequest& request) {
  const bool asked = request.query.contains("since_ms");
  const auto since_ms = NumberIn(request, "since_ms");
  if (asked && (!since_ms || *since_ms > INT64_MAX)) return NoNumber("since_ms");
  return {.content_type = "application/json",
          .body = night.Text(since_ms ? static_cast<std::int64_t>(*since_ms) : -1)};
}

}  // namespace

void AddPageRoutes(const PageParts& parts, HttpRouter* router) {
  for (const PageAsset& asset : PageAssets())
    router->Add({.path = std::string(asset.path),
                 .verb = "",
                 .answer = [asset](const HttpRequest&, const Caller&) {
                   return HttpAnswer{.content_type = std::string(asset.type),
                                     .body = std::string(asset.text)};
                 }});
  router->Add(
      {.path = "/layout", .verb = "status", .answer = [parts](const HttpRequest&, const Caller&) {
         return HttpAnswer{.content_type = "application/json",
                           .body = LayoutJson(*parts.layout, parts.sectors)};
       }});
  router->Add(
      {.path = "/stream",
       .verb = "status",
       .answer = [feed = parts.feed](const HttpRequest&, const Caller&) { return Stream(feed); }});
  router->Add({.path = "/motion",
               .verb = "history",
               .answer = [plans = parts.plans](const HttpRequest& request, const Caller&) {
                 return MotionOfConfiguration(*plans, request);
               }});
  router->Add({.path = "/preview-motion",
               .verb = "preview",
               .answer = [plans = parts.plans](const HttpRequest& request, const Caller&) {
                 return MotionOfPreview(*plans, request);
               }});
  router->Add({.path = "/preview-power",
               .verb = "preview",
               .answer = [night = parts.night](const HttpRequest& request, const Caller&) {
                 return PowerOfPreview(*night, request);
               }});
  if (parts.diagnosis != nullptr)
    AddDiagnosisRoutes(parts.diagnosis, {parts.store, parts.layout}, router);
  router->Add({.path = "/curves",
               .verb = "status",
               .answer = [night = parts.night](const HttpRequest& request, const Caller&) {
                 return Curves(*night, request);
               }});
}

}  // namespace focalfleet
