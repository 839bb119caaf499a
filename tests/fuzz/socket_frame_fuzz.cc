// The input is any bytes as a frame from a socket. A frame is accepted only where it is a 29-bit
// data frame with nothing past its length. On its way back it is the same. The same bytes are also
// read as a controller's error frame: a state or none, and causes in words. The first bytes are
// also read as a CAN FD frame.
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "daemon/ports/can_errors.h"
#include "daemon/ports/socket_frames.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

void TryBytes(const std::uint8_t* data, std::size_t size) {
  if (canfd_frame fd{}; size >= sizeof fd) {
    std::memcpy(&fd, data, sizeof fd);
    if (const auto frame = FromSocketFrame(fd)) {
      FOCALFLEET_CHECK(frame->id <= kCanIdMax && FdLength(frame->length) == frame->length);
      FOCALFLEET_CHECK(FromSocketFrame(ToSocketFrame(*frame)) == frame);
    }
  }
  ErrorTally tally;
  for (; size >= sizeof(can_frame); data += sizeof(can_frame), size -= sizeof(can_frame)) {
    can_frame raw{};
    std::memcpy(&raw, data, sizeof raw);
    tally.Note(raw);
    const auto state = LinkStateOf(raw);
    FOCALFLEET_CHECK(!state || *state <= LinkState::kDown);
    FOCALFLEET_CHECK(!IsWarning(raw) || state != LinkState::kOff);
    FOCALFLEET_CHECK(tally.Causes().size() < 100);
    const auto frame = FromSocketFrame(raw);
    const bool ours = (raw.can_id & CAN_EFF_FLAG) != 0 &&
                      (raw.can_id & (CAN_RTR_FLAG | CAN_ERR_FLAG)) == 0 && raw.len <= CAN_MAX_DLEN;
    FOCALFLEET_CHECK(frame.has_value() == ours);
    if (!frame) continue;
    FOCALFLEET_CHECK(frame->id <= kCanIdMax && frame->length == raw.len);
    for (std::size_t i = frame->length; i < frame->data.size(); ++i)
      FOCALFLEET_CHECK(frame->data[i] == 0);
    FOCALFLEET_CHECK(FromSocketFrame(ToSocketFrame(*frame)) == frame);
  }
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  focalfleet::TryBytes(data, size);
  return 0;
}
