// The input is any bytes as a CAN FD frame: identifier (4, little-endian), length (1), data. A
// valid group is put together again from its entries and must give the same bits.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "protocol/base/check.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {
namespace {

void TryBytes(const std::uint8_t* data, std::size_t size) {
  if (size < 5) return;
  FdFrame group;
  std::memcpy(&group.id, data, 4);
  group.length = data[4];
  std::memcpy(group.data.data(), data + 5, std::min(size - 5, group.data.size()));
  const auto entries = UnpackGroup(group);
  if (!entries) return;
  const std::span<const CanFrame> frames(entries->frame.data(), entries->count);
  FOCALFLEET_CHECK(std::all_of(frames.begin(), frames.end(), CanBeGrouped));
  FdFrame again;
  FOCALFLEET_CHECK(PackGroup(frames, &again) == entries->count);
  FOCALFLEET_CHECK(again.id == group.id && again.length == group.length &&
                   std::equal(again.payload().begin(), again.payload().end(), group.data.begin()));
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  focalfleet::TryBytes(data, size);
  return 0;
}
