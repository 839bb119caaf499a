// The publisher of status to DDS, on the status thread. Values that DDS does not take now, because
// a reader lags, are kept and offered again, newest values only. While the domain cannot be joined,
// all values are kept. A reader that joins later receives the whole state at once, and the newest
// alarms.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "daemon/dds/late_join.h"
#include "daemon/dds/status_publisher.h"
#include "daemon/status/status_batch.h"

namespace focalfleet {

class BufferedStatusPublisher {
 public:
  explicit BufferedStatusPublisher(LateJoin<StatusPublisher>::Options options)
      : joined_(std::move(options)) {}

  /// The newest values are published or kept. True: some still wait, and DDS may take them soon.
  bool Publish(const StatusBatch& status);
  void Publish(const AlarmValue& alarm);

  // ---- any thread may ask

  [[nodiscard]] bool joined() const { return joined_.get() != nullptr; }
  /// Readers matched with the unit topic now.
  [[nodiscard]] std::uint32_t unit_readers() const {
    const StatusPublisher* const joined = joined_.get();
    return joined != nullptr ? joined->unit_readers() : 0;
  }
  /// All readers have acknowledged what was published of units.
  [[nodiscard]] bool acknowledged() const {
    const StatusPublisher* const joined = joined_.get();
    return joined != nullptr && joined->acknowledged();
  }
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  /// The newest value of each unit or bus that is not published yet.
  template <class Value>
  class Newest {
   public:
    void Keep(const std::vector<Value>& values) {
      if (values_.empty()) {  // the usual case: all were taken
        values_ = values;
        return;
      }
      if (place_of_.size() != values_.size())
        for (std::size_t i = 0; i < values_.size(); ++i) place_of_[KeyOf(values_[i])] = i;
      for (const Value& value : values) {
        const auto [it, is_new] = place_of_.emplace(KeyOf(value), values_.size());
        if (is_new)
          values_.push_back(value);
        else
          values_[it->second] = value;
      }
    }
    /// The first `count` values are published.
    void DropFirst(std::size_t count) {
      values_.erase(values_.begin(), values_.begin() + static_cast<std::ptrdiff_t>(count));
      place_of_.clear();
    }
    [[nodiscard]] const std::vector<Value>& values() const { return values_; }

   private:
    static std::uint32_t KeyOf(const BusStatusValue& value) { return value.bus.value; }
    template <class OfUnit>
    static std::uint32_t KeyOf(const OfUnit& value) {
      return value.unit.value;
    }
    std::vector<Value> values_;
    std::unordered_map<std::uint32_t, std::size_t>
        place_of_;  // place in values_; empty: not made yet
  };

  void Keep(const StatusBatch& status);
  template <class Value>
  void Offer(Newest<Value>* kept);
  template <class Value>
  void Offer(std::optional<Value>* kept);
  void ReportAlarms();
  void Note(const Status& status);
  void Count();

  LateJoin<StatusPublisher> joined_;
  Newest<UnitStatusValue> units_;
  Newest<UnitOrientationValue> orientations_;
  Newest<BusStatusValue> buses_;
  std::optional<FleetStatusValue> fleet_;
  std::optional<ConfigurationProgressValue> configuration_;
  std::optional<AuditHeadValue> audit_head_;
  std::deque<AlarmValue> alarms_;
  std::string last_error_;
  std::atomic<std::uint64_t> samples_{0};
  std::atomic<std::uint64_t> bytes_{0};
};

}  // namespace focalfleet
