// The verbs of the daemon over HTTP: POST /api/VERB with the arguments as a JSON object, answered
// by the result. A request goes on to the control socket on behalf of its token, so that both doors
// have one way in, one table of rights and one audit.
//
//   200 the result    400 invalid    403 the role does not suffice    409 refused now
//   429 full          503 unavailable
//
// `diagnose` is not among them: the page has routes of its own for it, and the core no part in it.
// `wait` is not among them, nor the argument of that name: a page asks for the status instead of
// holding a connection.
#pragma once

#include <string>

#include "daemon/http/router.h"

namespace focalfleet {

/// The routes are added. `socket` is the path of the control socket.
void AddApiRoutes(const std::string& socket, HttpRouter* router);

}  // namespace focalfleet
