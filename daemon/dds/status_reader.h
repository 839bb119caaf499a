// StatusReader is the receiving end, for `focalfleet watch` and tests. Take returns the samples
// that arrived since the last call, in this project's own values. A sample with a code outside its
// enum is counted and dropped, never shown as something else.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/dds/status_publisher.h"
#include "daemon/dds/status_values.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The samples that arrived. Alarms are kept one by one; of all else only the newest value is
/// kept. Where several partitions are read, `fleets`, `configurations` and `audit_heads` have the
/// newest of each with its sector, and `fleet`, `configuration` and `audit_head` the newest of all.
struct StatusUpdate {
  std::optional<FleetStatusValue> fleet;
  std::vector<FleetStatusValue> fleets;
  std::optional<ConfigurationProgressValue> configuration;
  std::vector<ConfigurationProgressValue> configurations;
  std::vector<UnitStatusValue> units;
  std::vector<UnitOrientationValue> orientations;
  std::vector<BusStatusValue> buses;
  std::vector<AlarmValue> alarms;
  std::optional<AuditHeadValue> audit_head;
  std::vector<AuditHeadValue> audit_heads;
  std::uint32_t malformed = 0;

  [[nodiscard]] std::size_t count() const {
    return (fleet ? 1u : 0u) + (configuration ? 1u : 0u) + units.size() + orientations.size() +
           buses.size() + alarms.size() + (audit_head ? 1u : 0u);
  }
};

class StatusReader {
 public:
  struct Options {
    DdsOptions dds;
    bool units = true;  // false: the 5000 unit samples are not requested from the network
    /// Partitions that are read together; empty: that of `dds` alone. An empty name is that of
    /// daemons of their own.
    std::vector<std::string> partitions = {};
  };
  static Result<std::unique_ptr<StatusReader>> Create(const Options& options);
  StatusReader(const StatusReader&) = delete;
  StatusReader& operator=(const StatusReader&) = delete;
  ~StatusReader();

  /// True as soon as a sample arrived or a writer appeared or died; false when `timeout` passed.
  /// Errors: kUnavailable.
  Result<bool> Wait(std::chrono::milliseconds timeout);

  /// Takes all samples that are there, without waiting. `out` is cleared first; its capacity is
  /// kept.
  /// Errors: kUnavailable.
  Status Take(StatusUpdate* out);

  /// True while a daemon is there: a live writer of the fleet topic. A killed daemon is noticed
  /// after its lease (2 s), a clean end at once.
  [[nodiscard]] bool writer_alive() const;
  /// True if a daemon was there at least once. The flag distinguishes "not started" from "gone".
  [[nodiscard]] bool writer_seen() const;

 private:
  class Impl;
  explicit StatusReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
