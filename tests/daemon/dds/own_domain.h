// Finds a DDS domain that no other test on this machine uses: the first whose lock file is free.
// The lock is held until the process ends. Domains 20..99 keep Cyclone's ports (7400 + 250 *
// domain) below the ephemeral ones.
#pragma once

#include <fcntl.h>
#include <sys/file.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace focalfleet::test {

inline std::uint32_t OwnDomain() {
  static const std::uint32_t domain = [] {
    for (std::uint32_t candidate = 20; candidate < 100; ++candidate) {
      const std::string path = "/tmp/focalfleet_dds_domain_" + std::to_string(candidate) + ".lock";
      const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
      if (descriptor >= 0 && flock(descriptor, LOCK_EX | LOCK_NB) == 0) return candidate;
    }
    std::fprintf(stderr, "no free DDS domain\n");
    std::abort();
  }();
  return domain;
}

}  // namespace focalfleet::test
