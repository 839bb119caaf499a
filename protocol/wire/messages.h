// Every message of a unit's life, as values. Positions are whole vectors from the axis' zero; one
// vector turns the motor's field by 360/subdivision degrees. Times are 100 us ticks of the unit's
// clock. Comments give the width on the wire where it is narrower than the type; docs/protocol.md
// has the bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <variant>

#include "protocol/base/ids.h"
#include "protocol/base/limits.h"

namespace focalfleet {

/// The protocol versions of units without sensors and with them. Version 2 is version 1 and the
/// sensors frames.
inline constexpr std::uint8_t kProtocolVersion = 1;
inline constexpr std::uint8_t kProtocolVersionWithSensors = 2;
constexpr bool IsSpoken(std::uint8_t version) {
  return version == kProtocolVersion || version == kProtocolVersionWithSensors;
}

// ---- values of both directions

/// The activity of a unit. On the wire: three bits.
enum class UnitState : std::uint8_t {
  kRest = 0,
  kStaging = 1,  // holds a move or a part of one, not armed
  kArmed = 2,    // begins at the start signal
  kMoving = 3,
  kHoming = 4,
  kFault = 5,     // stopped by a fault; takes no motion until the fault is cleared
  kHostLost = 6,  // at rest; received no host frame for its time-out: takes only stop and status
};
inline constexpr std::uint8_t kUnitStateCount = 7;
const char* Name(UnitState state);

enum class FaultCode : std::uint8_t {
  kNone = 0,
  kOverTemperature = 1,
  kUnderVoltage = 2,
  kOverCurrent = 3,
  kFlash = 4,
  kDriver = 5,
};
inline constexpr std::uint8_t kFaultCodeCount = 6;
const char* Name(FaultCode code);

/// The end of a motion. On the wire: the detail bits of `done`.
enum class Outcome : std::uint8_t { kArrived = 0, kStopped = 1, kFault = 2, kHomed = 3 };
inline constexpr std::uint8_t kOutcomeCount = 4;
const char* Name(Outcome outcome);

/// The reason why a unit granted or refused a request.
enum class Answer : std::uint8_t {
  kOk = 0,
  kWrongMove = 1,    // another move is staged, or none
  kIncomplete = 2,   // segments are missing, or the digest differs
  kOutOfRange = 3,   // the path leaves the axis' range
  kWrongState = 4,   // the present state does not allow it
  kBegunBefore = 5,  // this move was begun before: a move is never begun twice
  kBadValue = 6,
  kInterrupted = 7,  // a power loss cut a move short: home or set the position first
};
inline constexpr std::uint8_t kAnswerCount = 8;
const char* Name(Answer answer);

/// The parameters that a unit keeps per axis in FLASH. kHostTimeoutMs belongs to the whole unit,
/// and both axes show the same value.
enum class Parameter : std::uint8_t {
  kCounter1 = 0,     // timer counts per carrier period (V_counter1)
  kRepeat = 1,       // carrier periods per vector (n), the tuned default
  kSubdivision = 2,  // vectors per electrical turn
  kMode = 3,         // WaveMode
  kPosition = 4,     // vectors; a write sets the position that the unit counts from (rest only)
  kMinPosition = 5,  // vectors; a staged move that leaves the range is refused
  kMaxPosition = 6,
  kHomePosition = 7,   // vectors, at the hard stop that homing drives to
  kHostTimeoutMs = 8,  // silence of the host after which the unit enters kHostLost
};
inline constexpr std::uint8_t kParameterCount = 9;
const char* Name(Parameter parameter);

/// A straight piece of an axis' path. The piece begins `start_ticks` after the start signal. The
/// axis goes `delta` vectors one by one, each shown for repeat * counter1 timer counts.
struct Segment {
  std::uint32_t start_ticks = 0;  // 24 bits
  std::int32_t delta = 0;         // vectors, 24 bits
  std::uint8_t repeat = 0;        // n, 1..255
  constexpr bool operator==(const Segment&) const = default;
};

/// Sensors are numbered from 0 and reported four at a time: part 0 has 0..3, part 1 has 4..7.
inline constexpr std::size_t kSensorsPerPart = 4;
inline constexpr std::size_t kSensorParts = limits::kSensorsPerUnit / kSensorsPerPart;
static_assert(kSensorParts * kSensorsPerPart == limits::kSensorsPerUnit);
constexpr std::uint8_t SensorPartsOf(std::size_t sensors) {
  return static_cast<std::uint8_t>((sensors + kSensorsPerPart - 1) / kSensorsPerPart);
}
/// A sensor's output is a share of its supply: 0 is ground, kFullCount the supply.
inline constexpr std::uint16_t kFullCount = 65534;
inline constexpr std::uint16_t kNoCount = 65535;  // no such sensor, or it gives no reading

// ---- host to unit

struct Stop {};  // one unit, or by broadcast all: end at the next vector
struct Start {   // broadcast: armed units of `move` begin `delay_ticks` after this frame
  MoveId move;
  std::uint32_t delay_ticks = 0;  // 24 bits
};
/// Broadcast: the host's time. The frame also shows that a host is present.
struct Clock {
  std::uint64_t host_us = 0;  // 48 bits
};
struct ClockRequest {};
struct Arm {
  MoveId move;
  std::uint32_t digest = 0;
};
struct Confirm {  // reads back what was staged
  MoveId move;
};
struct StageBegin {
  MoveId move;
  std::array<std::uint8_t, kAxisCount> segments{};  // 0..15 each
  WaveMode mode = WaveMode::kAsymmetric;
};
struct StageSegment {
  Axis axis = Axis::kTheta;
  std::uint8_t index = 0;
  Segment segment;
};
struct Home {  // drives both axes to their stops, phi first; begins at once
  MoveId move;
};
struct ProgressRequest {};
struct StatusRequest {
  bool resume = false;  // a host is back: the unit leaves kHostLost
};
struct VectorRequest {
  Axis axis = Axis::kTheta;
};
struct FaultRequest {
  bool clear = false;
};
struct IdentifyRequest {};
struct ParameterRead {
  Axis axis = Axis::kTheta;
  Parameter parameter = Parameter::kCounter1;
};
struct ParameterWrite {
  Axis axis = Axis::kTheta;
  Parameter parameter = Parameter::kCounter1;
  std::int32_t value = 0;
};

/// A request for part 0 takes a reading of all sensors together; the other parts report the rest of
/// that reading.
struct SensorsRequest {
  std::uint8_t part = 0;  // 0..kSensorParts-1
};

using HostMessage =
    std::variant<Stop, Start, Clock, ClockRequest, Arm, Confirm, StageBegin, StageSegment, Home,
                 ProgressRequest, StatusRequest, VectorRequest, FaultRequest, IdentifyRequest,
                 ParameterRead, ParameterWrite, SensorsRequest>;

// ---- unit to host

struct Done {  // a motion ended, or a stop is answered: where the axes stand
  Outcome outcome = Outcome::kArrived;
  std::array<std::int32_t, kAxisCount> position{};  // vectors, 24 bits each
  MoveId move;                                      // the move that was begun last
};
struct ClockReply {               // the unit's clock since power-on, low 32 bits
  std::uint32_t ticks = 0;        // at the end of the request
  std::uint32_t began_ticks = 0;  // start of the move that was begun last; 0: none since power-on
};
struct ArmReply {
  MoveId move;
  Answer answer = Answer::kOk;
};
struct ConfirmReply {
  MoveId move;
  std::uint32_t digest = 0;
  std::array<std::uint8_t, kAxisCount> segments{};  // received so far, 4 bits each
  Answer answer = Answer::kOk;
};
struct HomeReply {
  MoveId move;
  Answer answer = Answer::kOk;
};
struct ProgressReply {
  UnitState state = UnitState::kRest;
  std::array<std::int32_t, kAxisCount> position{};  // the vector applied now, 24 bits each
  MoveId move;
};
struct StatusReply {
  UnitState state = UnitState::kRest;
  FaultCode fault = FaultCode::kNone;
  bool interrupted =
      false;  // FLASH's mark `moving` was set at power-on: the position is not certain
  bool host_lost = false;
  bool restarted = false;  // powered on since the last StatusRequest with resume
  std::uint8_t progress_percent = 0;
  MoveId move;  // the move that was begun last; 0: none
  std::uint16_t moves_begun = 0;
};
struct VectorReply {  // FLASH of one axis
  Axis axis = Axis::kTheta;
  std::uint16_t vector = 0;  // 0..subdivision-1
  std::uint16_t subdivision = 0;
  std::int32_t turns = 0;  // whole electrical turns
};
struct FaultReply {
  FaultCode code = FaultCode::kNone;
  Axis axis = Axis::kTheta;
  MoveId move;
  std::uint16_t count = 0;  // faults since power-on
};
struct IdentifyReply {
  SerialNumber serial;
  std::uint8_t protocol_version = kProtocolVersion;
  std::uint8_t firmware_major = 0;
  std::uint8_t firmware_minor = 0;
  std::uint8_t hardware = 0;
};
struct ParameterReply {  // answers a read and a write: the value that holds now
  bool written = false;
  Axis axis = Axis::kTheta;
  Parameter parameter = Parameter::kCounter1;
  Answer answer = Answer::kOk;
  std::int32_t value = 0;
};

struct SensorsReply {
  std::uint8_t part = 0;
  std::array<std::uint16_t, kSensorsPerPart> counts{};
};

using UnitMessage =
    std::variant<Done, ClockReply, ArmReply, ConfirmReply, HomeReply, ProgressReply, StatusReply,
                 VectorReply, FaultReply, IdentifyReply, ParameterReply, SensorsReply>;

}  // namespace focalfleet
