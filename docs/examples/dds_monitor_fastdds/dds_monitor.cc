// Prints the state of each unit that focalfleetd publishes over DDS: once on joining, then with
// each change. When all units of the fleet were seen, the program says so.
//
//   dds_monitor_fastdds [DOMAIN] [--once] [--wait SECONDS] [--credentials FOLDER]
//
// With --once the program ends when all were seen (exit code 0), or after the wait (1). The folder
// of credentials is one that deploy/dds-security/make-keys made for a monitor.

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fastdds/dds/core/LoanableSequence.hpp>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <filesystem>
#include <memory>
#include <set>
#include <string>

#include "focalfleetPubSubTypes.h"  // made by fastddsgen from focalfleet.idl

namespace {

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastdds::rtps;
using Clock = std::chrono::steady_clock;

// The fleet has at most 32,768 units; Fast DDS would keep 10 of them by default.
constexpr int kUnitsMax = 32'768;
constexpr int kSamplesPerTake = 4096;  // 32 by default

const char* PhaseName(unsigned phase) {
  constexpr std::array names = {"absent",     "identifying", "foreign", "ready",  "staging",
                                "confirming", "arming",      "armed",   "moving", "homing",
                                "settling",   "fault",       "silent"};
  // A code that is not known comes from a later version.
  return phase < names.size() ? names[phase] : "of a later version";
}

template <class T>
T* Check(T* made, const char* what) {
  if (made != nullptr) return made;
  std::fprintf(stderr, "dds_monitor_fastdds: %s cannot be made\n", what);
  std::exit(1);
}

// DDS Security by the plugins that every vendor has. Paths are absolute: Fast DDS takes the rest of
// `file://` as it is.
void AddCredentials(const std::string& folder, eprosima::fastrtps::rtps::PropertyPolicy* policy) {
  const std::string file = "file://" + std::filesystem::absolute(folder).string() + "/";
  const std::string identity = "dds.sec.auth.builtin.PKI-DH.";
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  for (const auto& [name, value] :
       {std::pair<std::string, std::string>{"dds.sec.auth.plugin", "builtin.PKI-DH"},
        {identity + "identity_ca", file + "identity_ca.pem"},
        {identity + "identity_certificate", file + "certificate.pem"},
        {identity + "private_key", file + "key.pem"},
        {"dds.sec.access.plugin", "builtin.Access-Permissions"},
        {access + "permissions_ca", file + "permissions_ca.pem"},
        {access + "governance", file + "governance.p7s"},
        {access + "permissions", file + "permissions.p7s"},
        {"dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC"}})
    policy->properties().emplace_back(name, value);
}

// As in deploy/cyclonedds.xml: loopback only, no multicast, up to 120 programs on this machine.
fast::DomainParticipant* MakeParticipant(unsigned domain, const std::string& credentials) {
  auto transport = std::make_shared<rtps::UDPv4TransportDescriptor>();
  transport->interfaceWhiteList.emplace_back("127.0.0.1");
  transport->maxInitialPeersRange = 120;
  transport->receiveBufferSize = 4 << 20;
  fast::DomainParticipantQos qos;
  if (!credentials.empty()) AddCredentials(credentials, &qos.properties());
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(transport);
  eprosima::fastrtps::rtps::Locator_t loopback;
  eprosima::fastrtps::rtps::IPLocator::setIPv4(loopback, 127, 0, 0, 1);
  loopback.port = 0;  // the domain's own ports
  auto& builtin = qos.wire_protocol().builtin;
  builtin.initialPeersList.push_back(loopback);
  builtin.metatrafficUnicastLocatorList.push_back(loopback);
  qos.wire_protocol().default_unicast_locator_list.push_back(loopback);
  return Check(fast::DomainParticipantFactory::get_instance()->create_participant(domain, qos),
               "the participant");
}

// Reliable and transient-local: the last state of every unit comes on joining.
template <class PubSubType>
fast::DataReader* MakeReader(fast::DomainParticipant* participant, const char* name) {
  fast::TypeSupport type(new PubSubType);
  type.register_type(participant);
  fast::Topic* topic =
      Check(participant->create_topic(name, type.get_type_name(), fast::TOPIC_QOS_DEFAULT), name);
  fast::DataReaderQos qos;
  qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = fast::TRANSIENT_LOCAL_DURABILITY_QOS;
  qos.reader_resource_limits().max_samples_per_read = kSamplesPerTake;
  qos.history().kind = fast::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 1;
  qos.resource_limits().max_instances = kUnitsMax;
  qos.resource_limits().max_samples_per_instance = 1;
  qos.resource_limits().max_samples = kUnitsMax;  // at least the product, or no reader is made
  fast::Subscriber* subscriber =
      Check(participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT), "the subscriber");
  return Check(subscriber->create_datareader(topic, qos), name);
}

