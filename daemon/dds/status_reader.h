// The other end, for `focalfleet watch` and tests: takes what came since the last time, in values
// of our own. A sample with a code outside its enum is counted and dropped, never shown as
// something else.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/dds/status_publisher.h"
#include "daemon/dds/status_values.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// What came. Of a unit, bus, fleet and configuration only the newest value is worth having; alarms
/// are each their own.
struct StatusUpdate {
  std::optional<FleetStatusValue> fleet;
  std::optional<ConfigurationProgressValue> configuration;
  std::vector<UnitStatusValue> units;
  std::vector<UnitOrientationValue> orientations;
  std::vector<BusStatusValue> buses;
  std::vector<AlarmValue> alarms;
  std::uint32_t malformed = 0;

  [[nodiscard]] std::size_t count() const {
    return (fleet ? 1u : 0u) + (configuration ? 1u : 0u) + units.size() + orientations.size() +
           buses.size() + alarms.size();
  }
};

class StatusReader {
 public:
  struct Options {
    DdsOptions dds;
    bool units = true;  // false: leave the 5000 unit samples on the network's other side
  };
  static Result<std::unique_ptr<StatusReader>> Create(const Options& options);
  StatusReader(const StatusReader&) = delete;
  StatusReader& operator=(const StatusReader&) = delete;
  ~StatusReader();

  /// True as soon as something came or a writer appeared or died; false when `timeout` passed.
  /// Errors: kUnavailable.
  Result<bool> Wait(std::chrono::milliseconds timeout);

  /// Takes all that is there, without waiting. `out` is cleared first; its capacity is kept.
  /// Errors: kUnavailable.
  Status Take(StatusUpdate* out);

  /// A daemon is there: a live writer of the fleet topic. A killed one is noticed after its lease
  /// (2 s), a clean end at once.
  [[nodiscard]] bool writer_alive() const;
  /// A daemon was there at least once; tells "not started" from "gone".
  [[nodiscard]] bool writer_seen() const;

 private:
  class Impl;
  explicit StatusReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
