// The control socket as the configuration has it: its file, and the roles of those who come.
#pragma once

#include <string>

#include "daemon/access/role_groups.h"
#include "daemon/control/line_server.h"
#include "daemon/process/config.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kInvalid, with file and line: a group does not exist.
Result<RoleGroups> FindRoles(const DaemonConfig::Control& control);

/// The server listens, and logs those whom it turns away. Errors: as FindRoles, LineServer::Create.
Result<LineServer> OpenControl(const DaemonConfig::Control& control);

/// The kernel's number of this start of the machine; empty: not readable.
std::string ReadBootId();

}  // namespace focalfleet
