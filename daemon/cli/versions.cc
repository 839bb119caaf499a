#include "daemon/cli/versions.h"

#include <fmt/format.h>

#include "daemon/cli/client.h"
#include "daemon/control/line_client.h"
#include "daemon/usage/build_version.h"

namespace focalfleet::cli {

const char* ClientVersion() { return BuildVersion(); }

std::optional<std::string> DaemonVersion(const Context& context) {
  constexpr DurationNs kPatience = Seconds(2);
  auto client = LineClient::Connect(context.SocketPath(), kPatience);
  if (!client) return std::nullopt;
  const auto status =
      client->Call("status", Json::object(), {.silence_max = kPatience, .on_progress = {}});
  if (!status) return std::nullopt;
  return TextIn(*status, "version");
}

std::string DifferenceFrom(const std::string& daemon_version) {
  if (daemon_version == ClientVersion()) return "";
  return fmt::format(
      "the daemon is version {}, this command line {}: start focalfleetd anew when no "
      "configuration is under way",
      daemon_version, ClientVersion());
}

}  // namespace focalfleet::cli
