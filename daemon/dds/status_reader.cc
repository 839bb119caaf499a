#include "daemon/dds/status_reader.h"

#include <dds/dds.h>

#include <array>

#include "daemon/dds/cyclone.h"
#include "daemon/dds/sample_conversion.h"

namespace focalfleet {

using namespace dds_internal;

class StatusReader::Impl {
 public:
  static Result<std::unique_ptr<Impl>> Create(const Options& options) {
    auto impl = std::make_unique<Impl>();
    impl->partition_ = options.dds.partition;
    FOCALFLEET_TRY_ASSIGN(impl->participant_, Participant::Join(options.dds));
    const dds_entity_t waitset = dds_create_waitset(impl->participant_.get());
    if (waitset < 0) return DdsFailure("make a waitset", waitset);
    impl->waitset_ = waitset;
    FOCALFLEET_TRY_ASSIGN(impl->fleet_, impl->Open(focalfleet_FleetStatus_desc, kFleetTopic));
    FOCALFLEET_TRY_ASSIGN(impl->configuration_,
                          impl->Open(focalfleet_ConfigurationProgress_desc, kConfigurationTopic));
    FOCALFLEET_TRY_ASSIGN(impl->buses_, impl->Open(focalfleet_BusStatus_desc, kBusTopic));
    FOCALFLEET_TRY_ASSIGN(impl->alarms_, impl->Open(focalfleet_NamedAlarm_desc, kAlarmTopic));
    FOCALFLEET_TRY_ASSIGN(impl->audit_, impl->Open(focalfleet_AuditHead_desc, kAuditHeadTopic));
    if (options.units) {
      FOCALFLEET_TRY_ASSIGN(impl->units_, impl->Open(focalfleet_UnitStatus_desc, kUnitTopic));
      FOCALFLEET_TRY_ASSIGN(impl->orientations_,
                            impl->Open(focalfleet_UnitOrientation_desc, kOrientationTopic));
    }
    // The fleet topic also shows whether a daemon is there.
    const dds_return_t code = dds_set_status_mask(
        impl->fleet_, DDS_LIVELINESS_CHANGED_STATUS | DDS_SUBSCRIPTION_MATCHED_STATUS);
    if (code < 0) return DdsFailure("watch the daemon", code);
    const dds_return_t attached = dds_waitset_attach(waitset, impl->fleet_, impl->fleet_);
    if (attached < 0) return DdsFailure("watch the daemon", attached);
    return impl;
  }

  Result<bool> Wait(std::chrono::milliseconds timeout) {
    std::array<dds_attach_t, 8> triggered{};
    const dds_return_t count =
        dds_waitset_wait(waitset_, triggered.data(), triggered.size(), DDS_MSECS(timeout.count()));
    if (count < 0) return DdsFailure("wait", count);
    // Reading the status resets it; otherwise the next wait would return at once for the same
    // change.
    dds_liveliness_changed_status_t liveliness{};
    dds_get_liveliness_changed_status(fleet_, &liveliness);
    dds_subscription_matched_status_t matched{};
    dds_get_subscription_matched_status(fleet_, &matched);
    return count > 0;
  }

  Status Take(StatusUpdate* out) {
    out->fleet.reset();
    out->configuration.reset();
    out->units.clear();
    out->orientations.clear();
    out->buses.clear();
    out->alarms.clear();
    out->audit_head.reset();
    out->malformed = 0;
    FOCALFLEET_TRY((Drain<focalfleet_FleetStatus, FleetStatusValue>(
        fleet_, out, [out](FleetStatusValue value) { out->fleet = std::move(value); })));
    FOCALFLEET_TRY((Drain<focalfleet_ConfigurationProgress, ConfigurationProgressValue>(
        configuration_, out,
        [out](ConfigurationProgressValue value) { out->configuration = std::move(value); })));
    FOCALFLEET_TRY((Drain<focalfleet_BusStatus, BusStatusValue>(
        buses_, out, [out](BusStatusValue value) { out->buses.push_back(value); })));
    FOCALFLEET_TRY((Drain<focalfleet_NamedAlarm, AlarmValue>(
        alarms_, out, [out](AlarmValue value) { out->alarms.push_back(std::move(value)); })));
    FOCALFLEET_TRY((Drain<focalfleet_AuditHead, AuditHeadValue>(
        audit_, out, [out](AuditHeadValue value) { out->audit_head = std::move(value); })));
    if (units_ == 0) return {};
    FOCALFLEET_TRY((Drain<focalfleet_UnitOrientation, UnitOrientationValue>(
        orientations_, out,
        [out](UnitOrientationValue value) { out->orientations.push_back(std::move(value)); })));
    return Drain<focalfleet_UnitStatus, UnitStatusValue>(
        units_, out, [out](const UnitStatusValue& value) { out->units.push_back(value); });
  }

