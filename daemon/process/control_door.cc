#include "daemon/process/control_door.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <memory>

#include "daemon/access/log_limit.h"
#include "daemon/access/rights.h"
#include "daemon/verbs/request_handler.h"

namespace focalfleet {
namespace {

DurationNs SinceStart() { return {std::chrono::steady_clock::now().time_since_epoch().count()}; }

}  // namespace

Result<RoleGroups> FindRoles(const DaemonConfig::Control& control) {
  auto groups = RoleGroups::Find(control.roles, ::geteuid());
  if (!groups) return Fail(groups.error().code, control.roles_at + ": " + groups.error().text);
  return groups;
}

Result<LineServer> OpenControl(const DaemonConfig::Control& control) {
  FOCALFLEET_TRY_ASSIGN(RoleGroups groups, FindRoles(control));
  LineServer::Options options{.line_bytes_max_of = &LineBytesMaxOf,
                              .urgent = &RequestHandler::IsStop};
  // Where groups have roles, the role decides, and the file lets everybody knock.
  if (groups.in_use()) options.file_mode = 0666;
  options.role_of = [groups = std::move(groups)](const std::optional<Peer>& peer) {
    return groups.RoleOf(peer);
  };
  options.turned_away = [limit = std::make_shared<LogLimit>()](const Caller& caller) {
    const std::string line =
        limit->Admit(SinceStart(), "control socket: " + Describe(caller) + " is turned away");
    if (!line.empty()) spdlog::warn("{}", line);
  };
  return LineServer::Create(control.socket, options);
}

std::string ReadBootId() {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string id;
  std::getline(file, id);
  return id;
}

}  // namespace focalfleet
