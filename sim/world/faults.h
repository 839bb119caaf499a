// Planted misbehaviour, for tests and load testers. Each is switched on by name and stays until it
// is switched off; none of them is chance: chance (of a bus that loses frames) is drawn from the
// world's seed.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "protocol/wire/identifier.h"
#include "protocol/wire/messages.h"

namespace focalfleet::sim {

/// How one unit misbehaves towards the host. Its motors obey as ever.
struct UnitFaults {
  bool silent = false;        // hears, acts, never sends
  bool deaf = false;          // hears nothing
  bool deaf_to_sync = false;  // its SYNC wire is broken
  DurationNs late{0};         // every answer comes this much later
  std::uint8_t copies = 1;    // every answer is sent so many times
  bool wrong_digest = false;  // what it says it holds is not what was staged
  bool mute_done = false;     // answers, but the end of a motion is never reported unasked
  std::optional<SerialNumber> foreign_serial;  // other hardware sits at this place
  /// In its next motion, so long after the first step: a fault. Used up when it happens.
  struct InMotion {
    DurationNs after{0};
    FaultCode code = FaultCode::kOverTemperature;
    Axis axis = Axis::kTheta;
  };
  std::optional<InMotion> in_motion;
  std::optional<Function> ignores;  // such a request: hears it, does nothing, says nothing
  /// Such a request (confirm, arm, home, parameter_write): does nothing, and answers so.
  struct Refusal {
    Function what{};
    Answer answer = Answer::kWrongState;
  };
  std::optional<Refusal> refuses;
  std::uint32_t loses_segments = 0;  // so many more stage_segment frames do not reach it
  std::optional<std::uint8_t> protocol_version;  // that it says it speaks
  bool stale_sequence = false;  // answers under the sequence number of the request before
  /// One sensor of its joint lies.
  struct Sensor {
    enum class Kind : std::uint8_t { kStuck, kSaturated, kMissing, kSwapped, kGain };
    Kind kind = Kind::kStuck;
    std::uint8_t sensor = 0;  // from 0
    std::uint8_t other = 0;   // of kSwapped
  };
  std::optional<Sensor> sensor;
  bool claims_arrival = false;  // a start that it holds a move for: stays, and says `arrived`
};

/// How one bus misbehaves: chances per frame, but for noise.
struct BusFaults {
  double bit_error_rate = 0;  // a bit is seen inverted by all: the frame is destroyed and repeated
  double drop = 0;            // it occupies the bus and is acknowledged, but nobody takes it in
  double duplicate = 0;       // one receiver refuses it when all others have it: they get it twice
  double late = 0;            // it enters arbitration only after `late_by`
  DurationNs late_by = Milliseconds(5);
};

}  // namespace focalfleet::sim
