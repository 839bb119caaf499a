#include "daemon/ports/socket_frames.h"

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

namespace focalfleet {
namespace {

constexpr std::size_t kBatch = 64;

/// The room that one batch needs, wired up once a call.
struct Batch {
  std::array<can_frame, kBatch> frames{};
  std::array<iovec, kBatch> vectors{};
  std::array<mmsghdr, kBatch> messages{};
  struct Control {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(std::uint32_t))> bytes{};
  };
  std::array<Control, kBatch> control{};

  explicit Batch(bool with_control) {
    for (std::size_t i = 0; i < kBatch; ++i) {
      vectors[i] = {&frames[i], sizeof(can_frame)};
      messages[i].msg_hdr.msg_iov = &vectors[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      if (!with_control) continue;
      messages[i].msg_hdr.msg_control = control[i].bytes.data();
      messages[i].msg_hdr.msg_controllen = control[i].bytes.size();
    }
  }
};

/// The kernel's count of frames that found its receive queue full, where the socket asks for it.
void NoteOverflow(msghdr* header, PortCounters* counters) {
  for (cmsghdr* item = CMSG_FIRSTHDR(header); item != nullptr; item = CMSG_NXTHDR(header, item)) {
    if (item->cmsg_level != SOL_SOCKET || item->cmsg_type != SO_RXQ_OVFL) continue;
    std::uint32_t dropped = 0;
    std::memcpy(&dropped, CMSG_DATA(item), sizeof dropped);
    counters->lost = std::max<std::uint64_t>(counters->lost, dropped);
  }
}

}  // namespace

can_frame ToSocketFrame(const CanFrame& frame) {
  can_frame out{};
  out.can_id = frame.id | CAN_EFF_FLAG;
  out.len = frame.length;
  std::copy(frame.data.begin(), frame.data.end(), out.data);
  return out;
}

std::optional<CanFrame> FromSocketFrame(const can_frame& frame) {
  if ((frame.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) != CAN_EFF_FLAG)
    return std::nullopt;
  if (frame.len > CAN_MAX_DLEN) return std::nullopt;
  CanFrame out;
  out.id = frame.can_id & CAN_EFF_MASK;
  out.length = frame.len;
  // Bytes past the length are nobody's; equal frames shall compare equal.
  std::copy_n(frame.data, frame.len, out.data.begin());
  return out;
}

BatchSent SendFrames(int fd, std::span<const CanFrame> frames) {
  BatchSent sent;
  Batch batch(/*with_control=*/false);
  while (sent.taken < frames.size()) {
    const auto chunk = frames.subspan(sent.taken, std::min(kBatch, frames.size() - sent.taken));
    std::ranges::transform(chunk, batch.frames.begin(), ToSocketFrame);
    const int done = ::sendmmsg(fd, batch.messages.data(), static_cast<unsigned>(chunk.size()),
                                MSG_DONTWAIT | MSG_NOSIGNAL);
    if (done < 0) {
      if (errno == EINTR) continue;
      sent.error = errno;
      return sent;
    }
    sent.taken += static_cast<std::size_t>(done);
  }
  return sent;
}

BatchReceived ReceiveFrames(int fd, const ReceivedFrame& stamp, std::vector<ReceivedFrame>* out,
                            PortCounters* counters, std::vector<can_frame>* errors) {
  for (std::size_t total = 0; total < kFramesPerReceive;) {
    Batch batch(/*with_control=*/true);
    const int got = ::recvmmsg(fd, batch.messages.data(), kBatch, MSG_DONTWAIT, nullptr);
    if (got < 0) {
      if (errno == EINTR) continue;
      return {.closed = false, .error = errno == EAGAIN ? 0 : errno};
    }
    const auto count = static_cast<std::size_t>(got);
    for (std::size_t i = 0; i < count; ++i) {
      mmsghdr& message = batch.messages[i];
      if (message.msg_len == 0) return {.closed = true, .error = 0};
      NoteOverflow(&message.msg_hdr, counters);
      const bool whole =
          message.msg_len == sizeof(can_frame) && (message.msg_hdr.msg_flags & MSG_TRUNC) == 0;
      const auto frame = whole ? FromSocketFrame(batch.frames[i]) : std::nullopt;
      if (frame) {
        out->push_back({stamp.bus, stamp.at, *frame});
      } else if (whole && errors != nullptr && (batch.frames[i].can_id & CAN_ERR_FLAG) != 0) {
        errors->push_back(batch.frames[i]);
      } else {
        ++counters->rejected;
      }
    }
    total += count;
    if (count < kBatch) return {};
  }
  return {};
}

}  // namespace focalfleet
