// Every kind of frame as rows: for what prints frames or describes them to other programs (the DBC
// file, the dissector, docs/protocol.md, decoded logs). They are the codec's own tables (layout.h).
//
// The data bytes are one little-endian number of 8 * length bits, and a field is a run of its bits:
// first bit 8 * byte + bit of the byte. A field may also stand in the identifier's three detail
// bits. What no field covers is reserved.
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
  bool in_detail = false;  // of the identifier; otherwise of the data
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

/// All kinds of frames, those from the host first, by function and detail.
std::span<const MessageRow> MessageRows();

/// The row of a frame that DecodeHost or DecodeUnit takes; null where no row has its function,
/// direction and length.
const MessageRow* RowOf(const CanFrame& frame);

/// One field of a frame, taken out of the data bytes as one number, or of the detail.
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
