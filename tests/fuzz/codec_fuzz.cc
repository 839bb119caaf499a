// The input is any bytes as a frame: identifier (4, little-endian), length (1), data. A decoded
// frame is encoded again and must give the same bits. No two frames therefore mean the same, and no
// frame is two messages.
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "protocol/base/check.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet {
namespace {

bool SameBits(const CanFrame& a, const CanFrame& b) {
  return a.id == b.id && a.length == b.length &&
         std::memcmp(a.data.data(), b.data.data(), a.length) == 0;
}

void Try(const CanFrame& frame) {
  const auto host = DecodeHost(frame);
  const auto unit = DecodeUnit(frame);
  FOCALFLEET_CHECK(!host || !unit);
  if (host) FOCALFLEET_CHECK(SameBits(Encode(host->message, host->address), frame));
  if (unit) FOCALFLEET_CHECK(SameBits(Encode(unit->message, unit->address), frame));
  if (host || unit) FOCALFLEET_CHECK(FrameBits(frame) <= kFrameBitsMax);
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kRecord = 13;
  for (; size >= 5; data += kRecord, size -= kRecord) {
    focalfleet::CanFrame frame;
    std::memcpy(&frame.id, data, 4);
    frame.length = data[4];
    std::memcpy(frame.data.data(), data + 5, size - 5 < 8 ? size - 5 : 8);
    focalfleet::Try(frame);
    if (size < kRecord) break;
  }
  return 0;
}
