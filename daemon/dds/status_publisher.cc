#include "daemon/dds/status_publisher.h"

#include <dds/dds.h>
#include <dds/ddsc/dds_public_impl.h>

#include <algorithm>
#include <charconv>
#include <deque>

#include "daemon/dds/cyclone.h"
#include "daemon/dds/sample_conversion.h"

namespace focalfleet {

using namespace dds_internal;

namespace {

// The serialised size, with its 4-byte header (XCDR1). Structs whose members are in order of
// falling alignment have no holes but the one at their end. A bounded string is sent as length and
// used bytes.
std::uint64_t PayloadBytes(const focalfleet_UnitStatus&) {
  return 4 + offsetof(focalfleet_UnitStatus, enabled) + 1;
}
std::uint64_t PayloadBytes(const focalfleet_BusStatus&) {
  return 4 + offsetof(focalfleet_BusStatus, link) + 1;
}
std::uint64_t TextBytes(std::uint64_t before, const char* text) {
  return 4 + (before + 3) / 4 * 4 + 4 + std::char_traits<char>::length(text) + 1;
}
std::uint64_t PayloadBytes(const focalfleet_UnitOrientation& sample) {
  return TextBytes(offsetof(focalfleet_UnitOrientation, verdict), sample.verdict);
}
std::uint64_t PayloadBytes(const focalfleet_FleetStatus& sample) {
  return TextBytes(offsetof(focalfleet_FleetStatus, version), sample.version);
}
std::uint64_t PayloadBytes(const focalfleet_ConfigurationProgress& sample) {
  return TextBytes(offsetof(focalfleet_ConfigurationProgress, source), sample.source);
}
std::uint64_t PayloadBytes(const focalfleet_AuditHead& sample) {
  return TextBytes(offsetof(focalfleet_AuditHead, head), sample.head);
}
std::uint64_t PayloadBytes(const focalfleet_NamedAlarm& sample) {
  const std::uint64_t name = TextBytes(offsetof(focalfleet_NamedAlarm, name), sample.name);
  return TextBytes(name - 4, sample.text);  // the header of 4 bytes is there once
}

tl::unexpected<Error> BadCode(const char* of, std::uint64_t id, const char* which) {
  return Fail(ErrorCode::kInvalid, std::string("DDS: ") + of + " " + std::to_string(id) + ": its " +
                                       which + " does not exist");
}

}  // namespace

std::string SectorPartition(std::optional<std::uint32_t> sector) {
  return sector ? "sector-" + std::to_string(*sector) : "sector-*";
}

std::vector<std::string> AllPartitions() { return {"", SectorPartition({}), kPlanePartition}; }

std::optional<std::uint32_t> SectorOfPartition(std::string_view partition) {
  constexpr std::string_view kBefore = "sector-";
  if (!partition.starts_with(kBefore)) return std::nullopt;
  partition.remove_prefix(kBefore.size());
  std::uint32_t sector = 0;
  const auto read = std::from_chars(partition.data(), partition.data() + partition.size(), sector);
  const bool whole = read.ec == std::errc() && read.ptr == partition.data() + partition.size();
  return whole ? std::optional(sector) : std::nullopt;
}

class StatusPublisher::Impl {
 public:
  static Result<std::unique_ptr<Impl>> Create(const DdsOptions& options) {
    auto impl = std::make_unique<Impl>();
    FOCALFLEET_TRY_ASSIGN(impl->participant_, Participant::Join(options));
    // The switch must come after the participant and before the writers: writers made earlier
    // ignore it.
    dds_write_set_batch(true);
    const struct {
      Handle Impl::*writer;
      const dds_topic_descriptor_t* type;
      const char* name;
    } list[] = {
        {&Impl::fleet_writer_, &focalfleet_FleetStatus_desc, kFleetTopic},
        {&Impl::unit_writer_, &focalfleet_UnitStatus_desc, kUnitTopic},
        {&Impl::orientation_writer_, &focalfleet_UnitOrientation_desc, kOrientationTopic},
        {&Impl::bus_writer_, &focalfleet_BusStatus_desc, kBusTopic},
        {&Impl::configuration_writer_, &focalfleet_ConfigurationProgress_desc, kConfigurationTopic},
        {&Impl::alarm_writer_, &focalfleet_NamedAlarm_desc, kAlarmTopic},
        {&Impl::audit_writer_, &focalfleet_AuditHead_desc, kAuditHeadTopic},
    };
    for (const auto& [writer, type, name] : list) {
      FOCALFLEET_TRY_ASSIGN(const Handle topic, MakeTopic(impl->participant_, *type, name));
      FOCALFLEET_TRY_ASSIGN((*impl).*writer,
                            MakeWriter(impl->participant_, topic, options.partition));
    }
    return impl;
  }

