#include "protocol/wire/stage_group.h"

#include <algorithm>
#include <optional>

#include "protocol/wire/layout.h"

namespace focalfleet {
namespace {

// This byte stands where a node would stand. No node has this number, so the entries end here.
constexpr std::uint8_t kFill = 0xff;
constexpr std::size_t kHeader = 3;

// The data length of a function that groups carry.
std::optional<std::uint8_t> LengthOf(std::uint32_t function) {
  switch (static_cast<Function>(function)) {
    case Function::kStageBegin:
      return layout::Layout<StageBegin>::kLength;
    case Function::kStageSegment:
      return layout::Layout<StageSegment>::kLength;
    case Function::kConfirm:
      return layout::Layout<Confirm>::kLength;
    default:
      return std::nullopt;
  }
}

}  // namespace

bool CanBeGrouped(const CanFrame& frame) {
  const std::uint32_t function = frame.id >> 20 & 63;
  const std::optional<std::uint8_t> length = LengthOf(function);
  return length && frame.length == *length && frame.id <= kCanIdMax &&
         frame.id >> 26 == InfoOf(static_cast<Function>(function)).priority &&
         (frame.id >> 19 & 1) == 0 && (frame.id >> 11 & 255) < limits::kNodesPerBus;
}

std::size_t PackGroup(std::span<const CanFrame> frames, FdFrame* group) {
  *group = {.id = kGroupId};
  std::size_t taken = 0;
  std::size_t size = 0;
  for (const CanFrame& frame : frames) {
    if (!CanBeGrouped(frame) || size + GroupedSize(frame) > group->data.size()) break;
    group->data[size++] = static_cast<std::uint8_t>(frame.id >> 11);  // node
    group->data[size++] = static_cast<std::uint8_t>(frame.id >> 3);   // sequence
    group->data[size++] =
        static_cast<std::uint8_t>((frame.id >> 20 & 31) << 3 | (frame.id & 7));  // function, detail
    for (const std::uint8_t byte : frame.payload()) group->data[size++] = byte;
    ++taken;
  }
  group->length = FdLength(size);
  std::fill(group->data.begin() + static_cast<std::ptrdiff_t>(size),
            group->data.begin() + group->length, kFill);
  return taken;
}

tl::expected<GroupEntries, Malformed> UnpackGroup(const FdFrame& group) {
  if (group.id > kCanIdMax) return tl::unexpected(Malformed::kIdentifier);
  if ((group.id >> 20 & 63) != kGroupFunction || group.id >> 26 != kGroupId >> 26)
    return tl::unexpected(Malformed::kFunction);
  if (group.id != kGroupId) return tl::unexpected(Malformed::kReserved);
  if (group.length > group.data.size() || FdLength(group.length) != group.length)
    return tl::unexpected(Malformed::kLength);

  GroupEntries entries;
  std::span<const std::uint8_t> rest = group.payload();
  while (!rest.empty() && rest[0] != kFill) {
    if (rest.size() < kHeader) return tl::unexpected(Malformed::kLength);
    const std::uint32_t function = rest[2] >> 3;
    const std::optional<std::uint8_t> length = LengthOf(function);
    if (!length) return tl::unexpected(Malformed::kFunction);
    if (rest[0] >= limits::kNodesPerBus) return tl::unexpected(Malformed::kNode);
    if (rest.size() < kHeader + *length) return tl::unexpected(Malformed::kLength);
    CanFrame& frame = entries.frame[entries.count++];
    frame.id = Pack({.function = static_cast<Function>(function),
                     .address = {NodeId{rest[0]}, rest[1]},
                     .detail = static_cast<std::uint8_t>(rest[2] & 7)});
    frame.length = *length;
    std::copy_n(rest.begin() + kHeader, *length, frame.data.begin());
    if (const auto message = DecodeHost(frame); !message) return tl::unexpected(message.error());
    rest = rest.subspan(kHeader + *length);
  }
  const bool filled =
      std::all_of(rest.begin(), rest.end(), [](std::uint8_t byte) { return byte == kFill; });
  const std::size_t used = group.length - rest.size();
  if (!filled || entries.count == 0) return tl::unexpected(Malformed::kReserved);
  if (FdLength(used) != group.length) return tl::unexpected(Malformed::kLength);
  return entries;
}

}  // namespace focalfleet
