// A publisher of status whose participant of DDS can be made anew, as new credentials ask for. The
// new participant joins beside the old one, and both publish until each reader of the old one also
// reads the new one. Only then the old one leaves, so readers miss nothing. While both publish,
// readers get each value twice. A reader with many values outstanding may have got the last one
// from the old participant, so the new one publishes the whole state once more. DDS cuts the old
// participant off when its credentials end: then it leaves in any case.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/dds/late_join.h"
#include "daemon/status/buffered_status_publisher.h"
#include "daemon/status/status_batch.h"

namespace focalfleet {

class RenewingStatusPublisher {
 public:
  struct Options {
    LateJoin<StatusPublisher>::Options join;  // used anew for each participant
    bool renews = false;                      // Renew may be called: the state is kept for that
    HostClock clock = HostClock();            // of real time
    /// The old participant leaves when all readers have been there for so long, the lease of DDS:
    /// a reader that was lost in between is not counted any more.
    DurationNs settled = Milliseconds(2000);
  };
  explicit RenewingStatusPublisher(Options options);

  /// As BufferedStatusPublisher.
  bool Publish(const StatusBatch& status);
  void Publish(const AlarmValue& alarm);

  // ---- any thread may call

  /// A new participant joins beside the present one at the next Publish, and takes its place. The
  /// credentials of the present one end at `end`.
  void Renew(WallTime end) {
    asked_end_ns_ = end.ns;
    asked_ = true;
  }
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  /// The newest value of each unit or bus.
  template <class Value>
  struct Latest {
    std::vector<Value> values;
    std::unordered_map<std::uint32_t, std::size_t> place_of;
    void Keep(const std::vector<Value>& newer, std::uint32_t (*key)(const Value&));
  };

  void Remember(const StatusBatch& status);
  [[nodiscard]] StatusBatch WholeState() const;
  void RenewIfAsked();
  void HandOverIfFollowed();
  void Count();

  Options options_;
  std::unique_ptr<BufferedStatusPublisher> current_;
  std::unique_ptr<BufferedStatusPublisher> next_;  // none: nothing is being renewed
  WallTime end_;  // of the credentials of current_, where there is a next_
  std::optional<HostInstant> followed_since_;  // all readers have followed to next_
  Latest<UnitStatusValue> units_;
  Latest<UnitOrientationValue> orientations_;
  Latest<BusStatusValue> buses_;
  StatusBatch rest_;  // fleet, configuration, head of the audit
  std::deque<AlarmValue> alarms_;
  std::atomic<bool> asked_{false};
  std::atomic<std::int64_t> asked_end_ns_{0};
  std::uint64_t earlier_samples_ = 0;  // of participants that are gone
  std::uint64_t earlier_bytes_ = 0;
  std::atomic<std::uint64_t> samples_{0};
  std::atomic<std::uint64_t> bytes_{0};
};

}  // namespace focalfleet
