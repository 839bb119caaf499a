// The daemon's voice on DDS. Six topics, each keeping its last state for those who join late; the
// last value wins and nothing waits: a reader that does not read costs the others nothing and the
// daemon no time.
//
// The figures that shape it (5000 units at 10 Hz, one reader, CPU of this process): one packet a
// sample 14.5 s per 1000 updates, packed 6.6 s. So writes are packed (Cyclone: write batching, a
// switch of the whole process that only takes hold of writers made after it) and leave at Flush, or
// when a packet is full. docs/adr/0006-dds-topics.md has topics and QoS; focalfleet.idl has the
// types and their codes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "daemon/dds/status_values.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct DdsOptions {
  std::uint32_t domain = 0;
  /// Cyclone's configuration as XML or as file:// URI. Empty: that of deploy/cyclonedds.xml, which
  /// speaks on the loopback interface only. The environment is not asked: CYCLONEDDS_URI decides
  /// where status goes only for a program that hands it over here.
  std::string config_xml;
};

struct PublisherCounters {
  std::uint64_t samples = 0;
  std::uint64_t payload_bytes = 0;  // serialised samples, without RTPS and UDP headers
  std::uint64_t deferred = 0;       // refused for lack of room; the caller offers them again
};

class StatusPublisher {
 public:
  /// Errors: kUnavailable: no such interface, port or configuration; says what Cyclone says.
  static Result<std::unique_ptr<StatusPublisher>> Create(const DdsOptions& options);
  StatusPublisher(const StatusPublisher&) = delete;
  StatusPublisher& operator=(const StatusPublisher&) = delete;
  ~StatusPublisher();

  /// How many of `units` were taken, from the front; they leave at Flush. With keep-last, Cyclone
  /// 0.10.2 takes all: a reader that lags misses values in between, never the last one. A DDS that
  /// refuses for lack of room would take fewer; offer the rest again, or newer values of them.
  /// Errors (of every Publish): kInvalid: a code outside its enum, named, nothing was written;
  /// kUnavailable: DDS failed.
  /// Cost: no allocation of ours.
  Result<std::size_t> Publish(std::span<const UnitStatusValue> units);
  Result<std::size_t> Publish(std::span<const UnitOrientationValue> orientations);
  Result<std::size_t> Publish(std::span<const BusStatusValue> buses);
  Status Publish(const FleetStatusValue& fleet);
  Status Publish(const ConfigurationProgressValue& configuration);
  /// Each alarm is an instance of its own, so a reader sees each once. The newest kAlarmsKept stay
  /// for late joiners.
  Status Publish(const AlarmValue& alarm);

  /// What was published is on its way. Once a tick, after all of the tick's Publish calls.
  void Flush();

  [[nodiscard]] const PublisherCounters& counters() const;
  [[nodiscard]] std::uint32_t unit_readers() const;  // matched with the unit topic now

  static constexpr std::size_t kAlarmsKept = 1024;

 private:
  class Impl;
  explicit StatusPublisher(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
