#include "fleet/coordinate/sensor_reading.h"

namespace focalfleet {
namespace {

// Eight bytes, as long as they can get.
constexpr std::uint32_t kSensorsAnswerBits = 160;

}  // namespace

void Sense(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  record.sensing = {};
  const std::uint8_t sensors = fleet.layout.unit(i).sensors;
  if (sensors == 0 || record.view.phase != UnitPhase::kReady) return;
  if (record.protocol_version != kProtocolVersionWithSensors) {
    SensorsDoNotAnswer(fleet, i, "its firmware knows of none");
    return;
  }
  record.sensing.parts = SensorPartsOf(sensors);
  if (!record.request.question) fleet.timers.Set(i, fleet.now());
}

void AskSensors(const Coordination& fleet, PositionerIndex i) {
  fleet.requests.Ask(i, SensorsRequest{fleet.units[i].sensing.next_part}, kSensorsAnswerBits);
}

void OnSensors(const Coordination& fleet, PositionerIndex i, const SensorsReply& reply) {
  UnitRecord& record = fleet.units[i];
  Sensing& sensing = record.sensing;
  if (!sensing.under_way()) return;
  if (reply.part != sensing.next_part) {
    SensorsDoNotAnswer(fleet, i, "it answers with another part than was asked");
    return;
  }
  for (std::size_t k = 0; k < kSensorsPerPart; ++k)
    sensing.reading.counts[reply.part * kSensorsPerPart + k] = reply.counts[k];
  ++sensing.next_part;
  if (sensing.under_way()) return;
  sensing.reading.sensors = fleet.layout.unit(i).sensors;
  fleet.ledger.alarms().End(AlarmName::kSensorsSilent, i, {});
}

void SensorsDoNotAnswer(const Coordination& fleet, PositionerIndex i, const std::string& what) {
  fleet.units[i].sensing = {};
  fleet.units[i].sensing.given_up = true;
  fleet.ledger.alarms().Raise(AlarmName::kSensorsSilent, i, {},
                              fleet.units.NameOf(i) + " has sensors, but " + what);
}

}  // namespace focalfleet