  template <class Sample, class Value>
  Result<std::size_t> WriteAll(Handle writer, std::span<const Value> values, const char* of) {
    for (const Value& value : values) {
      if (const char* flaw = Flaw(value)) return BadCode(of, IdOf(value), flaw);
    }
    Sample sample{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      ToSample(values[i], &sample);
      FOCALFLEET_TRY_ASSIGN(const bool taken, Write(writer, sample));
      if (!taken) {
        counters_.deferred += values.size() - i;
        return i;
      }
    }
    return values.size();
  }

  Result<std::size_t> Publish(std::span<const UnitStatusValue> units) {
    return WriteAll<focalfleet_UnitStatus>(unit_writer_, units, "unit");
  }
  Result<std::size_t> Publish(std::span<const UnitOrientationValue> orientations) {
    return WriteAll<focalfleet_UnitOrientation>(orientation_writer_, orientations, "unit");
  }
  Result<std::size_t> Publish(std::span<const BusStatusValue> buses) {
    return WriteAll<focalfleet_BusStatus>(bus_writer_, buses, "bus");
  }

  Status Publish(const FleetStatusValue& fleet) {
    ToSample(fleet, &fleet_);
    fleet_waits_ = true;
    return WriteWaiting();
  }

  Status Publish(const ConfigurationProgressValue& configuration) {
    if (const char* flaw = Flaw(configuration)) {
      return BadCode("configuration", configuration.view.id, flaw);
    }
    ToSample(configuration, &configuration_);
    configuration_waits_ = true;
    return WriteWaiting();
  }

  Status Publish(const AuditHeadValue& audit) {
    ToSample(audit, &audit_);
    audit_waits_ = true;
    return WriteWaiting();
  }

  Status Publish(const AlarmValue& alarm) {
    if (const char* flaw = Flaw(alarm)) return BadCode("alarm", alarm.row.id, flaw);
    const auto same = [&alarm](const focalfleet_NamedAlarm& reported) {
      return reported.alarm_id == alarm.row.id;
    };
    if (std::any_of(alarms_.begin(), alarms_.end(), same)) return {};
    ToSample(alarm, &alarms_.emplace_back());
    if (alarms_.size() > kAlarmsKept) DropOldestAlarm();
    return WriteWaiting();
  }

  void Flush() {
    // The Publish call that met a failure has reported it; what waits is offered again here.
    const Status waiting = WriteWaiting();
    static_cast<void>(waiting);
    for (const Handle writer : {fleet_writer_, unit_writer_, orientation_writer_, bus_writer_,
                                configuration_writer_, alarm_writer_, audit_writer_}) {
      dds_write_flush(writer);
    }
  }

  [[nodiscard]] const PublisherCounters& counters() const { return counters_; }

  [[nodiscard]] std::uint32_t unit_readers() const {
    dds_publication_matched_status_t status{};
    return dds_get_publication_matched_status(unit_writer_, &status) == DDS_RETCODE_OK
               ? status.current_count
               : 0;
  }
  [[nodiscard]] bool acknowledged() const {
    return dds_wait_for_acks(unit_writer_, 0) == DDS_RETCODE_OK;
  }

 private:
  static std::uint64_t IdOf(const UnitStatusValue& value) { return value.unit.value; }
  static std::uint64_t IdOf(const UnitOrientationValue& value) { return value.unit.value; }
  static std::uint64_t IdOf(const BusStatusValue& value) { return value.bus.value; }

