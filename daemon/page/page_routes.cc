#include "daemon/page/page_routes.h"

#include <string>

#include "daemon/page/assets.h"
#include "daemon/page/plate_layout.h"

namespace focalfleet {
namespace {

HttpAnswer Stream(PlateFeed* feed) {
  auto stream = feed->Join();
  if (!stream) return HttpFailure(503, "full", stream.error().text);
  return {.content_type = "application/octet-stream", .body = {}, .stream = std::move(*stream)};
}

}  // namespace

void AddPageRoutes(const Layout* layout, PlateFeed* feed, HttpRouter* router) {
  for (const PageAsset& asset : PageAssets())
    router->Add({.path = std::string(asset.path),
                 .verb = "",
                 .answer = [asset](const HttpRequest&, const Caller&) {
                   return HttpAnswer{.content_type = std::string(asset.type),
                                     .body = std::string(asset.text)};
                 }});
  router->Add(
      {.path = "/layout", .verb = "status", .answer = [layout](const HttpRequest&, const Caller&) {
         return HttpAnswer{.content_type = "application/json", .body = LayoutJson(*layout)};
       }});
  router->Add({.path = "/stream",
               .verb = "status",
               .answer = [feed](const HttpRequest&, const Caller&) { return Stream(feed); }});
}

}  // namespace focalfleet
