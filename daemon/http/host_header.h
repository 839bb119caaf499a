// The Host header of a request names the server as the client knows it. A page of a foreign site
// can make a browser ask the loopback address, but only under the site's own name (DNS rebinding).
// Requests under any other name than the server's own are therefore refused.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace focalfleet {

/// True where `host` is a loopback name or address, or one of `names`, with any port or none.
/// Letters of either case are alike. IPv6 addresses stand in brackets in `host`, without in
/// `names`.
bool IsAllowedHost(std::string_view host, const std::vector<std::string>& names);

}  // namespace focalfleet
