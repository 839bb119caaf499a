// Facts about this process as the kernel has them, and the size of the store's files. Reading them
// may wait for a disk, so it is done on the thread that asks.
#pragma once

#include <cstdint>
#include <string>

namespace focalfleet {

struct ProcessFacts {
  double cpu_s = 0;  // user and system
  std::uint64_t resident_bytes = 0;
  std::uint64_t virtual_bytes = 0;
  std::uint64_t open_descriptors = 0;
  std::uint64_t descriptors_max = 0;
  std::uint64_t threads = 0;
};

/// A fact that cannot be read is 0.
ProcessFacts ReadProcessFacts();

/// Bytes of the file and its write-ahead log; a file that is absent counts as 0.
std::uint64_t StoreBytes(const std::string& path);

}  // namespace focalfleet