void Print(const focalfleet::UnitStatus& unit) {
  std::printf("unit %u: %s, theta %.3f..%.3f deg, phi %.3f..%.3f deg, fibre at %.4f, %.4f mm\n",
              unit.unit_id(), PhaseName(unit.phase()), unit.theta_low_deg(), unit.theta_high_deg(),
              unit.phi_low_deg(), unit.phi_high_deg(), unit.x_fp_mm(), unit.y_fp_mm());
}

// Calls `use` with each sample that has come. A sample without valid data only says that a writer
// is gone. Many samples are taken by one call, as Fast DDS 2.9 looks at every instance in each
// call, under the lock that its receiving thread needs.
template <class Sample, class Use>
void TakeAll(fast::DataReader* reader, Use use) {
  fast::LoanableSequence<Sample> samples;
  fast::SampleInfoSeq infos;
  while (reader->take(samples, infos) == ReturnCode_t::RETCODE_OK) {
    for (fast::LoanableCollection::size_type i = 0; i < infos.length(); ++i)
      if (infos[i].valid_data) use(samples[i], infos[i].source_timestamp);
    reader->return_loan(samples, infos);
  }
}

double SecondsSince(Clock::time_point then) {
  return std::chrono::duration<double>(Clock::now() - then).count();
}

}  // namespace

int main(int argc, char** argv) {
  unsigned domain = 0;
  bool once = false;
  double wait_s = 10;
  std::string credentials;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--once") == 0)
      once = true;
    else if (std::strcmp(argv[i], "--wait") == 0 && i + 1 < argc)
      wait_s = std::atof(argv[++i]);
    else if (std::strcmp(argv[i], "--credentials") == 0 && i + 1 < argc)
      credentials = argv[++i];
    else
      domain = static_cast<unsigned>(std::atoi(argv[i]));
  }
  const auto began = Clock::now();
  eprosima::fastrtps::rtps::Time_t began_at;
  eprosima::fastrtps::rtps::Time_t::now(began_at);
  fast::DomainParticipant* participant = MakeParticipant(domain, credentials);
  fast::DataReader* units =
      MakeReader<focalfleet::UnitStatusPubSubType>(participant, "focalfleet/unit_status");
  fast::DataReader* fleet =
      MakeReader<focalfleet::FleetStatusPubSubType>(participant, "focalfleet/fleet_status");
  fast::WaitSet waitset;
  for (fast::DataReader* reader : {units, fleet}) {
    reader->get_statuscondition().set_enabled_statuses(fast::StatusMask::data_available());
    waitset.attach_condition(reader->get_statuscondition());
  }

  std::set<unsigned> seen;
  unsigned from_history = 0;  // units first seen by a sample older than this program
  unsigned fleet_size = 0;    // as the daemon says; 0: not known yet
  bool is_discovered = false;
  bool all_seen = false;
  auto discovered = began;
  while (!once || (!all_seen && SecondsSince(began) < wait_s)) {
    fast::ConditionSeq active;
    waitset.wait(active, {0, 100'000'000});  // 0.1 s at most
    fast::SubscriptionMatchedStatus matched;
    if (!is_discovered &&
        units->get_subscription_matched_status(matched) == ReturnCode_t::RETCODE_OK &&
        matched.current_count > 0) {
      is_discovered = true;
      discovered = Clock::now();
    }
    TakeAll<focalfleet::FleetStatus>(fleet,
                                     [&](const auto& now, auto) { fleet_size = now.units(); });
    TakeAll<focalfleet::UnitStatus>(units, [&](const auto& unit, auto written) {
      Print(unit);
      if (seen.insert(unit.unit_id()).second && written < began_at) ++from_history;
    });
    if (all_seen || fleet_size == 0 || seen.size() < fleet_size) continue;
    all_seen = true;
    std::printf(
        "all %zu of %u units seen %.3f s after discovery, %.3f s after joining; %u from history\n",
        seen.size(), fleet_size, SecondsSince(discovered), SecondsSince(began), from_history);
    std::fflush(stdout);
  }
  if (!all_seen) std::printf("%zu of %u units seen\n", seen.size(), fleet_size);
  participant->delete_contained_entities();
  fast::DomainParticipantFactory::get_instance()->delete_participant(participant);
  return all_seen ? 0 : 1;
}
