// Functions that add the commands about alarms, events and the configuration under way.
#pragma once

#include "daemon/cli/command_line.h"

namespace focalfleet::cli {

void AddAlarmCommands(CommandLine* line);  // alarms, alarms ack, mute, unmute
void AddEventsCommand(CommandLine* line);
void AddWaitCommand(CommandLine* line);

}  // namespace focalfleet::cli
