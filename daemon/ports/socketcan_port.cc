#include "daemon/ports/socketcan_port.h"

#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace focalfleet {
namespace {

constexpr DurationNs kLookPeriod = Milliseconds(1000);  // real time
/// A confirmation that has not come back by then is lost, unless the kernel still holds the frame.
/// On a bus at its limit this time is 6000 frames.
constexpr DurationNs kConfirmationLost = Milliseconds(1000);
constexpr DurationNs kFull = Milliseconds(1);
/// Lost and forged frames are a bus' trouble for so long after the last one: as long as equal
/// alarms are folded. With less, each burst would be an alarm of its own; more shows what is over.
constexpr DurationNs kMissedShown = Seconds(60);

HostInstant Monotonic() { return {ReadMonotonicNs()}; }

bool IsUrgent(const CanFrame& frame) { return frame.id >> 26 == 0; }

Status CheckBitRate(const CanLink& link, const SocketCanPort* port, std::uint32_t wanted_bps) {
  if (wanted_bps == 0 || link.bit_rate_bps == 0 || link.bit_rate_bps == wanted_bps) return {};
  return Fail(ErrorCode::kRefused, "CAN interface '" + port->name() + "' has " +
                                       std::to_string(link.bit_rate_bps) + " bit/s, not " +
                                       std::to_string(wanted_bps));
}

Status CheckFd(const CanLink& link, const SocketCanPort* port, std::uint32_t wanted_bps) {
  if (wanted_bps == 0) return {};
  const std::string interface = "CAN interface '" + port->name() + "' ";
  if (link.mtu != CANFD_MTU)
    return Fail(ErrorCode::kRefused,
                interface + "carries no CAN FD: its MTU is " + std::to_string(link.mtu) + ", not " +
                    std::to_string(CANFD_MTU) + " (`ip link set " + port->name() +
                    (link.kind == "can"
                         ? " type can ... dbitrate " + std::to_string(wanted_bps) + " fd on`)"
                         : " mtu " + std::to_string(CANFD_MTU) + "`)"));
  if (link.data_bit_rate_bps == 0 || link.data_bit_rate_bps == wanted_bps) return {};
  return Fail(ErrorCode::kRefused, interface + "has " + std::to_string(link.data_bit_rate_bps) +
                                       " bit/s for the data of CAN FD frames, not " +
                                       std::to_string(wanted_bps));
}

/// The number of `frames`, from the front, that stand before the next group; at most `most`, at
/// least one.
std::size_t BeforeGroup(std::span<const CanFrame> frames, std::size_t most) {
  const auto begins = [frames](std::size_t at) {
    return at + 1 < frames.size() && CanBeGrouped(frames[at]) && CanBeGrouped(frames[at + 1]);
  };
  std::size_t alone = 1;
  while (alone < std::min(most, frames.size()) && !begins(alone)) ++alone;
  return alone;
}

LinkState LinkStateOf(const CanLink& link) {
  if (link.state == ControllerState::kBusOff) return LinkState::kOff;
  return link.state == ControllerState::kPassive ? LinkState::kPassive : LinkState::kUp;
}

}  // namespace

