// The time for which a frame occupies the bus, to the bit (ISO 11898-1, CAN 2.0B extended data
// frame):
//
//   stuffed    SOF 1, base id 11, SRR 1, IDE 1, id extension 18, RTR 1, r1 r0 2, DLC 4, data 8n,
//              CRC 15
//   unstuffed  CRC delimiter 1, ACK slot 1, ACK delimiter 1, EOF 7, intermission 3
//
// These are 54 + 8n + 13 bits, and a stuff bit after every five equal ones: 131..160 bits for 8
// bytes.
//
// A group is a CAN FD frame (extended format, with bit rate switch). Its inner part goes at the
// data bit rate:
//
//   nominal    SOF 1, base id 11, SRR 1, IDE 1, id extension 18, RRS 1, FDF 1, res 1, BRS 1
//   data rate  ESI 1, DLC 4, data 8n; stuff count 4 and CRC 17 (21 beyond 16 bytes), with a fixed
//              stuff bit before the first and after every fourth of these; CRC delimiter 1
//   nominal    ACK slot 1, ACK delimiter 1, EOF 7, intermission 3
//
// The rate changes at the sample points of BRS and of the CRC delimiter, so these counts are exact
// to a bit.
#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {

/// The bits from start of frame to the end of the intermission, with the stuff bits of this
/// content.
std::uint32_t FrameBits(const CanFrame& frame);

/// The bits of a CAN FD frame at each of its two rates.
struct FdFrameBits {
  std::uint32_t nominal = 0;
  std::uint32_t data = 0;
};
FdFrameBits FrameBits(const FdFrame& frame);

inline constexpr std::uint32_t kFrameBitsMin = 67;   // no data, no stuffing; each byte adds 8 bits
inline constexpr std::uint32_t kFrameBitsMax = 160;  // 8 bytes, worst stuffing

/// The levels on the wire from start of frame to the end of the CRC sequence, bit by bit.
struct FrameLevels {
  std::bitset<kFrameBitsMax> recessive;
  std::bitset<kFrameBitsMax> stuff;  // bits that carry nothing
  std::uint32_t bits = 0;            // recorded so far; the unstuffed rest follows
  // The bits of the arbitration field; RTR is the last of them.
  std::uint32_t arbitration = 0;
};
FrameLevels LevelsOf(const CanFrame& frame);

constexpr DurationNs BitTime(std::uint32_t bits, std::uint32_t bit_rate_bps) {
  return {static_cast<std::int64_t>(bits) * 1'000'000'000 / bit_rate_bps};
}

/// The bit rates of one bus.
struct BusRates {
  std::uint32_t nominal_bps = 1'000'000;
  // Bit rate of the inner part of CAN FD frames; 0: the bus carries no such frames.
  std::uint32_t data_bps = 0;
};

constexpr DurationNs BitTime(const FdFrameBits& bits, const BusRates& rates) {
  return BitTime(bits.nominal, rates.nominal_bps) + BitTime(bits.data, rates.data_bps);
}

/// The duration in bits of the nominal rate, rounded up: bits at the data rate count for their
/// time.
constexpr std::uint32_t NominalBits(const FdFrameBits& bits, const BusRates& rates) {
  const std::uint64_t scaled = std::uint64_t{bits.data} * rates.nominal_bps;
  return bits.nominal + static_cast<std::uint32_t>((scaled + rates.data_bps - 1) / rates.data_bps);
}

/// Bits of the longest group: 64 bytes, worst stuffing.
constexpr FdFrameBits kGroupBitsMax{.nominal = 53, .data = 679};

/// The longest frame that the bus carries. Units: bits of the nominal rate.
constexpr std::uint32_t LongestFrameBits(const BusRates& rates) {
  const std::uint32_t group = rates.data_bps == 0 ? 0 : NominalBits(kGroupBitsMax, rates);
  return group > kFrameBitsMax ? group : kFrameBitsMax;
}

/// The frames that go over the bus as one: a group, or one frame alone.
struct OnWire {
  std::size_t frames = 0;
  std::uint32_t bits = 0;  // of the nominal rate
};
/// The front of a queue of frames, as the bus carries it: a group or one frame. Pre: `frames` is
/// not empty. Cost: at most the first kGroupEntriesMax are looked at.
OnWire NextOnWire(std::span<const CanFrame> frames, const BusRates& rates);

/// The time of all frames on the bus. Units: bits of the nominal rate.
std::uint64_t BitsOnWire(std::span<const CanFrame> frames, const BusRates& rates);

}  // namespace focalfleet
