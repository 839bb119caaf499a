// How long a frame occupies the bus, to the bit (ISO 11898-1, CAN 2.0B extended data frame):
//
//   stuffed    SOF 1, base id 11, SRR 1, IDE 1, id extension 18, RTR 1, r1 r0 2, DLC 4, data 8n,
//              CRC 15
//   unstuffed  CRC delimiter 1, ACK slot 1, ACK delimiter 1, EOF 7, intermission 3
//
// so 54 + 8n + 13 bits and a stuff bit after every five equal ones: 131..160 bits for 8 bytes.
#pragma once

#include <cstdint>

#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"

namespace focalfleet {

/// Bits from start of frame to the end of the intermission, stuff bits of this very content
/// included.
std::uint32_t FrameBits(const CanFrame& frame);

/// CRC-15 of the frame as the controller computes it (polynomial 0x4599).
std::uint16_t FrameCrc(const CanFrame& frame);

inline constexpr std::uint32_t kFrameBitsMax = 160;  // 8 bytes, worst stuffing

constexpr DurationNs BitTime(std::uint32_t bits, std::uint32_t bit_rate_bps) {
  return {static_cast<std::int64_t>(bits) * 1'000'000'000 / bit_rate_bps};
}

}  // namespace focalfleet
