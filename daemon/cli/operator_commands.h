// Functions that add the commands about alarms, events, the configuration under way, the operators'
// page, the audit and tokens.
#pragma once

#include "daemon/cli/command_line.h"

namespace focalfleet::cli {

void AddAlarmCommands(CommandLine* line);  // alarms, alarms ack, mute, unmute
void AddEventsCommand(CommandLine* line);
void AddWaitCommand(CommandLine* line);
void AddPageCommand(CommandLine* line);
void AddAuditCommand(CommandLine* line);
void AddTokenCommands(CommandLine* line);  // token add, list, revoke

}  // namespace focalfleet::cli
