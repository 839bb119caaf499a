// A publisher of status whose participant of DDS can be made anew, as new credentials ask for.
// Cyclone DDS keeps one set of permissions for each domain and process: those of the first
// participant, for as long as any participant is there. The old participant therefore leaves before
// the new one joins. Readers miss some seconds, the time of a handshake, and then get the whole
// state. Where the same process has another participant in the domain (a camera over DDS), the old
// permissions stay in force until the process ends.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
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
  void RenewIfAsked();
  void Count();

  Options options_;
  std::unique_ptr<BufferedStatusPublisher> current_;
  Latest<UnitStatusValue> units_;
  Latest<UnitOrientationValue> orientations_;
  Latest<BusStatusValue> buses_;
  StatusBatch rest_;  // fleet, configuration, head of the audit
  std::deque<AlarmValue> alarms_;
  std::atomic<bool> asked_{false};
  std::uint64_t earlier_samples_ = 0;  // of participants that are gone
  std::uint64_t earlier_bytes_ = 0;
  std::atomic<std::uint64_t> samples_{0};
  std::atomic<std::uint64_t> bytes_{0};
};

}  // namespace focalfleet
