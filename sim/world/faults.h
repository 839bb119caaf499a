// Planted misbehaviour, for tests and load testers. Each fault is switched on by name and stays
// until it is switched off. Chance, such as that of a bus that loses frames, is drawn from the
// world's seed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "protocol/wire/identifier.h"
#include "protocol/wire/messages.h"

namespace focalfleet::sim {

/// The misbehaviour of one unit towards the host. Its motors are not affected.
struct UnitFaults {
  enum class Kind : std::uint8_t {
    kSilent,
    kDeaf,
    kLate,
    kCopies,
    kWrongDigest,
    kMuteDone,
    kForeignSerial,
    kInMotion,
    kIgnores,
    kRefuses,
    kStaleSequence,
    kCount
  };
  bool silent = false;        // receives and acts, but never sends
  bool deaf = false;          // receives nothing
  bool deaf_to_sync = false;  // its SYNC wire is broken
  DurationNs late{0};         // every answer comes this much later
  std::uint8_t copies = 1;    // number of copies of every answer
  bool wrong_digest = false;  // the digest that it reports is not that of the staged move
  bool mute_done = false;     // answers, but the end of a motion is never reported unasked
  std::optional<SerialNumber> foreign_serial;  // other hardware sits at this place
  /// A fault occurs in the next motion, this long after the first step. The entry is used up then.
  struct InMotion {
    DurationNs after{0};
    FaultCode code = FaultCode::kOverTemperature;
    Axis axis = Axis::kTheta;
  };
  std::optional<InMotion> in_motion;
  std::optional<Function> ignores;  // receives such a request, but neither acts nor answers
  /// Such a request (confirm, arm, home, parameter_write) has no effect, and its answer says so.
  struct Refusal {
    Function what{};
    Answer answer = Answer::kWrongState;
  };
  std::optional<Refusal> refuses;
  std::uint32_t loses_segments = 0;  // this many more stage_segment frames do not reach it
  std::optional<std::uint8_t> protocol_version;  // the version that it reports
  bool stale_sequence = false;  // answers under the sequence number of the request before
  /// A sensor of its joint gives wrong readings.
  struct Sensor {
    enum class Kind : std::uint8_t { kStuck, kSaturated, kMissing, kSwapped, kGain };
    Kind kind = Kind::kStuck;
    std::uint8_t sensor = 0;  // from 0
    std::uint8_t other = 0;   // of kSwapped
  };
  std::optional<Sensor> sensor;
  // At the start of a move that it holds it stays where it is, and reports `arrived`.
  bool claims_arrival = false;

  /// How often a fault has changed what the unit took in, did or said.
  std::array<std::uint32_t, static_cast<std::size_t>(Kind::kCount)> acted{};
  void Acts(Kind kind) { ++acted[static_cast<std::size_t>(kind)]; }
  [[nodiscard]] std::uint32_t Acted(Kind kind) const {
    return acted[static_cast<std::size_t>(kind)];
  }
};

/// Damage of a unit's FLASH, done at once.
enum class FlashDamage : std::uint8_t {
  kOldCounts,  // both axes have counts of earlier
  kNoMark,     // the mark of a move under way is clear
};

/// The misbehaviour of one bus: chances per frame, except for noise.
struct BusFaults {
  double bit_error_rate = 0;  // all nodes see a bit inverted: the frame is destroyed and repeated
  double drop = 0;  // the frame occupies the bus and is acknowledged, but no node takes it in
  // A receiver refuses the frame when all others have it: they get it twice.
  double duplicate = 0;
  double late = 0;  // the frame enters arbitration only after `late_by`
  DurationNs late_by = Milliseconds(5);

  /// The frames that each has touched.
  struct Acted {
    std::uint32_t noise = 0;
    std::uint32_t drop = 0;
    std::uint32_t duplicate = 0;
    std::uint32_t late = 0;
  };
  Acted acted = {};
};

}  // namespace focalfleet::sim
