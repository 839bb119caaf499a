// UnitSessions, what units' own sensors show: asked part by part, one question open as ever, and
// given up with an alarm where the unit tells nothing or something else. Then it is not lost:
// whether it is there at all, the next poll shows.
#include "fleet/coordinate/unit_session.h"

namespace focalfleet {

void UnitSessions::Sense(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  record.sensing = {};
  const std::uint8_t sensors = core_.layout.unit(i).sensors;
  if (sensors == 0 || record.view.phase != UnitPhase::kReady) return;
  if (record.protocol_version != kProtocolVersionWithSensors) {
    SensorsDoNotAnswer(i, "its firmware knows of none");
    return;
  }
  record.sensing.parts = SensorPartsOf(sensors);
  if (!record.question) core_.SetDue(i, core_.now);
}

void UnitSessions::OnSensors(PositionerIndex i, const SensorsReply& reply) {
  UnitRecord& record = core_.unit(i);
  UnitRecord::Sensing& sensing = record.sensing;
  if (!sensing.under_way()) return;
  if (reply.part != sensing.next_part) {
    SensorsDoNotAnswer(i, "it tells others than it was asked for");
    return;
  }
  for (std::size_t k = 0; k < kSensorsPerPart; ++k)
    sensing.reading.counts[reply.part * kSensorsPerPart + k] = reply.counts[k];
  ++sensing.next_part;
  if (!sensing.under_way()) sensing.reading.sensors = core_.layout.unit(i).sensors;
}

void UnitSessions::SensorsDoNotAnswer(PositionerIndex i, const std::string& what) {
  core_.unit(i).sensing = {};
  core_.unit(i).sensing.given_up = true;
  core_.Raise(Severity::kWarning, i, {}, core_.NameOf(i) + " has sensors, but " + what);
}

}  // namespace focalfleet
