// The way into a domain of DDS: which one, over which network, and by whose credentials.
#pragma once

#include <cstdint>
#include <string>

namespace focalfleet {

struct DdsOptions {
  std::uint32_t domain = 0;
  /// Cyclone's configuration as XML or as file:// URI. Empty: the text of deploy/cyclonedds.xml,
  /// which uses the loopback interface only. The environment is not read: CYCLONEDDS_URI decides
  /// the destination only for a program that passes it here.
  std::string config_xml;
  /// Folder of credentials for DDS Security (credentials.h); empty: without.
  std::string security = {};
  /// The partition of all status topics (SectorPartition); empty: that of a daemon of its own.
  std::string partition = {};
};

/// Cyclone DDS keeps one set of permissions for each of its domains in a process. A participant
/// with credentials therefore has a domain of its own within the process. Where the domain's own
/// number is taken there, Cyclone gets one of these for it, and the network still sees the number
/// of DdsOptions. Credentials name these numbers, too (deploy/dds-security/make-keys), so no domain
/// with DDS Security may have them.
inline constexpr std::uint32_t kDomainBesideFirst = 224;
inline constexpr std::uint32_t kDomainBesideLast = 230;  // Cyclone 0.10 lets none above be named

}  // namespace focalfleet
