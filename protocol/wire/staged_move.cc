#include "protocol/wire/staged_move.h"

#include "protocol/wire/codec.h"

namespace focalfleet {
namespace {

constexpr std::array<std::uint32_t, 256> MakeCrcTable() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t crc = i;
    for (int bit = 0; bit < 8; ++bit) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
    table[i] = crc;
  }
  return table;
}
constexpr auto kCrcTable = MakeCrcTable();

std::uint32_t Extend(std::uint32_t crc, const CanFrame& frame) {
  for (const std::uint8_t byte : frame.payload()) crc = kCrcTable[(crc ^ byte) & 255] ^ crc >> 8;
  return crc;
}

}  // namespace

std::uint32_t Digest(const StagedMove& move) {
  const auto& theta = move.path[Index(Axis::kTheta)];
  const auto& phi = move.path[Index(Axis::kPhi)];
  std::uint32_t crc = 0xffffffffu;
  crc = Extend(
      crc, Encode(HostMessage{StageBegin{move.move, {theta.size(), phi.size()}, move.mode}}, {}));
  for (const Axis axis : kAxes) {
    std::uint8_t index = 0;
    for (const Segment& segment : move.path[Index(axis)].segments())
      crc = Extend(crc, Encode(HostMessage{StageSegment{axis, index++, segment}}, {}));
  }
  return ~crc;
}

}  // namespace focalfleet
