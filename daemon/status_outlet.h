// The way of status to DDS, on the store's thread: what the publisher does not take now (a reader
// lags) is kept, newest values only, and offered again.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "daemon/dds/status_publisher.h"
#include "daemon/store_thread.h"

namespace focalfleet {

class StatusOutlet {
 public:
  explicit StatusOutlet(std::unique_ptr<StatusPublisher> publisher)
      : publisher_(std::move(publisher)) {}

  /// True: some units still wait to be taken.
  bool Publish(const StatusBatch& status);
  void Publish(const AlarmValue& alarm);

  // Any thread.
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  void Keep(const std::vector<UnitStatusValue>& units);
  void Note(const Status& status);
  void Count();

  std::unique_ptr<StatusPublisher> publisher_;
  std::vector<UnitStatusValue> units_;                // not taken yet
  std::unordered_map<UnitId, std::size_t> place_of_;  // in units_
  std::string last_error_;
  std::atomic<std::uint64_t> samples_{0};
  std::atomic<std::uint64_t> bytes_{0};
};

}  // namespace focalfleet
