// Events of the fleet in the daemon's log: a sentence for people, and beside it fields by which the
// journal finds the events of a unit, a bus or a configuration. A sink that knows fields asks for
// those of the event that it is given; all others write the sentence alone.
#pragma once

#include <optional>

#include "daemon/store/audit_chain.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/records.h"
#include "protocol/base/ids.h"

namespace focalfleet {

struct EventFields {
  const char* message_id =
      nullptr;  // of this kind of event, 128 bits in hexadecimal; never changes
  std::optional<UnitId> unit;
  std::optional<BusId> bus;
  std::optional<std::uint64_t> configuration;
  const char* alarm = nullptr;  // its name
};

/// MESSAGE_ID of each kind of event; `journalctl MESSAGE_ID=...` lists them.
inline constexpr const char* kAlarmMessageId = "5d0b3f7e6a0f4a58b7b8c1a1f62f9e10";
inline constexpr const char* kConfigurationMessageId = "c2a4e0d9f5c44f0e9a51d3b7f0a86e21";
inline constexpr const char* kUnitEnabledMessageId = "0f6c9b1d24e54c36a1d7e8c90b53fa32";
inline constexpr const char* kAuditHeadMessageId = "b1f4a6d27c0e4d5b9e38a4c61d90f754";
inline constexpr const char* kBusLinkMessageId = "8e71a5c3d0b94d2f8c640f9e2b17dc43";

/// The fields of the event that this thread is writing; null: it has none. For sinks.
const EventFields* FieldsOfThisEvent();

/// The row is in the log, where it is of a kind that people want to see.
void LogRow(const Row& row);

/// The head of the audit is in the log, so that a tail that is cut off later can be noticed.
void LogAuditHead(const AuditHead& head);

/// The change of a link is in the log. `name` is that of its interface or socket, `trouble` the
/// reason why it is not up.
void LogLink(const LinkEvent& link, const std::string& name, const std::string& trouble);

}  // namespace focalfleet