  [[nodiscard]] bool writer_alive() const {
    dds_liveliness_changed_status_t status{};
    return dds_get_liveliness_changed_status(fleet_, &status) == DDS_RETCODE_OK &&
           status.alive_count > 0;
  }

  [[nodiscard]] bool writer_seen() const {
    dds_subscription_matched_status_t status{};
    return dds_get_subscription_matched_status(fleet_, &status) == DDS_RETCODE_OK &&
           status.total_count > 0;
  }

 private:
  Result<Handle> Open(const dds_topic_descriptor_t& type, const char* name) {
    FOCALFLEET_TRY_ASSIGN(const Handle topic, MakeTopic(participant_, type, name));
    FOCALFLEET_TRY_ASSIGN(const Handle reader, MakeReader(participant_, topic, partition_));
    const dds_entity_t condition = dds_create_readcondition(reader, DDS_ANY_STATE);
    if (condition < 0) return DdsFailure("make a condition", condition);
    const dds_return_t code = dds_waitset_attach(waitset_, condition, condition);
    if (code < 0) return DdsFailure("attach a condition", code);
    return reader;
  }

  template <class Sample, class Value, class Sink>
  static Status Drain(Handle reader, StatusUpdate* out, Sink sink) {
    constexpr std::size_t kBatch = 256;
    std::array<void*, kBatch> samples;
    std::array<dds_sample_info_t, kBatch> infos;
    for (;;) {
      samples[0] = nullptr;  // null asks Cyclone for a loan
      const dds_return_t count = dds_take(reader, samples.data(), infos.data(), kBatch, kBatch);
      if (count < 0) return DdsFailure("take", count);
      if (count == 0) return {};
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        if (!infos[i].valid_data) continue;  // notice of an instance's end, without a value
        Value value;
        if (FromSample(*static_cast<const Sample*>(samples[i]), &value)) {
          sink(std::move(value));
        } else {
          ++out->malformed;
        }
      }
      const dds_return_t returned = dds_return_loan(reader, samples.data(), count);
      if (returned < 0) return DdsFailure("return a loan", returned);
    }
  }

  std::string partition_;
  Participant participant_;
  Handle waitset_ = 0;
  Handle fleet_ = 0;
  Handle configuration_ = 0;
  Handle buses_ = 0;
  Handle alarms_ = 0;
  Handle audit_ = 0;
  Handle units_ = 0;  // 0: not wanted
  Handle orientations_ = 0;
};

StatusReader::StatusReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
StatusReader::~StatusReader() = default;

Result<std::unique_ptr<StatusReader>> StatusReader::Create(const Options& options) {
  FOCALFLEET_TRY_ASSIGN(auto impl, Impl::Create(options));
  return std::unique_ptr<StatusReader>(new StatusReader(std::move(impl)));
}

Result<bool> StatusReader::Wait(std::chrono::milliseconds timeout) { return impl_->Wait(timeout); }
Status StatusReader::Take(StatusUpdate* out) { return impl_->Take(out); }
bool StatusReader::writer_alive() const { return impl_->writer_alive(); }
bool StatusReader::writer_seen() const { return impl_->writer_seen(); }

}  // namespace focalfleet
