// A week of nights without faults: one configuration after the other, with a new life of the daemon
// each night. After each configuration the sizes of memory, descriptors and disk are taken, so that
// growth with their number shows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

namespace focalfleet::soak {

struct Week {
  std::uint32_t configurations = 1000;
  std::uint32_t nights = 7;

  /// The night of the n-th configuration, both from 0 on.
  [[nodiscard]] std::uint32_t NightOf(std::uint32_t n) const {
    return static_cast<std::uint32_t>(std::uint64_t{n} * nights / configurations);
  }
};

/// Sizes after a configuration. Units: bytes, where nothing else is said.
struct WeekSizes {
  std::uint32_t configuration = 0;  // from 1 on
  std::uint32_t night = 0;          // from 1 on
  double virtual_h = 0;             // that the host has run
  std::size_t memory = 0;           // in use, without the disk that is in memory
  std::size_t store = 0;            // the file
  std::size_t store_log = 0;        // its write-ahead log
  std::size_t batches = 0;          // that wait for the store
  std::size_t descriptors = 0;      // open ones
  std::size_t arrived = 0;          // units
};

/// A line of CSV, and the line of its columns.
std::string WeekColumns();
std::string WeekLine(const WeekSizes& sizes);

/// Memory in use, and open descriptors, of this process.
std::size_t MemoryInUse();
std::size_t DescriptorsOpen();

}  // namespace focalfleet::soak
