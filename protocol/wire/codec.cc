#include "protocol/wire/codec.h"

#include <optional>
#include <type_traits>
#include <utility>

#include "protocol/base/limits.h"
#include "protocol/wire/layout.h"
#include "protocol/wire/message_rows.h"

namespace focalfleet {
namespace {

using layout::HasConstantDetail;
using layout::Layout;

// ---- one field

template <class T>
constexpr std::uint64_t BitsOf(const T& value) {
  if constexpr (requires { value.value; })
    return value.value;
  else
    return static_cast<std::uint64_t>(value);
}

template <class T>
constexpr void Store(std::int64_t value, T* out) {
  if constexpr (requires { out->value; })
    out->value = static_cast<decltype(out->value)>(value);
  else
    *out = static_cast<T>(value);
}

constexpr std::uint64_t Mask(const FieldRow& row) { return (std::uint64_t{1} << row.bits) - 1; }

void SetDataBits(std::uint64_t word, CanFrame* frame) {
  for (unsigned i = 0; i < 8; ++i) frame->data[i] = static_cast<std::uint8_t>(word >> (8 * i));
}

// ---- what no table contains

template <class Message>
Function FunctionOf(const Message&) {
  return Layout<Message>::kFunction;
}
Function FunctionOf(const ParameterReply& m) {
  return m.written ? Function::kParameterWrite : Function::kParameterRead;
}

template <class Message>
bool Consistent(const Message&) {
  return true;
}
bool Consistent(const VectorReply& m) {
  const std::int64_t position = std::int64_t{m.turns} * m.subdivision + m.vector;
  return m.vector < m.subdivision && position <= limits::kPositionMax &&
         position >= -limits::kPositionMax;
}

// ---- one message

template <class Message>
CanFrame EncodeOne(const Message& message, Address address, bool from_unit) {
  std::uint64_t word = 0;
  std::uint8_t detail = 0;
  if constexpr (HasConstantDetail<Message>) detail = Layout<Message>::kDetail;
  std::apply(
      [&](const auto&... field) {
        ((field.row.in_detail
              ? void(detail = static_cast<std::uint8_t>(BitsOf(field.access(message))))
              : void(word |= (BitsOf(field.access(message)) & Mask(field.row))
                             << field.row.first_bit)),
         ...);
      },
      Layout<Message>::kFields);
  CanFrame frame{
      Pack({FunctionOf(message), from_unit, address, detail}), Layout<Message>::kLength, {}};
  SetDataBits(word, &frame);
  return frame;
}

// Returns the rule that the frame breaks. Nothing: it breaks none, and the message is filled.
template <class Message>
std::optional<Malformed> DecodeOne(const CanFrame& frame, Message* message) {
  if (frame.length != Layout<Message>::kLength) return Malformed::kLength;
  const std::uint32_t detail = frame.id & 7;
  if constexpr (HasConstantDetail<Message>)
    if (detail != Layout<Message>::kDetail) return Malformed::kReserved;
  const std::uint64_t word = DataBits(frame);
  bool reserved = (word & layout::ReservedBits<Message>()) != 0;
  bool good = true;
  const auto take = [&](const auto& field) {
    const std::int64_t value = ValueOf(field.row, field.row.in_detail ? detail : word);
    const bool within = value >= field.row.min && value <= field.row.max;
    good &= within;
    // A detail value without a name in its field is reserved, like a detail that no field has.
    reserved |= field.row.in_detail && !within;
    Store(value, &field.access(*message));
  };
  std::apply([&](const auto&... field) { (take(field), ...); }, Layout<Message>::kFields);
  if (reserved) return Malformed::kReserved;
  if (!good || !Consistent(*message)) return Malformed::kValue;
  return std::nullopt;
}

// ---- one direction

template <class Variant>
using Decoded = tl::expected<Addressed<Variant>, Malformed>;
template <class Variant>
using Decoder = Decoded<Variant> (*)(const CanFrame&, Address);

template <class Variant, class Message>
Decoded<Variant> DecodeAs(const CanFrame& frame, Address address) {
  Message message{};
  if (const auto broken = DecodeOne(frame, &message)) return tl::unexpected(*broken);
  if constexpr (std::is_same_v<Message, ParameterReply>)
    message.written =
        (frame.id >> 20 & 63) == static_cast<std::uint32_t>(Function::kParameterWrite);
  return Addressed<Variant>{address, message};
}

Decoded<HostMessage> DecodeClock(const CanFrame& frame, Address address) {
  return (frame.id & 7) == Layout<ClockRequest>::kDetail
             ? DecodeAs<HostMessage, ClockRequest>(frame, address)
             : DecodeAs<HostMessage, Clock>(frame, address);
}

template <class Variant>
struct Decoders {
  std::array<Decoder<Variant>, kFunctionCount> of{};  // null: no such message in this direction
};

template <class Variant, std::size_t... i>
constexpr Decoders<Variant> MakeDecoders(std::index_sequence<i...>) {
  Decoders<Variant> decoders;
  ((decoders
        .of[static_cast<std::size_t>(Layout<std::variant_alternative_t<i, Variant>>::kFunction)] =
        &DecodeAs<Variant, std::variant_alternative_t<i, Variant>>),
   ...);
  return decoders;
}

constexpr Decoders<HostMessage> kHostDecoders = [] {
  auto decoders =
      MakeDecoders<HostMessage>(std::make_index_sequence<std::variant_size_v<HostMessage>>{});
  decoders.of[static_cast<std::size_t>(Function::kClock)] = &DecodeClock;  // two of one function
  return decoders;
}();
constexpr Decoders<UnitMessage> kUnitDecoders = [] {
  auto decoders =
      MakeDecoders<UnitMessage>(std::make_index_sequence<std::variant_size_v<UnitMessage>>{});
  decoders.of[static_cast<std::size_t>(Function::kParameterWrite)] =
      &DecodeAs<UnitMessage, ParameterReply>;
  return decoders;
}();

template <class Variant>
Decoded<Variant> Decode(const CanFrame& frame, bool from_unit, const Decoders<Variant>& decoders) {
  if (frame.id > kCanIdMax) return tl::unexpected(Malformed::kIdentifier);
  if (frame.length > 8) return tl::unexpected(Malformed::kLength);
  const std::uint32_t number = frame.id >> 20 & 63;
  if (number >= kFunctionCount || kFunctions[number].priority != frame.id >> 26)
    return tl::unexpected(Malformed::kFunction);
  if ((frame.id >> 19 & 1) != (from_unit ? 1u : 0u)) return tl::unexpected(Malformed::kDirection);
  const NodeId node{static_cast<std::uint8_t>(frame.id >> 11)};
  if (from_unit && node == kBroadcastNode) return tl::unexpected(Malformed::kNode);
  const Decoder<Variant> decoder = decoders.of[number];
  if (decoder == nullptr) return tl::unexpected(Malformed::kDirection);
  return decoder(frame, {node, static_cast<std::uint8_t>(frame.id >> 3)});
}

}  // namespace

CanFrame Encode(const HostMessage& message, Address address) {
  return std::visit([&](const auto& m) { return EncodeOne(m, address, false); }, message);
}

CanFrame Encode(const UnitMessage& message, Address address) {
  return std::visit([&](const auto& m) { return EncodeOne(m, address, true); }, message);
}

tl::expected<Addressed<HostMessage>, Malformed> DecodeHost(const CanFrame& frame) {
  return Decode(frame, false, kHostDecoders);
}

tl::expected<Addressed<UnitMessage>, Malformed> DecodeUnit(const CanFrame& frame) {
  return Decode(frame, true, kUnitDecoders);
}

}  // namespace focalfleet
