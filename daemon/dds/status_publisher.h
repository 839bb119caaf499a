// StatusPublisher publishes the daemon's state on DDS. Seven topics each keep their last state for
// readers that join late. The last value wins and nothing waits: a reader that does not read costs
// the other readers nothing and the daemon no time.
//
// The cost was measured as CPU time of this process, for 5000 units at 10 Hz and one reader. A
// packet per sample takes 14.5 s per 1000 updates; packed samples take 6.6 s. Writes are therefore
// packed and leave at Flush, or when a packet is full. The packing is Cyclone's write batching, a
// switch of the whole process that only affects writers made after it.
//
// docs/adr/0006-dds-topics.md has topics and QoS; focalfleet.idl has the types and their codes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/dds/dds_options.h"
#include "daemon/dds/status_values.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The partition of all topics of a sector of a plane; none: of all sectors, for readers.
std::string SectorPartition(std::optional<std::uint32_t> sector);
/// The partition of the status of a plane's coordinator.
inline constexpr const char* kPlanePartition = "plane";
/// The partitions of all daemons: of their own, of sectors, and the coordinator's.
std::vector<std::string> AllPartitions();
/// The sector of a partition's name; none: it is not that of one sector.
std::optional<std::uint32_t> SectorOfPartition(std::string_view partition);

struct PublisherCounters {
  std::uint64_t samples = 0;
  std::uint64_t payload_bytes = 0;  // serialised samples, without RTPS and UDP headers
  std::uint64_t deferred = 0;       // refused for lack of room; the caller offers them again
};

class StatusPublisher {
 public:
  /// A publisher on the domain of `options`.
  /// Errors: kUnavailable: no such interface, port or configuration; the text quotes Cyclone.
  static Result<std::unique_ptr<StatusPublisher>> Create(const DdsOptions& options);
  StatusPublisher(const StatusPublisher&) = delete;
  StatusPublisher& operator=(const StatusPublisher&) = delete;
  ~StatusPublisher();

  /// How many of `units` were taken, from the front; they leave at Flush. With keep-last, Cyclone
  /// 0.10.2 takes all: a reader that lags misses values in between, never the last one. A DDS that
  /// refuses for lack of room would take fewer; offer the rest again, or newer values of them.
  /// Errors (of every Publish): kInvalid: a code outside its enum, which is named, and nothing was
  /// written; kUnavailable: DDS failed.
  /// Cost: no allocation by this project's code.
  Result<std::size_t> Publish(std::span<const UnitStatusValue> units);
  Result<std::size_t> Publish(std::span<const UnitOrientationValue> orientations);
  Result<std::size_t> Publish(std::span<const BusStatusValue> buses);
  Status Publish(const FleetStatusValue& fleet);
  Status Publish(const ConfigurationProgressValue& configuration);
  Status Publish(const AuditHeadValue& audit);
  /// Publishes an alarm as an instance of its own, so a reader sees each alarm once. The newest
  /// kAlarmsKept stay for late joiners.
  Status Publish(const AlarmValue& alarm);

  /// Sends what was published. Call it once a tick, after all of the tick's Publish calls.
  void Flush();

  [[nodiscard]] const PublisherCounters& counters() const;
  [[nodiscard]] std::uint32_t unit_readers() const;  // readers matched with the unit topic now
  /// These readers have acknowledged all that was flushed of it.
  [[nodiscard]] bool acknowledged() const;

  static constexpr std::size_t kAlarmsKept = 1024;

 private:
  class Impl;
  explicit StatusPublisher(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
