// The record of a unit is its published view together with the coordinator's working state. The
// working state is the open question, the vectors being read, and the watch over the motion. The
// record of a bus is the same for a bus.
//
// Size: about 300 bytes a unit and 1 kB a bus.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fleet/coordinate/bus_schedule.h"
#include "fleet/coordinate/bus_view.h"
#include "fleet/coordinate/clock_map.h"
#include "fleet/coordinate/unit_view.h"
#include "fleet/measurement.h"
#include "protocol/base/instants.h"
#include "protocol/wire/codec.h"

namespace focalfleet {

/// The one question that a unit has open. A repeat has the same sequence number. The unit can
/// therefore tell a repeat from a new question, and an old answer is never taken for a new one.
struct Question {
  HostMessage message;
  Function answer_function{};
  std::uint8_t sequence = 0;
  std::uint8_t tries = 0;
  std::uint32_t answer_bits = 0;  // that its answer will take
  HostInstant deadline = kNever;  // set when the frame leaves
  HostInstant asked = kNever;     // when it first left
  /// Without an answer by then the unit is reported unheard, once, before the retries are over. Set
  /// where the motion of others depends on the answer.
  HostInstant suspect_at = kNever;
};

/// A parameter that a command wants written; `request` is answered when the unit has answered.
struct ParameterOrder {
  std::uint64_t request = 0;
  ParameterWrite write;
};

/// State of the questions to one unit (requests.h).
struct RequestState {
  std::uint8_t sequence = 0;  // of the last question
  std::optional<Question> question;
  HostInstant answered_asked{INT64_MIN};  // when the question answered last was asked
  std::uint64_t write_request = 0;  // the command that waits for the answer to a written parameter
  /// Parameters to write when the open question is answered, in their order. They outlive an
  /// identification; any other end of rest refuses them (UnitTable::SetPhase).
  std::vector<ParameterOrder> waiting_writes;
  // Stops of this host, so that a stop of another host is recognised.
  /// Sequence numbers of the last stops, newest first: answers may come late, and repeated.
  std::array<std::uint8_t, 4> stop_sequences{};
  HostInstant reported_to_stop{INT64_MIN};  // the last stop past the queue, with sequence number 0
};

/// The answers of an identification so far.
struct Reading {
  int step = 0;  // index of the next question (identification.cc)
  StatusReply status;
  Pose position{};
  std::array<std::uint16_t, kAxisCount> subdivision{};
  std::array<std::int32_t, kAxisCount> counter1{};
  bool resumes = false;  // the last question for its status resumed it
  // A unit that has restarted, or lost the host, says so until it is resumed. Where an open move
  // depends on that, it is read without being resumed first.
  bool not_resumed = false;
  // The batch with what follows from such a reading, after which the unit is read anew; none: it is
  // not read to its end yet.
  std::optional<std::uint64_t> stored_by;
};

/// Reasons for which a unit that answers is not moved.
struct UnitTrouble {
  /// A parameter that differs from the one that plans are made with, for people; empty: none. Such
  /// a unit is kFault, and read again with every poll.
  std::string unfit;
  std::optional<std::uint8_t> other_version;  // of the protocol, in its last identity
  bool no_serial = false;                     // its serial number was 0 in its last identity
  /// The fault that its alarm names, also one of an earlier run; kNone: the alarm names none yet.
  FaultCode named_fault = FaultCode::kNone;
  std::string not_kept;  // why the store refuses its rows; empty: it does not. Kept in kFault.
};

/// State of a unit's motion, and of the watch over it.
struct MotionState {
  // The motion of others depends on where the unit is from `watch_from` to `watch_until`.
  HostInstant watch_from = kNever;
  HostInstant watch_until{INT64_MIN};
  HostInstant seen_moving{INT64_MIN};  // when the last question was asked that found it moving
  /// A unit asked later than this that has not begun never will: the start may have been late.
  HostInstant begun_by{INT64_MIN};
  bool wants_start = false;  // began with the others, and its start is not known yet
  ClockMap::Instant began;   // as last reported
  bool runs_freely = false;  // set in motion, and not stopped by this host since
  bool ended_short = false;  // of its end, and not reported yet
  bool ended_early = false;  // its last move was one of an earlier run, and ended before its end
};

/// The sensors of a unit, being read or as read last.
struct Sensing {
  std::uint8_t next_part = 0;
  std::uint8_t parts = 0;
  bool given_up = false;  // it does not answer for them
  SensorReading reading;  // none before all parts have come
  [[nodiscard]] bool begun() const { return parts > 0 || given_up; }
  [[nodiscard]] bool under_way() const { return next_part < parts; }
};

/// A unit of unknown place that was found: its own count is being set to `place`, axis by axis.
struct Locating {
  Pose place{};
  Axis axis = Axis::kTheta;  // whose count is written now
  Pose count{};              // as the unit took it
};

struct UnitRecord {
  UnitView view;
  std::size_t bus = 0;  // index into UnitTable::buses
  RequestState request;
  Reading reading;
  UnitTrouble trouble;
  MotionState motion;
  HostInstant next_poll{INT64_MIN};
  bool asked_once = false;  // has had the chance to answer since start
  ClockMap clock;
  bool clock_reported = false;  // an alarm has said that its clock is off by more than plans allow
  std::uint8_t protocol_version = kProtocolVersion;  // in its last identity
  Sensing sensing;
  std::optional<Locating> locating;
};

struct BusRecord {
  BusId id;
  BusSchedule schedule;
  BusView view;
  HostInstant clock_due{INT64_MIN};
  HostInstant window_began = kNever;  // of the second over which the load is taken
  std::uint64_t window_bits = 0;
  // The upload under way, from its first frame released to its last unit armed.
  HostInstant upload_began = kNever;
  HostInstant upload_ended{INT64_MIN};
  std::vector<PositionerIndex> units;
};

}  // namespace focalfleet
