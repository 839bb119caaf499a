// The routes of the operators' page. The page's own files are for everybody, because they show
// nothing of the fleet. Layout and stream take the right to ask for the status. Everything else
// that the page does goes through the verbs of /api (http/api_routes.h).
#pragma once

#include "daemon/http/router.h"
#include "daemon/page/plate_feed.h"
#include "fleet/layout.h"

namespace focalfleet {

/// Both outlive the router.
void AddPageRoutes(const Layout* layout, PlateFeed* feed, HttpRouter* router);

}  // namespace focalfleet
