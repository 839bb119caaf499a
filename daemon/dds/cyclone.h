// Publisher and reader share these parts of Cyclone DDS: the domain with its configuration,
// entities that delete themselves, the topics' names, and the QoS of both ends.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "daemon/dds/dds_options.h"
#include "protocol/base/result.h"

struct dds_topic_descriptor;

namespace focalfleet::dds_internal {

using Handle = std::int32_t;  // dds_entity_t

inline constexpr const char* kFleetTopic = "focalfleet/fleet_status";
inline constexpr const char* kUnitTopic = "focalfleet/unit_status";
inline constexpr const char* kOrientationTopic = "focalfleet/unit_orientation";
inline constexpr const char* kBusTopic = "focalfleet/bus_status";
inline constexpr const char* kConfigurationTopic = "focalfleet/configuration_progress";
inline constexpr const char* kAlarmTopic = "focalfleet/named_alarm";
inline constexpr const char* kAuditHeadTopic = "focalfleet/audit_head";
inline constexpr const char* kExposureRequestTopic = "focalfleet/exposure_request";
inline constexpr const char* kExposureTopic = "focalfleet/exposure";
inline constexpr const char* kPlaneOrderTopic = "focalfleet/plane_order";
inline constexpr const char* kSectorReportTopic = "focalfleet/sector_report";
inline constexpr const char* kBorderNewsTopic = "focalfleet/border_news";

/// Owns a DDS entity; its destructor deletes the entity and all that was made under it.
class Entity {
 public:
  Entity() = default;
  explicit Entity(Handle handle) : handle_(handle) {}
  Entity(Entity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Entity();
  [[nodiscard]] Handle get() const { return handle_; }

 private:
  Handle handle_ = 0;
};

/// Holds a domain of Cyclone in this process. Without credentials, all participants of a domain
/// share it, and the first one's configuration holds until the last one is gone. With credentials,
/// each participant has one of its own (DdsOptions).
class Domain {
 public:
  static Result<Domain> Acquire(const DdsOptions& options);
  Domain() = default;
  Domain(Domain&& other) noexcept : id_(other.id_), held_(std::exchange(other.held_, false)) {}
  Domain& operator=(Domain&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(held_, other.held_);
    return *this;
  }
  ~Domain();
  [[nodiscard]] std::uint32_t id() const { return id_; }  // within this process

 private:
  std::uint32_t id_ = 0;
  bool held_ = false;
};

/// A participant, and its domain for as long as the participant is there.
class Participant {
 public:
  /// Errors: kUnavailable: also where credentials are missing, do not fit or have ended.
  static Result<Participant> Join(const DdsOptions& options);
  [[nodiscard]] Handle get() const { return entity_.get(); }

 private:
  Domain domain_;
  Entity entity_;
};

/// The error of a DDS call that returned `code` < 0.
[[nodiscard]] tl::unexpected<Error> DdsFailure(const char* what, std::int32_t code);

Result<Handle> MakeTopic(const Participant& participant, const dds_topic_descriptor& type,
                         const char* name);
/// `partition` of a writer or reader, here and below; empty: the one without a name, where daemons
/// of their own are. A reader's may have wildcards.
Result<Handle> MakeWriter(const Participant& participant, Handle topic,
                          const std::string& partition = {});
/// A reader of several partitions, that keeps the last `depth` samples of each instance: a topic
/// without a key has one instance for the daemons of all of them.
Result<Handle> MakeReader(const Participant& participant, Handle topic,
                          const std::vector<std::string>& partitions, std::int32_t depth);
/// A reader that receives each sample from now on, and keeps the last `depth` of them.
Result<Handle> MakeListener(const Participant& participant, Handle topic, std::int32_t depth,
                            const std::string& partition = {});
/// A writer for such readers: nothing is kept for those that join later.
Result<Handle> MakeTalker(const Participant& participant, Handle topic, std::int32_t depth,
                          const std::string& partition = {});

}  // namespace focalfleet::dds_internal
