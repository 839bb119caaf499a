#include "daemon/ports/socket_frames.h"

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <ctime>
#include <optional>
#include <utility>

namespace focalfleet {
namespace {

constexpr std::size_t kBatch = 64;

/// The buffers of one batch, linked once a call.
struct Batch {
  std::array<canfd_frame, kBatch> frames;  // a can_frame is its front
  std::array<iovec, kBatch> vectors;
  std::array<mmsghdr, kBatch> messages;
  struct Control {
    static constexpr std::size_t kBytes =
        CMSG_SPACE(sizeof(std::uint32_t)) + CMSG_SPACE(sizeof(timespec));
    alignas(cmsghdr) std::array<char, kBytes> bytes;
  };
  std::array<Control, kBatch> control;

  // Only the needed part is initialised: most batches are small.
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init)
  Batch(std::size_t count, bool with_control) {
    for (std::size_t i = 0; i < count; ++i) {
      messages[i] = {};
      vectors[i] = {&frames[i], with_control ? sizeof(canfd_frame) : sizeof(can_frame)};
      messages[i].msg_hdr.msg_iov = &vectors[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      if (!with_control) continue;
      messages[i].msg_hdr.msg_control = control[i].bytes.data();
      messages[i].msg_hdr.msg_controllen = control[i].bytes.size();
    }
  }
};

struct Reported {
  std::uint32_t dropped = 0;            // frames lost at a full receive queue, in total
  std::optional<std::int64_t> wall_ns;  // the kernel's time of arrival
};

/// The kernel's report on a frame, where the socket asks for it.
Reported ReadControl(msghdr* header) {
  Reported reported;
  for (cmsghdr* item = CMSG_FIRSTHDR(header); item != nullptr; item = CMSG_NXTHDR(header, item)) {
    if (item->cmsg_level != SOL_SOCKET) continue;
    if (item->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&reported.dropped, CMSG_DATA(item), sizeof reported.dropped);
    } else if (item->cmsg_type == SO_TIMESTAMPNS) {
      timespec at{};
      std::memcpy(&at, CMSG_DATA(item), sizeof at);
      reported.wall_ns = at.tv_sec * std::int64_t{1'000'000'000} + at.tv_nsec;
    }
  }
  return reported;
}

bool IsFromUnit(const CanFrame& frame) { return (frame.id >> 19 & 1) != 0; }

/// A packet that was read.
struct Packet {
  const canfd_frame* raw = nullptr;
  std::size_t size = 0;  // bytes; 0: more than any frame has
  bool own = false;      // the host's own frame, echoed
  bool local = false;    // sent on this host
  Reported reported;
};

can_frame Classic(const canfd_frame& frame) {
  can_frame classic;
  static_assert(offsetof(canfd_frame, data) == offsetof(can_frame, data));
  std::memcpy(&classic, &frame, sizeof classic);
  return classic;
}

/// The data with which a batch's frames are stamped.
struct Stamp {
  BusId bus;
  HostInstant at;  // the clock after that
  HostClock clock;
};

HostInstant StampOf(const Packet& packet, const Stamp& stamp, const Aside* aside) {
  if (aside == nullptr || !aside->stamps || !packet.reported.wall_ns) return stamp.at;
  return aside->stamps->At(*packet.reported.wall_ns, stamp.clock);
}

/// Appends the frames of a group.
void TakeApart(const Packet& packet, const Stamp& stamp, std::vector<ReceivedFrame>* out,
               PortCounters* counters, const Aside& aside) {
  const auto group = FromSocketFrame(*packet.raw);
  const auto entries =
      group ? UnpackGroup(*group) : tl::unexpected<Malformed>(Malformed::kIdentifier);
  if (!entries) {
    ++counters->rejected;
    return;
  }
  if (aside.only_units) return;  // from another host
  const HostInstant at = StampOf(packet, stamp, &aside);
  for (std::size_t i = 0; i < entries->count; ++i)
    out->push_back({stamp.bus, at, entries->frame[i]});
}

void Sort(const Packet& packet, const Stamp& stamp, std::vector<ReceivedFrame>* out,
          PortCounters* counters, Aside* aside) {
  counters->lost = std::max<std::uint64_t>(counters->lost, packet.reported.dropped);
  if (packet.own && aside != nullptr) {
    ++aside->confirmed;
    return;
  }
  if (packet.size == sizeof(canfd_frame) && aside != nullptr && aside->groups)
    return TakeApart(packet, stamp, out, counters, *aside);
  const bool whole = packet.size == sizeof(can_frame);
  const auto frame = whole ? FromSocketFrame(Classic(*packet.raw)) : std::nullopt;
  if (!frame) {
    if (whole && aside != nullptr && (packet.raw->can_id & CAN_ERR_FLAG) != 0)
      aside->errors.push_back(Classic(*packet.raw));
    else
      ++counters->rejected;
    return;
  }
  const bool from_unit = IsFromUnit(*frame);
  if (aside != nullptr && aside->only_units && !from_unit) return;  // from another host
  // Hosts may share a machine: their frames are heard. No unit is a program of this one.
  if (from_unit && packet.local && aside != nullptr && aside->no_local) {
    ++counters->forged;
    return;
  }
  out->push_back({stamp.bus, StampOf(packet, stamp, aside), *frame});
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
  // Bytes past the length are undefined; equal frames must compare equal.
  std::copy_n(frame.data, frame.len, out.data.begin());
  return out;
}

BatchSent SendFrames(int fd, std::span<const CanFrame> frames) {
  BatchSent sent;
  Batch batch(std::min(kBatch, frames.size()), /*with_control=*/false);
  while (sent.taken < frames.size()) {
    const auto chunk = frames.subspan(sent.taken, std::min(kBatch, frames.size() - sent.taken));
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      const can_frame raw = ToSocketFrame(chunk[i]);
      std::memcpy(&batch.frames[i], &raw, sizeof raw);
    }
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

canfd_frame ToSocketFrame(const FdFrame& frame) {
  canfd_frame out{};
  out.can_id = frame.id | CAN_EFF_FLAG;
  out.len = frame.length;
  out.flags = CANFD_BRS;
  std::ranges::copy(frame.data, out.data);
  return out;
}

std::optional<FdFrame> FromSocketFrame(const canfd_frame& frame) {
  if ((frame.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) != CAN_EFF_FLAG)
    return std::nullopt;
  if (frame.len > CANFD_MAX_DLEN || FdLength(frame.len) != frame.len) return std::nullopt;
  FdFrame out;
  out.id = frame.can_id & CAN_EFF_MASK;
  out.length = frame.len;
  std::copy_n(frame.data, frame.len, out.data.begin());
  return out;
}

int SendGroup(int fd, const FdFrame& group) {
  const canfd_frame raw = ToSocketFrame(group);
  while (::send(fd, &raw, sizeof raw, MSG_DONTWAIT | MSG_NOSIGNAL) < 0)
    if (errno != EINTR) return errno;
  return 0;
}

WallAhead ReadWallAhead() {
  const std::int64_t before_ns = ReadMonotonicNs();
  const std::int64_t wall_ns = ReadClockNs(CLOCK_REALTIME);
  return {wall_ns - ReadMonotonicNs(), wall_ns - before_ns};
}

FrameStamps::Readings FrameStamps::Readings::And(const WallAhead& ahead) const {
  return {{std::max(common.low_ns, ahead.low_ns), std::min(common.high_ns, ahead.high_ns)},
          std::min(least_ns, ahead.low_ns)};
}

void FrameStamps::HaveRead(HostInstant before, HostInstant after, bool empty) {
  const WallAhead ahead = read_();
  around_ = since_empty_.And(ahead);
  since_ = emptied_;
  now_ = after;
  // The next frames may have arrived before this reading of the clocks, but not before the last
  // one.
  since_empty_ = empty ? Readings{last_, last_.low_ns}.And(ahead) : around_;
  if (empty) emptied_ = before;
  last_ = ahead;
}

// The lower bound is used: a small clock step that hides within the readings makes no stamp too
// early.
HostInstant FrameStamps::At(std::int64_t wall_ns, const HostClock& clock) const {
  const HostInstant at = clock.FromMonotonic(wall_ns - around_.least_ns);
  return around_.alike() && at >= since_ && at <= now_ ? at : now_;
}

BatchReceived ReceiveFrames(int fd, const FrameSource& source, std::vector<ReceivedFrame>* out,
                            PortCounters* counters, Aside* aside) {
  Stamp stamp{source.bus, source.clock.Now(), source.clock};
  for (std::size_t total = 0; total < kFramesPerReceive;) {
    Batch batch(kBatch, /*with_control=*/true);
    const auto receive = aside != nullptr ? aside->receive : ::recvmmsg;
    const int got = receive(fd, batch.messages.data(), kBatch, MSG_DONTWAIT, nullptr);
    if (got < 0) {
      if (errno == EINTR) continue;
      return {.closed = false, .error = errno == EAGAIN ? 0 : errno};
    }
    const auto count = static_cast<std::size_t>(got);
    const HostInstant before = std::exchange(stamp.at, source.clock.Now());
    if (aside != nullptr && aside->stamps)
      aside->stamps->HaveRead(before, stamp.at, count < kBatch);
    for (std::size_t i = 0; i < count; ++i) {
      mmsghdr& message = batch.messages[i];
      if (message.msg_len == 0) return {.closed = true, .error = 0};
      const auto flags = static_cast<unsigned>(message.msg_hdr.msg_flags);
      Sort({.raw = &batch.frames[i],
            .size = (flags & MSG_TRUNC) == 0 ? message.msg_len : 0,
            .own = (flags & MSG_CONFIRM) != 0,
            .local = (flags & MSG_DONTROUTE) != 0,
            .reported = ReadControl(&message.msg_hdr)},
           stamp, out, counters, aside);
    }
    total += count;
    if (count < kBatch) return {};
  }
  return {};
}

}  // namespace focalfleet
