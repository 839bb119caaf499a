// A group is one CAN FD frame that carries many staging frames. On a bus whose controllers all
// speak CAN FD the host puts the begins, segments and read-backs of several units into one frame.
// The frame has up to 64 bytes at the data bit rate. Every unit takes its own entries, as if each
// had come alone. All other frames, every answer included, stay classic CAN; the rest of the
// protocol is independent of groups.
//
//   a group      id: priority 4, function 16, node 255 (all), sequence 0, detail 0
//   its data     entries one after another: node, sequence, function << 3 | detail, then the
//                data bytes of that frame; FFh fills the rest up to a length that CAN FD has
//
// A unit drops the whole group where any entry breaks a rule.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/wire/can_frame.h"
#include "protocol/wire/codec.h"

namespace focalfleet {

struct FdFrame {
  std::uint32_t id = 0;     // 29 bits
  std::uint8_t length = 0;  // 0..8, 12, 16, 20, 24, 32, 48 or 64
  std::array<std::uint8_t, 64> data{};

  [[nodiscard]] constexpr std::span<const std::uint8_t> payload() const {
    return {data.data(), length};
  }
  constexpr bool operator==(const FdFrame&) const = default;
};

/// The lengths that the four bits of a CAN FD frame's DLC stand for. 0..8 are as in classic CAN.
inline constexpr std::array<std::uint8_t, 16> kFdLengths = {0, 1,  2,  3,  4,  5,  6,  7,
                                                            8, 12, 16, 20, 24, 32, 48, 64};
/// The code of the shortest length that holds `bytes`. Pre: at most 64.
constexpr std::uint8_t FdLengthCode(std::size_t bytes) {
  std::uint8_t code = 0;
  while (kFdLengths[code] < bytes) ++code;
  return code;
}
constexpr std::uint8_t FdLength(std::size_t bytes) { return kFdLengths[FdLengthCode(bytes)]; }

inline constexpr auto kGroupFunction = static_cast<std::uint32_t>(Function::kStageGroup);
inline constexpr std::uint32_t kGroupId = 4u << 26 | kGroupFunction << 20 | 255u << 11;
inline constexpr std::size_t kGroupEntriesMax = 12;  // read-backs: 5 bytes each
inline constexpr std::size_t kGroupEntriesMin = 2;   // a frame alone goes as a classic frame

/// True where a group can carry the frame: a host's stage_begin, stage_segment or confirm to one
/// unit, of the length that it must have.
bool CanBeGrouped(const CanFrame& frame);

/// The data bytes of a group that this frame takes. Pre: CanBeGrouped.
constexpr std::size_t GroupedSize(const CanFrame& frame) { return 3u + frame.length; }

/// Puts as many of `frames` as fit into one group, from the front, in their order, and returns
/// their number. 0: the first frame cannot be grouped.
std::size_t PackGroup(std::span<const CanFrame> frames, FdFrame* group);

struct GroupEntries {
  std::array<CanFrame, kGroupEntriesMax> frame;
  std::size_t count = 0;
};
/// The entries of a group, for any frame. They are frames that DecodeHost accepts and CanBeGrouped
/// allows.
tl::expected<GroupEntries, Malformed> UnpackGroup(const FdFrame& group);

}  // namespace focalfleet
