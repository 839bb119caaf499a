#include "daemon/dds/cyclone.h"

#include <dds/dds.h>
#include <dds/ddsrt/log.h>

#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "daemon/access/log_limit.h"
#include "daemon/dds/credentials.h"
#include "daemon/dds/loopback_config.h"

namespace focalfleet::dds_internal {
namespace {

// A killed daemon is noticed after this time. 500 ms works on an idle machine. While a machine
// plans for 5000 units on all its cores, Cyclone's lease thread may wait that long. A living daemon
// must not look dead.
constexpr dds_duration_t kLease = DDS_MSECS(2000);

struct Held {
  dds_entity_t entity = 0;
  std::uint32_t users = 0;
};
struct Domains {
  std::mutex mutex;
  std::map<std::uint32_t, Held> held;
};
// The table mirrors what Cyclone itself keeps once for each process.
Domains& TheDomains() {
  static Domains domains;
  return domains;
}

struct DeleteQos {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};

using QosOwner = std::unique_ptr<dds_qos_t, DeleteQos>;

void SetPartition(const std::string& partition, dds_qos_t* qos) {
  if (!partition.empty()) dds_qset_partition1(qos, partition.c_str());
}

/// For messages that are said now, to those who are there.
QosOwner PassingQos(std::int32_t depth, const std::string& partition) {
  QosOwner qos(dds_create_qos());
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  SetPartition(partition, qos.get());
  return qos;
}

/// For states: readers that join later get the last one of each instance.
QosOwner SharedQos(const std::string& partition) {
  QosOwner qos(dds_create_qos());
  // The blocking time is 0: a writer whose readers lag refuses the sample, and the tick goes on.
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, 1);
  dds_qset_liveliness(qos.get(), DDS_LIVELINESS_AUTOMATIC, kLease);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  SetPartition(partition, qos.get());
  return qos;
}

/// Each refused participant would cause two lines a second on stderr: strangers could fill a disk.
void WriteLogLine(void* /*unused*/, const dds_log_data_t* line) {
  static std::mutex mutex;
  static LogLimit limit(30);
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  std::string text(line->message, line->size);
  while (text.ends_with('\n')) text.pop_back();
  const std::lock_guard lock(mutex);
  text = limit.Admit({std::chrono::nanoseconds(now).count()}, text);
  if (!text.empty()) std::fprintf(stderr, "%s\n", text.c_str());
}

/// Cyclone merges the fragments of a list.
std::string ConfigurationOf(const DdsOptions& options, std::uint32_t id) {
  std::string xml = options.config_xml.empty() ? kLoopbackConfig : options.config_xml;
  if (id != options.domain)
    xml += ",<Discovery><ExternalDomainId>" + std::to_string(options.domain) +
           "</ExternalDomainId></Discovery>";
  return xml;
}

}  // namespace

Entity::~Entity() {
  if (handle_ > 0) dds_delete(handle_);
}

tl::unexpected<Error> DdsFailure(const char* what, std::int32_t code) {
  return Fail(ErrorCode::kUnavailable,
              std::string("DDS: cannot ") + what + ": " + dds_strretcode(-code));
}

Result<Domain> Domain::Acquire(const DdsOptions& options) {
  Domains& domains = TheDomains();
  const std::lock_guard lock(domains.mutex);
  std::uint32_t id = options.domain;
  if (!options.security.empty() && domains.held[id].users > 0) {
    id = kDomainBesideFirst;
    while (id <= kDomainBesideLast && domains.held[id].users > 0) ++id;
    if (id > kDomainBesideLast)
      return Fail(ErrorCode::kUnavailable,
                  "DDS: this process has too many participants with credentials");
  }
  Held& held = domains.held[id];
  if (held.users == 0) {
    dds_set_log_sink(&WriteLogLine, nullptr);
    held.entity = dds_create_domain(id, ConfigurationOf(options, id).c_str());
    if (held.entity < 0)
      return DdsFailure("set up the domain (see its own message on stderr)",
                        std::exchange(held.entity, 0));
  }
  ++held.users;
  Domain domain;
  domain.id_ = id;
  domain.held_ = true;
  return domain;
}

Domain::~Domain() {
  if (!held_) return;
  Domains& domains = TheDomains();
  const std::lock_guard lock(domains.mutex);
  Held& held = domains.held[id_];
  if (--held.users == 0 && held.entity > 0) dds_delete(std::exchange(held.entity, 0));
}

Result<Participant> Participant::Join(const DdsOptions& options) {
  Participant participant;
  FOCALFLEET_TRY_ASSIGN(participant.domain_, Domain::Acquire(options));
  QosOwner qos;
  if (!options.security.empty()) {
    qos.reset(dds_create_qos());
    for (const auto& [name, value] : SecurityProperties(options.security))
      dds_qset_prop(qos.get(), name.c_str(), value.c_str());
  }
  const dds_entity_t entity = dds_create_participant(participant.domain_.id(), qos.get(), nullptr);
  if (entity < 0) return DdsFailure("join the domain", entity);
  participant.entity_ = Entity(entity);
  return participant;
}

namespace {

Result<Handle> WriterWith(const QosOwner& qos, const Participant& participant, Handle topic) {
  const dds_entity_t writer = dds_create_writer(participant.get(), topic, qos.get(), nullptr);
  if (writer < 0) return DdsFailure("make a writer", writer);
  return writer;
}

Result<Handle> ReaderWith(const QosOwner& qos, const Participant& participant, Handle topic) {
  const dds_entity_t reader = dds_create_reader(participant.get(), topic, qos.get(), nullptr);
  if (reader < 0) return DdsFailure("make a reader", reader);
  return reader;
}

}  // namespace

Result<Handle> MakeTopic(const Participant& participant, const dds_topic_descriptor& type,
                         const char* name) {
  const dds_entity_t topic = dds_create_topic(participant.get(), &type, name, nullptr, nullptr);
  if (topic < 0) return DdsFailure(name, topic);
  return topic;
}

Result<Handle> MakeWriter(const Participant& participant, Handle topic,
                          const std::string& partition) {
  return WriterWith(SharedQos(partition), participant, topic);
}

Result<Handle> MakeReader(const Participant& participant, Handle topic,
                          const std::vector<std::string>& partitions, std::int32_t depth) {
  const QosOwner qos = SharedQos({});
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  std::vector<const char*> names;
  for (const std::string& name : partitions) names.push_back(name.c_str());
  if (!names.empty())
    dds_qset_partition(qos.get(), static_cast<std::uint32_t>(names.size()), names.data());
  return ReaderWith(qos, participant, topic);
}

Result<Handle> MakeListener(const Participant& participant, Handle topic, std::int32_t depth,
                            const std::string& partition) {
  return ReaderWith(PassingQos(depth, partition), participant, topic);
}

Result<Handle> MakeTalker(const Participant& participant, Handle topic, std::int32_t depth,
                          const std::string& partition) {
  return WriterWith(PassingQos(depth, partition), participant, topic);
}

}  // namespace focalfleet::dds_internal
