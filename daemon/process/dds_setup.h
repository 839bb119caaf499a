// DDS as the configuration has it.
#pragma once

#include <functional>
#include <memory>

#include "daemon/dds/credential_watch.h"
#include "daemon/dds/status_publisher.h"
#include "daemon/process/config.h"
#include "daemon/status/dds_troubles.h"

namespace focalfleet {

DdsOptions DdsOptionsOf(const DaemonConfig::Dds& dds);
/// The same for status: that of a sector is in the sector's partition.
DdsOptions StatusOptionsOf(const DaemonConfig& config);

/// The log says that $CYCLONEDDS_URI is not read, where it is set.
void WarnOfDdsEnvironment(const DaemonConfig::Dds& dds);

/// Warnings of the watch go to `troubles`; `renew` makes participants anew, as that of
/// CredentialWatch. Null: there is no DDS Security. Both outlive the watch.
std::unique_ptr<CredentialWatch> WatchCredentials(const DaemonConfig::Dds& dds,
                                                  DdsTroubles* troubles,
                                                  std::function<void(WallTime end)> renew);

}  // namespace focalfleet
