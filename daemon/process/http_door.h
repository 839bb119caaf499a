// The HTTP door as the configuration has it: who may come is decided by tokens, and elsewhere than
// on the loopback interface it speaks TLS.
#pragma once

#include <memory>
#include <string>

#include "daemon/http/http_server.h"
#include "daemon/page/page_routes.h"
#include "daemon/process/config.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Certificate, key and tokens are good. From elsewhere than this host nobody may come as long as
/// there is no token. Errors: kInvalid, kUnavailable name the file, or the line of the key.
Status CheckHttpDoor(const DaemonConfig::Http& http);

/// The address under which a browser finds the page; empty where there is no port.
std::string PageAddress(const DaemonConfig::Http& http);

/// The server listens, or tries to; null where there is no port. `socket` is the control socket's
/// path. Lifetime: the page's parts outlive the server. Errors: as CheckHttpDoor.
Result<std::unique_ptr<HttpServer>> OpenHttp(const DaemonConfig::Http& http,
                                             const std::string& socket, const PageParts& page);

}  // namespace focalfleet