SocketCanPort::SocketCanPort(Options options, WatchedSocket socket)
    : options_(std::move(options)),
      socket_(std::move(socket)),
      recovery_(
          {.revive =
               options_.revive
                   ? options_.revive
                   : [name = options_.interface,
                      taken_down =
                          std::make_shared<bool>()] { return ReviveLink(name, taken_down.get()); },
           .first_wait = options_.clock.Real(Milliseconds(1000)),
           .longest_wait = options_.clock.Real(Milliseconds(60'000)),
           .poll_period = options_.clock.Real(Milliseconds(10))}) {
  if (!options_.wire_clock) options_.wire_clock = Monotonic;
  aside_.only_units = options_.hears == Hears::kUnits;
  // A unit on such a bus takes staging frames either way.
  aside_.groups = !aside_.only_units || options_.data_bit_rate_bps > 0;
  aside_.receive = options_.receive;
}

Result<std::unique_ptr<SocketCanPort>> SocketCanPort::Create(Options options) {
  FOCALFLEET_TRY_ASSIGN(WatchedSocket socket, WatchedSocket::Create());
  std::unique_ptr<SocketCanPort> port(new SocketCanPort(std::move(options), std::move(socket)));
  const auto opened = port->Open(true);
  if (!opened && opened.error().code != ErrorCode::kUnavailable)
    return tl::unexpected<Error>(opened.error());
  return port;
}

Status SocketCanPort::Open(bool may_wait) {
  aside_.stamps.emplace(options_.wall_ahead);
  auto opened = options_.open(options_.interface, {options_.hears, aside_.groups, may_wait});
  found_ = opened.has_value();
  if (!opened) {
    trouble_ = opened.error().text;
    return tl::unexpected<Error>(std::move(opened).error());
  }
  link_ = std::move(opened->link);
  if (opened->socket < 0) {
    trouble_ = "the interface is down";
    return {};
  }
  socket_.Open(opened->socket);
  auto right = CheckBitRate(link_, this, options_.bit_rate_bps);
  if (right) right = CheckFd(link_, this, options_.data_bit_rate_bps);
  if (!right) {
    socket_.Close();
    trouble_ = right.error().text;
    return right;
  }
  // No unit speaks from this host. On a virtual interface the simulated fleet does.
  aside_.no_local = aside_.only_units && link_.real();
  window_ = TransmitWindow(
      {.confirms = link_.echoes,
       .bit_rate_bps = link_.echoes ? 0 : link_.bit_rate_bps,
       .data_bit_rate_bps = std::max(link_.bit_rate_bps, options_.data_bit_rate_bps)});
  waits_since_ = kNever;
  trouble_.clear();
  counters_.reconnects += std::exchange(was_up_, true) ? 1u : 0u;
  // The state found now is reported at the first look, which is due at once.
  state_ = LinkStateOf(link_);
  look_at_ = state_ == LinkState::kUp ? kNever : HostInstant{0};
  return {};
}

void SocketCanPort::Lose(const std::string& why) {
  socket_.Close();
  window_.Clear();
  state_ = LinkState::kDown;
  retry_at_ = HostInstant{0};
  look_at_ = kNever;
  trouble_ = why;
  ++counters_.link_errors;
}

HostInstant SocketCanPort::wake_at() const {
  return std::min(socket_.open() ? look_at_ : retry_at_, recovery_.wake_at());
}

// A driver that echoes wakes the port when there is room. Otherwise the bit clock gives the time,
// or nothing does.
DurationNs SocketCanPort::retry_full() const {
  if (window_.unconfirmed() > 0) return Milliseconds(20);
  if (window_.options().confirms)
    return kFull;  // no event reports room in a queue shared with others
  const HostInstant room_at = window_.RoomAt();
  if (room_at == kNever) return kFull;
  return std::clamp(room_at - options_.wire_clock(), Microseconds(20), kFull);
}

std::size_t SocketCanPort::Room(bool urgent, HostInstant monotonic) {
  if (!window_.options().confirms) {
    window_.Charged(BytesBelow(socket_.socket()));
  } else if (window_.unconfirmed() > 0 && monotonic - waits_since_ > kConfirmationLost &&
             BytesBelow(socket_.socket()) == 0) {
    ++counters_.link_errors;
    window_.Clear();
  }
  return window_.Room(urgent, monotonic);
}

std::size_t SocketCanPort::Send(std::span<const CanFrame> frames) {
  if (!socket_.open() || state_ == LinkState::kOff) return 0;
  std::size_t taken = 0;
  while (taken < frames.size()) {
    const bool urgent = IsUrgent(frames[taken]);
    const HostInstant monotonic = window_.needs_time() ? options_.wire_clock() : HostInstant{0};
    const std::size_t room = Room(urgent, monotonic);
    if (room == 0) return taken;
    if (urgent) SetUrgent(socket_.socket(), true);
    // The last place is not for frames behind a stop.
    const BatchSent sent = HandDown(frames.subspan(taken), urgent ? 1 : room, monotonic);
    if (urgent) SetUrgent(socket_.socket(), false);
    taken += sent.taken;
    // ENOBUFS: other programs have filled the interface's queue, which no poll reports.
    socket_.WatchSending(sent.error == EAGAIN);
    if (sent.error == EAGAIN || sent.error == ENOBUFS) return taken;
    if (sent.error != 0) {
      Lose(std::string("cannot send: ") + std::strerror(sent.error));
      lost_unreported_ = true;
      return taken;
    }
  }
  return taken;
}

BatchSent SocketCanPort::HandDown(std::span<const CanFrame> frames, std::size_t room,
                                  HostInstant monotonic) {
  const int socket = socket_.socket();
  const bool groups = options_.data_bit_rate_bps > 0;
  FdFrame group;
  const std::size_t grouped = groups ? PackGroup(frames, &group) : 0;
  const bool together = grouped >= kGroupEntriesMin;
  const auto batch =
      frames.first(groups ? BeforeGroup(frames, room) : std::min(room, frames.size()));
  BatchSent sent;
  if (together) {
    sent.error = SendGroup(socket, group);
    sent.taken = sent.error == 0 ? grouped : 0;
  } else {
    sent = SendFrames(socket, batch);
  }
  if (sent.taken == 0) return sent;
  if (window_.unconfirmed() == 0) waits_since_ = monotonic;
  // The frames' bits begin no sooner than now.
  const HostInstant below = window_.options().bit_rate_bps > 0 ? options_.wire_clock() : monotonic;
  if (together) {
    window_.Sent(group, below);
  } else {
    for (const CanFrame& frame : batch.first(sent.taken)) window_.Sent(frame, below);
  }
  return sent;
}

void SocketCanPort::Receive(HostInstant now, std::vector<ReceivedFrame>* out) {
  Recover(now);
  if (!socket_.open()) {
    // The loop must see the link as down before it is up again: frames that waited for it are
    // outdated.
    if (std::exchange(lost_unreported_, false))
      retry_at_ = now + options_.clock.Real(options_.retry_period);
    if (now < retry_at_) return;
    static_cast<void>(Open(false));  // the trouble is what failed
    if (!socket_.open()) {
      retry_at_ = now + options_.clock.Real(options_.retry_period);
      return;
    }
    if (state_ != LinkState::kOff) recovery_.Well(now);
  }
  aside_.errors.clear();
  aside_.confirmed = 0;
  const std::size_t before = out->size();
  const BatchReceived received =
      ReceiveFrames(socket_.socket(), {options_.bus, options_.clock}, out, &counters_, &aside_);
  NoteMissed(now);
  window_.Confirmed(aside_.confirmed);
  if (aside_.confirmed > 0) waits_since_ = options_.wire_clock();
  // The window goes by bits only on a bus in real time, and there the host's clock is monotonic.
  if (window_.options().bit_rate_bps > 0)
    for (const ReceivedFrame& heard : std::span(*out).subspan(before))
      window_.Heard(heard.frame, heard.at);
  for (const can_frame& error : aside_.errors) NoteError(error, now);
  // While an attempt is under way the kernel may not answer before its end.
  if (now >= look_at_ && !recovery_.trying()) LookAgain(now);
  if (received.error == 0) return;
  Lose(std::string("cannot receive: ") + std::strerror(received.error));
  retry_at_ = now + options_.clock.Real(options_.retry_period);
}

void SocketCanPort::NoteMissed(HostInstant now) {
  const char* what = nullptr;
  if (std::exchange(lost_noted_, counters_.lost) < counters_.lost)
    what = "frames were lost: this host did not read them in time";
  if (std::exchange(forged_noted_, counters_.forged) < counters_.forged)
    what = "a program of this host sends frames as from units; they are not believed";
  if (what != nullptr && (trouble_.empty() || trouble_ == missed_)) {
    missed_ = trouble_ = what;
    missed_until_ = now + options_.clock.Real(kMissedShown);
  } else if (now >= missed_until_) {
    if (trouble_ == missed_) trouble_.clear();
    missed_.clear();
    missed_until_ = kNever;
  }
}

std::string SocketCanPort::WithCauses(const std::string& what) const {
  const std::string causes = errors_.Causes();
  return causes.empty() ? what : what + " (" + causes + ")";
}

void SocketCanPort::NoteError(const can_frame& error, HostInstant now) {
  ++counters_.link_errors;
  errors_.Note(error);
  const auto state = LinkStateOf(error);
  if (state == LinkState::kUp && state_ == LinkState::kUp && !IsWarning(error)) {
    trouble_.clear();  // no warning any more
    errors_.Clear();
  }
  if (state) SetState(*state, now);
  if (IsWarning(error) && trouble_.empty()) trouble_ = WithCauses("the controller warns of errors");
}

void SocketCanPort::SetState(LinkState state, HostInstant now) {
  if (state != LinkState::kOff) {
    recovery_.Well(now);
    if (state_ == LinkState::kOff) window_.Clear();  // a restart flushes what was below
  } else {
    // Where the kernel restarts the controller by itself, a second restart would only interfere.
    if (link_.restart_ms == 0) recovery_.BusOff(now);
    window_.Clear();
  }
  look_at_ = state == LinkState::kUp ? kNever : now + options_.clock.Real(kLookPeriod);
  if (state == state_) return;
  state_ = state;
  trouble_ = state == LinkState::kUp        ? std::string()
             : state == LinkState::kPassive ? WithCauses("the controller is error-passive")
                                            : WithCauses("the controller is bus-off");
  if (state == LinkState::kUp) errors_.Clear();
}

// Asks for the state of a controller that is not well, or was not when it was opened. The error
// frame that reports recovery may be lost. Without an answer the last state stays until the next
// look.
void SocketCanPort::LookAgain(HostInstant now) {
  look_at_ = now + options_.clock.Real(kLookPeriod);
  const auto link = options_.look(options_.interface);
  if (!link || link->index != link_.index) return;  // where it is gone the socket reports it
  link_ = *link;
  const LinkState state = LinkStateOf(link_);
  if (trouble_.empty()) state_ = LinkState::kUp;  // as Open left it, unreported
  SetState(state, now);
}

void SocketCanPort::Recover(HostInstant now) {
  const auto outcome = recovery_.Poll(now);
  if (!outcome) return;
  if (!*outcome) {
    if (state_ == LinkState::kOff)
      trouble_ = WithCauses("the controller is bus-off") + "; " + outcome->error().text;
    return;
  }
  // A restart is reported by an error frame, down and up by an error of the socket. A look covers
  // both cases.
  if (socket_.open()) look_at_ = now;
}

}  // namespace focalfleet
