#include "daemon/dds/status_reader.h"

#include <dds/dds.h>

#include <array>
#include <map>
#include <utility>

#include "daemon/dds/cyclone.h"
#include "daemon/dds/sample_conversion.h"
#include "protocol/base/limits.h"

namespace focalfleet {

using namespace dds_internal;

namespace {

/// The depth of topics whose instances all sectors share.
constexpr auto kSectorsMax = static_cast<std::int32_t>(limits::kSectors);

}  // namespace

class StatusReader::Impl {
 public:
  static Result<std::unique_ptr<Impl>> Create(const Options& options) {
    auto impl = std::make_unique<Impl>();
    impl->partitions_ = options.partitions;
    if (options.partitions.empty() && !options.dds.partition.empty())
      impl->partitions_ = {options.dds.partition};
    impl->several_ = !options.partitions.empty();
    const std::int32_t depth = impl->several_ ? kSectorsMax : 1;
    FOCALFLEET_TRY_ASSIGN(impl->participant_, Participant::Join(options.dds));
    const dds_entity_t waitset = dds_create_waitset(impl->participant_.get());
    if (waitset < 0) return DdsFailure("make a waitset", waitset);
    impl->waitset_ = waitset;
    FOCALFLEET_TRY_ASSIGN(impl->fleet_,
                          impl->Open(focalfleet_FleetStatus_desc, kFleetTopic, depth));
    FOCALFLEET_TRY_ASSIGN(impl->configuration_, impl->Open(focalfleet_ConfigurationProgress_desc,
                                                           kConfigurationTopic, depth));
    FOCALFLEET_TRY_ASSIGN(impl->buses_, impl->Open(focalfleet_BusStatus_desc, kBusTopic));
    FOCALFLEET_TRY_ASSIGN(impl->alarms_,
                          impl->Open(focalfleet_NamedAlarm_desc, kAlarmTopic, depth));
    FOCALFLEET_TRY_ASSIGN(impl->audit_,
                          impl->Open(focalfleet_AuditHead_desc, kAuditHeadTopic, depth));
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
    out->fleets.clear();
    out->configuration.reset();
    out->configurations.clear();
    out->units.clear();
    out->orientations.clear();
    out->buses.clear();
    out->alarms.clear();
    out->audit_head.reset();
    out->audit_heads.clear();
    out->malformed = 0;
    FOCALFLEET_TRY((DrainDaemons<focalfleet_FleetStatus>(fleet_, out, &out->fleets)));
    FOCALFLEET_TRY((
        DrainDaemons<focalfleet_ConfigurationProgress>(configuration_, out, &out->configurations)));
    FOCALFLEET_TRY((DrainDaemons<focalfleet_AuditHead>(audit_, out, &out->audit_heads)));
    if (!out->fleets.empty()) out->fleet = out->fleets.back();
    if (!out->configurations.empty()) out->configuration = out->configurations.back();
    if (!out->audit_heads.empty()) out->audit_head = out->audit_heads.back();
    FOCALFLEET_TRY((Drain<focalfleet_BusStatus, BusStatusValue>(
        buses_, out,
        [out](BusStatusValue value, const dds_sample_info_t&) { out->buses.push_back(value); })));
    FOCALFLEET_TRY((Drain<focalfleet_NamedAlarm, AlarmValue>(
        alarms_, out, [&](AlarmValue value, const dds_sample_info_t& info) {
          if (FindSector(alarms_, info, &value.sector)) out->alarms.push_back(std::move(value));
        })));
    if (units_ == 0) return {};
    FOCALFLEET_TRY((Drain<focalfleet_UnitOrientation, UnitOrientationValue>(
        orientations_, out, [out](UnitOrientationValue value, const dds_sample_info_t&) {
          out->orientations.push_back(std::move(value));
        })));
    return Drain<focalfleet_UnitStatus, UnitStatusValue>(
        units_, out, [out](const UnitStatusValue& value, const dds_sample_info_t&) {
          out->units.push_back(value);
        });
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
  Result<Handle> Open(const dds_topic_descriptor_t& type, const char* name,
                      std::int32_t depth = 1) {
    FOCALFLEET_TRY_ASSIGN(const Handle topic, MakeTopic(participant_, type, name));
    FOCALFLEET_TRY_ASSIGN(const Handle reader, MakeReader(participant_, topic, partitions_, depth));
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
          sink(std::move(value), infos[i]);
        } else {
          ++out->malformed;
        }
      }
      const dds_return_t returned = dds_return_loan(reader, samples.data(), count);
      if (returned < 0) return DdsFailure("return a loan", returned);
    }
  }

  /// The sector whose daemon wrote the sample. False: the writer has left, and nobody knows. Cost:
  /// a question to DDS for each new writer.
  bool FindSector(Handle reader, const dds_sample_info_t& info, SectorOfValue* sector) {
    if (!several_) return true;
    const auto at = sectors_.find(info.publication_handle);
    if (at != sectors_.end()) {
      *sector = at->second;
      return true;
    }
    dds_builtintopic_endpoint_t* const writer =
        dds_get_matched_publication_data(reader, info.publication_handle);
    if (writer == nullptr) return false;
    std::uint32_t count = 0;
    char** names = nullptr;
    if (dds_qget_partition(writer->qos, &count, &names)) {
      if (count == 1) *sector = SectorOfPartition(names[0]);
      for (std::uint32_t n = 0; n < count; ++n) dds_free(names[n]);
      dds_free(names);
    }
    dds_builtintopic_free_endpoint(writer);
    sectors_.emplace(info.publication_handle, *sector);
    return true;
  }

  /// The values of a topic that each daemon has once: the newest of each.
  template <class Sample, class Value>
  Status DrainDaemons(Handle reader, StatusUpdate* out, std::vector<Value>* values) {
    return Drain<Sample, Value>(reader, out, [&](Value value, const dds_sample_info_t& info) {
      if (!FindSector(reader, info, &value.sector)) return;
      std::erase_if(*values, [&](const Value& one) { return one.sector == value.sector; });
      values->push_back(std::move(value));
    });
  }

  std::vector<std::string> partitions_;
  bool several_ = false;
  std::map<dds_instance_handle_t, SectorOfValue> sectors_;  // of each writer
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
