// A publisher of status whose participant of DDS can be made anew without a gap, as new credentials
// ask for. The new participant joins beside the old one and gets the whole state. Both publish
// until readers have surely found the new one, then the old one leaves. A new one that cannot join
// keeps trying, and the old one stays.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "daemon/dds/late_join.h"
#include "daemon/status/buffered_status_publisher.h"
#include "daemon/status/status_batch.h"

namespace focalfleet {

class RenewingStatusPublisher {
 public:
  struct Options {
    LateJoin<StatusPublisher>::Options join;  // used anew for each participant
    bool renews = false;                      // Renew may be called: the state is kept for that
    /// Readers find a new participant within a second, on a busy host within some. A participant
    /// that is lost is forgotten after 10 s.
    std::chrono::milliseconds overlap{15'000};
    std::function<std::chrono::steady_clock::time_point()> now = &std::chrono::steady_clock::now;
  };
  explicit RenewingStatusPublisher(Options options);

  /// As BufferedStatusPublisher.
  bool Publish(const StatusBatch& status);
  void Publish(const AlarmValue& alarm);

  // ---- any thread may call

  /// A new participant takes the place of the present one from the next Publish on.
  void Renew() { asked_ = true; }
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
  void Turn();
  void Count();

  Options options_;
  std::unique_ptr<BufferedStatusPublisher> current_;
  std::unique_ptr<BufferedStatusPublisher> next_;                   // none: no renewal is under way
  std::optional<std::chrono::steady_clock::time_point> joined_at_;  // of next_
  Latest<UnitStatusValue> units_;
  Latest<UnitOrientationValue> orientations_;
  Latest<BusStatusValue> buses_;
  StatusBatch rest_;  // fleet and configuration
  std::deque<AlarmValue> alarms_;
  std::atomic<bool> asked_{false};
  std::uint64_t earlier_samples_ = 0;  // of participants that are gone
  std::uint64_t earlier_bytes_ = 0;
  std::atomic<std::uint64_t> samples_{0};
  std::atomic<std::uint64_t> bytes_{0};
};

}  // namespace focalfleet