  // Writes one sample. False: the writer has no room now, because a reader lags.
  template <class Sample>
  Result<bool> Write(Handle writer, const Sample& sample) {
    const dds_return_t code = dds_write(writer, &sample);
    if (code == DDS_RETCODE_OK) [[likely]] {
      ++counters_.samples;
      counters_.payload_bytes += PayloadBytes(sample);
      return true;
    }
    if (code == DDS_RETCODE_TIMEOUT) return false;
    return DdsFailure("write", code);
  }

  // Writes single values and alarms, which no reader may miss. A sample that finds no room waits
  // for the next Flush.
  Status WriteWaiting() {
    if (fleet_waits_) {
      FOCALFLEET_TRY_ASSIGN(const bool taken, Write(fleet_writer_, fleet_));
      fleet_waits_ = !taken;
    }
    if (configuration_waits_) {
      FOCALFLEET_TRY_ASSIGN(const bool taken, Write(configuration_writer_, configuration_));
      configuration_waits_ = !taken;
    }
    if (audit_waits_) {
      FOCALFLEET_TRY_ASSIGN(const bool taken, Write(audit_writer_, audit_));
      audit_waits_ = !taken;
    }
    while (alarms_written_ < alarms_.size()) {
      FOCALFLEET_TRY_ASSIGN(const bool taken, Write(alarm_writer_, alarms_[alarms_written_]));
      if (!taken) break;
      ++alarms_written_;
    }
    return {};
  }

  // Readers that have the alarm keep it; readers that join later do not get it any more.
  void DropOldestAlarm() {
    if (alarms_written_ > 0) {
      dds_unregister_instance(alarm_writer_, &alarms_.front());
      --alarms_written_;
    }
    alarms_.pop_front();
  }

  Participant participant_;
  Handle fleet_writer_ = 0;
  Handle unit_writer_ = 0;
  Handle orientation_writer_ = 0;
  Handle bus_writer_ = 0;
  Handle configuration_writer_ = 0;
  Handle alarm_writer_ = 0;
  Handle audit_writer_ = 0;

  focalfleet_FleetStatus fleet_{};
  focalfleet_ConfigurationProgress configuration_{};
  focalfleet_AuditHead audit_{};
  bool fleet_waits_ = false;
  bool configuration_waits_ = false;
  bool audit_waits_ = false;
  std::deque<focalfleet_NamedAlarm> alarms_;  // the newest kAlarmsKept
  std::size_t alarms_written_ = 0;            // number of these written, from the front
  PublisherCounters counters_;
};

StatusPublisher::StatusPublisher(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
StatusPublisher::~StatusPublisher() = default;

Result<std::unique_ptr<StatusPublisher>> StatusPublisher::Create(const DdsOptions& options) {
  FOCALFLEET_TRY_ASSIGN(auto impl, Impl::Create(options));
  return std::unique_ptr<StatusPublisher>(new StatusPublisher(std::move(impl)));
}

Result<std::size_t> StatusPublisher::Publish(std::span<const UnitStatusValue> units) {
  return impl_->Publish(units);
}
Result<std::size_t> StatusPublisher::Publish(std::span<const UnitOrientationValue> orientations) {
  return impl_->Publish(orientations);
}
Result<std::size_t> StatusPublisher::Publish(std::span<const BusStatusValue> buses) {
  return impl_->Publish(buses);
}
Status StatusPublisher::Publish(const FleetStatusValue& fleet) { return impl_->Publish(fleet); }
Status StatusPublisher::Publish(const ConfigurationProgressValue& configuration) {
  return impl_->Publish(configuration);
}
Status StatusPublisher::Publish(const AuditHeadValue& audit) { return impl_->Publish(audit); }
Status StatusPublisher::Publish(const AlarmValue& alarm) { return impl_->Publish(alarm); }
void StatusPublisher::Flush() { impl_->Flush(); }
const PublisherCounters& StatusPublisher::counters() const { return impl_->counters(); }
std::uint32_t StatusPublisher::unit_readers() const { return impl_->unit_readers(); }
bool StatusPublisher::acknowledged() const { return impl_->acknowledged(); }

}  // namespace focalfleet
