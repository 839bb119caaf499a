// The codec turns values into frames and back. Encode is total. Decode is total over all frames:
// any identifier and any bytes give a message or a Malformed that names the broken rule. The codec
// uses no heap, clock or I/O. Numbers are little-endian. Reserved bits and bytes are zero and
// checked, so that a later version can give them a meaning that this one does not misread.
#pragma once

#include <tl/expected.hpp>

#include "protocol/wire/can_frame.h"
#include "protocol/wire/identifier.h"
#include "protocol/wire/messages.h"

namespace focalfleet {

CanFrame Encode(const HostMessage& message, Address address);
CanFrame Encode(const UnitMessage& message, Address address);

/// The rule that a frame broke.
enum class Malformed : std::uint8_t {
  kIdentifier,  // more than 29 bits
  kFunction,    // no such function, or the wrong priority for it
  kDirection,   // a host frame in place of a unit's, or no such message in this direction
  kNode,        // an answer from the broadcast address
  kLength,
  kValue,     // an enumerator, count or range
  kReserved,  // a bit that must be zero
};
const char* Name(Malformed malformed);

template <class Message>
struct Addressed {
  Address address;
  Message message;
};

tl::expected<Addressed<HostMessage>, Malformed> DecodeHost(const CanFrame& frame);
tl::expected<Addressed<UnitMessage>, Malformed> DecodeUnit(const CanFrame& frame);

}  // namespace focalfleet
