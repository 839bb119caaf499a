// The layout of every frame: one table per message. No other file contains places of bits. The
// codec runs over these tables, and `MessageRows` (message_rows.h) gives the same rows to programs
// that print or describe frames.
//
// The compiler has all of it at hand, so a frame is put together by shifts of constants.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <variant>

#include "protocol/base/limits.h"
#include "protocol/wire/identifier.h"
#include "protocol/wire/message_rows.h"
#include "protocol/wire/messages.h"
#include "protocol/wire/names.h"

namespace focalfleet {

namespace layout {

// ---- rows

constexpr FieldRow Unsigned(const char* name, unsigned first_bit, unsigned bits,
                            const char* unit = "") {
  return {.name = name,
          .first_bit = static_cast<std::uint8_t>(first_bit),
          .bits = static_cast<std::uint8_t>(bits),
          .max = (std::int64_t{1} << bits) - 1,
          .unit = unit};
}
constexpr FieldRow Signed(const char* name, unsigned first_bit, unsigned bits, const char* unit) {
  return {.name = name,
          .first_bit = static_cast<std::uint8_t>(first_bit),
          .bits = static_cast<std::uint8_t>(bits),
          .is_signed = true,
          .min = -(std::int64_t{1} << (bits - 1)),
          .max = (std::int64_t{1} << (bits - 1)) - 1,
          .unit = unit};
}
constexpr FieldRow Within(FieldRow row, std::int64_t min, std::int64_t max) {
  row.min = min;
  row.max = max;
  return row;
}
/// A position: 24 bits, of which the lowest value means no position.
constexpr FieldRow Position(const char* name, unsigned first_bit) {
  return Within(Signed(name, first_bit, 24, "vectors"), -limits::kPositionMax,
                limits::kPositionMax);
}
constexpr FieldRow Named(const char* name, unsigned first_bit, unsigned bits,
                         std::span<const char* const> names) {
  FieldRow row = Unsigned(name, first_bit, bits);
  row.max = static_cast<std::int64_t>(names.size()) - 1;
  row.names = names;
  return row;
}
constexpr FieldRow InDetail(const char* name, std::span<const char* const> names) {
  FieldRow row = Named(name, 0, 3, names);
  row.in_detail = true;
  return row;
}

// ---- the place of a field in its message

template <class Message, class Member>
struct Whole {
  Member Message::*member;
  constexpr auto& operator()(auto& m) const { return m.*member; }
};
template <class Message, class Member, std::size_t kCount>
struct Element {
  std::array<Member, kCount> Message::*member;
  std::size_t index;
  constexpr auto& operator()(auto& m) const { return (m.*member)[index]; }
};
template <class Message, class Part, class Member>
struct Nested {
  Part Message::*part;
  Member Part::*member;
  constexpr auto& operator()(auto& m) const { return m.*part.*member; }
};

template <class Access>
struct Field {
  FieldRow row;
  Access access;
};
template <class Message, class Member>
constexpr auto Bind(FieldRow row, Member Message::*member) {
  return Field<Whole<Message, Member>>{row, {member}};
}
template <class Message, class Member>
constexpr auto Bind(FieldRow row, std::array<Member, kAxisCount> Message::*member, Axis axis) {
  return Field<Element<Message, Member, kAxisCount>>{row, {member, Index(axis)}};
}
template <class Message, class Member, std::size_t kCount>
constexpr auto BindAt(FieldRow row, std::array<Member, kCount> Message::*member,
                      std::size_t index) {
  return Field<Element<Message, Member, kCount>>{row, {member, index}};
}
template <class Message, class Part, class Member>
constexpr auto Bind(FieldRow row, Part Message::*part, Member Part::*member) {
  return Field<Nested<Message, Part, Member>>{row, {part, member}};
}

// ---- the tables

/// The table of one message: kName, kFunction, kLength, kFields, and kDetail where its detail is
/// constant.
template <class Message>
struct Layout;

struct NoFields {
  static constexpr std::uint8_t kDetail = 0;
  static constexpr std::uint8_t kLength = 0;
  static constexpr std::tuple<> kFields{};
};
struct ConstantDetail {
  static constexpr std::uint8_t kDetail = 0;
};

template <>
struct Layout<Stop> : NoFields {
  static constexpr const char* kName = "stop";
  static constexpr Function kFunction = Function::kStop;
};
template <>
struct Layout<Start> : ConstantDetail {
  static constexpr const char* kName = "start";
  static constexpr Function kFunction = Function::kStart;
  static constexpr std::uint8_t kLength = 5;
  static constexpr std::tuple kFields{
      Bind(Unsigned("move", 0, 16), &Start::move),
      Bind(Unsigned("delay_ticks", 16, 24, "ticks"), &Start::delay_ticks)};
};
template <>
struct Layout<Clock> : ConstantDetail {
  static constexpr const char* kName = "clock";
  static constexpr Function kFunction = Function::kClock;
  static constexpr std::uint8_t kLength = 6;
  static constexpr std::tuple kFields{Bind(Unsigned("host_us", 0, 48, "us"), &Clock::host_us)};
};
template <>
struct Layout<ClockRequest> : NoFields {
  static constexpr const char* kName = "clock_request";
  static constexpr Function kFunction = Function::kClock;
  static constexpr std::uint8_t kDetail = 1;
};
template <>
struct Layout<Arm> : ConstantDetail {
  static constexpr const char* kName = "arm";
  static constexpr Function kFunction = Function::kArm;
  static constexpr std::uint8_t kLength = 6;
  static constexpr std::tuple kFields{Bind(Unsigned("move", 0, 16), &Arm::move),
                                      Bind(Unsigned("digest", 16, 32), &Arm::digest)};
};
template <>
struct Layout<Confirm> : ConstantDetail {
  static constexpr const char* kName = "confirm";
  static constexpr Function kFunction = Function::kConfirm;
  static constexpr std::uint8_t kLength = 2;
  static constexpr std::tuple kFields{Bind(Unsigned("move", 0, 16), &Confirm::move)};
};
template <>
struct Layout<StageBegin> : ConstantDetail {
  static constexpr const char* kName = "stage_begin";
  static constexpr Function kFunction = Function::kStageBegin;
  static constexpr std::uint8_t kLength = 5;
  static constexpr std::tuple kFields{
      Bind(Within(Unsigned("move", 0, 16), 1, 65535), &StageBegin::move),
      Bind(Within(Unsigned("theta_segments", 16, 8), 0, limits::kSegmentsPerAxis),
           &StageBegin::segments, Axis::kTheta),
      Bind(Within(Unsigned("phi_segments", 24, 8), 0, limits::kSegmentsPerAxis),
           &StageBegin::segments, Axis::kPhi),
      Bind(Named("mode", 32, 8, kWaveModeNames), &StageBegin::mode)};
};
template <>
struct Layout<StageSegment> {
  static constexpr const char* kName = "stage_segment";
  static constexpr Function kFunction = Function::kStageSegment;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{
      Bind(InDetail("axis", kAxisNames), &StageSegment::axis),
      Bind(Within(Unsigned("index", 0, 8), 0, limits::kSegmentsPerAxis - 1), &StageSegment::index),
      Bind(Unsigned("start_ticks", 8, 24, "ticks"), &StageSegment::segment, &Segment::start_ticks),
      Bind(Signed("delta", 32, 24, "vectors"), &StageSegment::segment, &Segment::delta),
      Bind(Within(Unsigned("repeat", 56, 8), 1, 255), &StageSegment::segment, &Segment::repeat)};
};
template <>
struct Layout<Home> : ConstantDetail {
  static constexpr const char* kName = "home";
  static constexpr Function kFunction = Function::kHome;
  static constexpr std::uint8_t kLength = 2;
  static constexpr std::tuple kFields{Bind(Unsigned("move", 0, 16), &Home::move)};
};
template <>
struct Layout<ProgressRequest> : NoFields {
  static constexpr const char* kName = "progress";
  static constexpr Function kFunction = Function::kProgress;
};
template <>
struct Layout<StatusRequest> {
  static constexpr const char* kName = "status";
  static constexpr Function kFunction = Function::kStatus;
  static constexpr std::uint8_t kLength = 0;
  static constexpr std::tuple kFields{
      Bind(InDetail("resume", kNoYesNames), &StatusRequest::resume)};
};
template <>
struct Layout<VectorRequest> {
  static constexpr const char* kName = "vector";
  static constexpr Function kFunction = Function::kVector;
  static constexpr std::uint8_t kLength = 0;
  static constexpr std::tuple kFields{Bind(InDetail("axis", kAxisNames), &VectorRequest::axis)};
};
template <>
struct Layout<FaultRequest> {
  static constexpr const char* kName = "fault";
  static constexpr Function kFunction = Function::kFault;
  static constexpr std::uint8_t kLength = 0;
  static constexpr std::tuple kFields{Bind(InDetail("clear", kNoYesNames), &FaultRequest::clear)};
};
template <>
struct Layout<IdentifyRequest> : NoFields {
  static constexpr const char* kName = "identify";
  static constexpr Function kFunction = Function::kIdentify;
};
template <>
struct Layout<ParameterRead> {
  static constexpr const char* kName = "parameter_read";
  static constexpr Function kFunction = Function::kParameterRead;
  static constexpr std::uint8_t kLength = 1;
  static constexpr std::tuple kFields{
      Bind(InDetail("axis", kAxisNames), &ParameterRead::axis),
      Bind(Named("parameter", 0, 8, kParameterNames), &ParameterRead::parameter)};
};
template <>
struct Layout<ParameterWrite> {
  static constexpr const char* kName = "parameter_write";
  static constexpr Function kFunction = Function::kParameterWrite;
  static constexpr std::uint8_t kLength = 5;
  static constexpr std::tuple kFields{
      Bind(InDetail("axis", kAxisNames), &ParameterWrite::axis),
      Bind(Named("parameter", 0, 8, kParameterNames), &ParameterWrite::parameter),
      Bind(Signed("value", 8, 32, ""), &ParameterWrite::value)};
};

template <>
struct Layout<SensorsRequest> {
  static constexpr const char* kName = "sensors";
  static constexpr Function kFunction = Function::kSensors;
  static constexpr std::uint8_t kLength = 0;
  static constexpr std::tuple kFields{
      Bind(InDetail("part", kSensorPartNames), &SensorsRequest::part)};
};

template <>
struct Layout<Done> {
  static constexpr const char* kName = "done";
  static constexpr Function kFunction = Function::kDone;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{Bind(InDetail("outcome", kOutcomeNames), &Done::outcome),
                                      Bind(Position("theta", 0), &Done::position, Axis::kTheta),
                                      Bind(Position("phi", 24), &Done::position, Axis::kPhi),
                                      Bind(Unsigned("move", 48, 16), &Done::move)};
};
template <>
struct Layout<ClockReply> : ConstantDetail {
  static constexpr const char* kName = "clock_reply";
  static constexpr Function kFunction = Function::kClock;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{
      Bind(Unsigned("ticks", 0, 32, "ticks"), &ClockReply::ticks),
      Bind(Unsigned("began_ticks", 32, 32, "ticks"), &ClockReply::began_ticks)};
};
template <>
struct Layout<ArmReply> : ConstantDetail {
  static constexpr const char* kName = "arm_reply";
  static constexpr Function kFunction = Function::kArm;
  static constexpr std::uint8_t kLength = 3;
  static constexpr std::tuple kFields{
      Bind(Unsigned("move", 0, 16), &ArmReply::move),
      Bind(Named("answer", 16, 8, kAnswerNames), &ArmReply::answer)};
};
template <>
struct Layout<ConfirmReply> : ConstantDetail {
  static constexpr const char* kName = "confirm_reply";
  static constexpr Function kFunction = Function::kConfirm;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{
      Bind(Unsigned("move", 0, 16), &ConfirmReply::move),
      Bind(Unsigned("digest", 16, 32), &ConfirmReply::digest),
      Bind(Unsigned("theta_segments", 48, 4), &ConfirmReply::segments, Axis::kTheta),
      Bind(Unsigned("phi_segments", 52, 4), &ConfirmReply::segments, Axis::kPhi),
      Bind(Named("answer", 56, 8, kAnswerNames), &ConfirmReply::answer)};
};
template <>
struct Layout<HomeReply> : ConstantDetail {
  static constexpr const char* kName = "home_reply";
  static constexpr Function kFunction = Function::kHome;
  static constexpr std::uint8_t kLength = 3;
  static constexpr std::tuple kFields{
      Bind(Unsigned("move", 0, 16), &HomeReply::move),
      Bind(Named("answer", 16, 8, kAnswerNames), &HomeReply::answer)};
};
template <>
struct Layout<ProgressReply> {
  static constexpr const char* kName = "progress_reply";
  static constexpr Function kFunction = Function::kProgress;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{
      Bind(InDetail("state", kUnitStateNames), &ProgressReply::state),
      Bind(Position("theta", 0), &ProgressReply::position, Axis::kTheta),
      Bind(Position("phi", 24), &ProgressReply::position, Axis::kPhi),
      Bind(Unsigned("move", 48, 16), &ProgressReply::move)};
};
template <>
struct Layout<StatusReply> : ConstantDetail {
  static constexpr const char* kName = "status_reply";
  static constexpr Function kFunction = Function::kStatus;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{
      Bind(Named("state", 0, 8, kUnitStateNames), &StatusReply::state),
      Bind(Named("fault", 8, 8, kFaultCodeNames), &StatusReply::fault),
      Bind(Named("interrupted", 16, 1, kNoYesNames), &StatusReply::interrupted),
      Bind(Named("host_lost", 17, 1, kNoYesNames), &StatusReply::host_lost),
      Bind(Named("restarted", 18, 1, kNoYesNames), &StatusReply::restarted),
      Bind(Within(Unsigned("progress_percent", 24, 8, "%"), 0, 100),
           &StatusReply::progress_percent),
      Bind(Unsigned("move", 32, 16), &StatusReply::move),
      Bind(Unsigned("moves_begun", 48, 16), &StatusReply::moves_begun)};
};
template <>
struct Layout<VectorReply> {
  static constexpr const char* kName = "vector_reply";
  static constexpr Function kFunction = Function::kVector;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{
      Bind(InDetail("axis", kAxisNames), &VectorReply::axis),
      Bind(Unsigned("vector", 0, 16, "vectors"), &VectorReply::vector),
      Bind(Within(Unsigned("subdivision", 16, 16), 1, 65535), &VectorReply::subdivision),
      Bind(Signed("turns", 32, 32, "turns"), &VectorReply::turns)};
};
template <>
struct Layout<FaultReply> : ConstantDetail {
  static constexpr const char* kName = "fault_reply";
  static constexpr Function kFunction = Function::kFault;
  static constexpr std::uint8_t kLength = 6;
  static constexpr std::tuple kFields{
      Bind(Named("fault", 0, 8, kFaultCodeNames), &FaultReply::code),
      Bind(Named("axis", 8, 8, kAxisNames), &FaultReply::axis),
      Bind(Unsigned("move", 16, 16), &FaultReply::move),
      Bind(Unsigned("count", 32, 16), &FaultReply::count)};
};
template <>
struct Layout<IdentifyReply> : ConstantDetail {
  static constexpr const char* kName = "identify_reply";
  static constexpr Function kFunction = Function::kIdentify;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{
      Bind(Unsigned("serial", 0, 32), &IdentifyReply::serial),
      Bind(Unsigned("protocol_version", 32, 8), &IdentifyReply::protocol_version),
      Bind(Unsigned("firmware_major", 40, 8), &IdentifyReply::firmware_major),
      Bind(Unsigned("firmware_minor", 48, 8), &IdentifyReply::firmware_minor),
      Bind(Unsigned("hardware", 56, 8), &IdentifyReply::hardware)};
};
template <>
struct Layout<ParameterReply> {
  static constexpr const char* kName = "parameter_read_reply";
  // A reply to a write has the next function.
  static constexpr Function kFunction = Function::kParameterRead;
  static constexpr std::uint8_t kLength = 6;
  static constexpr std::tuple kFields{
      Bind(InDetail("axis", kAxisNames), &ParameterReply::axis),
      Bind(Named("parameter", 0, 8, kParameterNames), &ParameterReply::parameter),
      Bind(Named("answer", 8, 8, kAnswerNames), &ParameterReply::answer),
      Bind(Signed("value", 16, 32, ""), &ParameterReply::value)};
};
template <>
struct Layout<SensorsReply> {
  static constexpr const char* kName = "sensors_reply";
  static constexpr Function kFunction = Function::kSensors;
  static constexpr std::uint8_t kLength = 8;
  static constexpr std::tuple kFields{
      Bind(InDetail("part", kSensorPartNames), &SensorsReply::part),
      BindAt(Unsigned("first", 0, 16, "counts"), &SensorsReply::counts, 0),
      BindAt(Unsigned("second", 16, 16, "counts"), &SensorsReply::counts, 1),
      BindAt(Unsigned("third", 32, 16, "counts"), &SensorsReply::counts, 2),
      BindAt(Unsigned("fourth", 48, 16, "counts"), &SensorsReply::counts, 3)};
};

// ---- what follows from the tables

/// The constant detail of messages in which no field stands there.
template <class Message>
concept HasConstantDetail = requires {
  Layout<Message>::kDetail;
};

/// The bits of the data that no field covers.
template <class Message>
constexpr std::uint64_t ReservedBits() {
  constexpr unsigned kBits = 8u * Layout<Message>::kLength;
  std::uint64_t free = kBits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << kBits) - 1;
  std::apply(
      [&](const auto&... field) {
        ((free &= field.row.in_detail
                      ? ~std::uint64_t{0}
                      : ~(((std::uint64_t{1} << field.row.bits) - 1) << field.row.first_bit)),
         ...);
      },
      Layout<Message>::kFields);
  return free;
}

}  // namespace layout
}  // namespace focalfleet
