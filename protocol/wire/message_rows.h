// Every kind of frame as rows, for programs that print frames or describe them (the DBC file, the
// dissector, docs/protocol.md, decoded logs). The rows are the codec's own tables (layout.h).
//
// The data bytes are one little-endian number of 8 * length bits, and a field is a run of its bits.
// The first bit is 8 * byte + bit of the byte. A field may also stand in the identifier's three
// detail bits. Bits that no field covers are reserved.
#pragma once

#include <cstdint>
#include <span>

#include "protocol/wire/can_frame.h"
#include "protocol/wire/identifier.h"

namespace focalfleet {

struct FieldRow {
  const char* name;
  std::uint8_t first_bit;
  std::uint8_t bits;
  bool in_detail = false;  // within the identifier; otherwise within the data
  bool is_signed = false;
  std::int64_t min = 0;
  std::int64_t max = 0;
  const char* unit = "";                    // empty: a number, or a name
  std::span<const char* const> names = {};  // of an enumeration's values 0, 1, ...
};

struct MessageRow {
  const char* name;
  Function function;
  bool from_unit;
  std::uint8_t detail;  // where no field stands there
  std::uint8_t length;  // bytes
  std::span<const FieldRow> fields;

  [[nodiscard]] constexpr const FieldRow* detail_field() const {
    for (const FieldRow& field : fields)
      if (field.in_detail) return &field;
    return nullptr;
  }
};

/// All kinds of frames, those from the host first, ordered by function and detail.
std::span<const MessageRow> MessageRows();

/// The row of a frame that DecodeHost or DecodeUnit accepts. Null: no row has its function,
/// direction and length.
const MessageRow* RowOf(const CanFrame& frame);

/// A field of a frame, taken from the data bytes as one number, or from the detail.
constexpr std::int64_t ValueOf(const FieldRow& field, std::uint64_t bits) {
  const unsigned above = 64u - field.bits - field.first_bit;
  const std::uint64_t left = bits << above;
  return field.is_signed ? static_cast<std::int64_t>(left) >> (64u - field.bits)
                         : static_cast<std::int64_t>(left >> (64u - field.bits));
}
constexpr std::uint64_t DataBits(const CanFrame& frame) {
  std::uint64_t bits = 0;
  for (unsigned i = 0; i < 8; ++i) bits |= std::uint64_t{frame.data[i]} << (8 * i);
  return bits;
}
constexpr std::int64_t ValueOf(const FieldRow& field, const CanFrame& frame) {
  return ValueOf(field, field.in_detail ? frame.id & 7 : DataBits(frame));
}

}  // namespace focalfleet
