// Publisher and reader share these parts of Cyclone DDS: the domain with its configuration,
// entities that delete themselves, the topics' names, and the QoS of both ends.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

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

/// Holds a domain in this process. Cyclone configures a domain once for each process, so publisher
/// and reader of one process share it. The first one's configuration holds until the last one is
/// gone.
class Domain {
 public:
  static Result<Domain> Acquire(std::uint32_t id, const std::string& config_xml);
  Domain() = default;
  Domain(Domain&& other) noexcept : id_(other.id_), held_(std::exchange(other.held_, false)) {}
  Domain& operator=(Domain&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(held_, other.held_);
    return *this;
  }
  ~Domain();

 private:
  std::uint32_t id_ = 0;
  bool held_ = false;
};

/// The error of a DDS call that returned `code` < 0.
[[nodiscard]] tl::unexpected<Error> DdsFailure(const char* what, std::int32_t code);

/// `security` is a folder of credentials (credentials.h); empty: without DDS Security. Errors:
/// kUnavailable: also where credentials are missing, do not fit or have ended.
Result<Entity> MakeParticipant(std::uint32_t domain, const std::string& security);
Result<Handle> MakeTopic(const Entity& participant, const dds_topic_descriptor& type,
                         const char* name);
Result<Handle> MakeWriter(const Entity& participant, Handle topic);
Result<Handle> MakeReader(const Entity& participant, Handle topic);
/// A reader that receives each sample from now on, and keeps the last `depth` of them.
Result<Handle> MakeListener(const Entity& participant, Handle topic, std::int32_t depth);

}  // namespace focalfleet::dds_internal
