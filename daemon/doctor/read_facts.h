// The facts of this machine, read without changing anything.
#pragma once

#include <string>

#include "daemon/doctor/facts.h"

namespace focalfleet::doctor {

struct ReadOptions {
  std::string program_version;
  std::string config_path;
  std::string socket;            // empty: control.socket of the configuration
  std::string socket_otherwise;  // where the configuration cannot be read
};

/// The facts also say which of them could not be read. Cost: as InspectHealth; a daemon that does
/// not answer takes three seconds more.
Facts ReadFacts(const ReadOptions& options);

// ---- the parts

HostFacts ReadHost();
DaemonFacts ReadDaemon(const std::string& socket);
FileFacts LookAtFile(const std::string& path);
/// The user and its groups, by the machine's list of users.
Identity IdentityOf(std::uint32_t uid);
Identity OwnIdentity();
/// The user of a daemon that runs; else the owner of the store's folder; where there is no such
/// folder yet, the user of the installed service; without one, this process.
Identity IdentityOfDaemon(const Facts& facts, const char* service_user);

}  // namespace focalfleet::doctor
