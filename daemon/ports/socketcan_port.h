// SocketCanPort is one bus on a SocketCAN interface: can0 of an adapter, or vcan0. The port uses a
// CAN_RAW socket, never waits and works in batches. At most three of its frames are below the
// socket (transmit_window.h). Its frames are looped back to other sockets of this host (candump
// sees them).
//
// An interface that is down or missing only takes the link down. The port looks for it again and
// opens it when it is up, be it the same or another of the same name. An interface with a wrong bit
// rate is not used, nor is one without CAN FD where the options ask for it. A controller that goes
// bus-off is brought back where that is possible (link_recovery.h). Otherwise `trouble` states what
// the operator has to do.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "daemon/clock/clock.h"
#include "daemon/ports/can_errors.h"
#include "daemon/ports/can_socket.h"
#include "daemon/ports/link_recovery.h"
#include "daemon/ports/pollable_port.h"
#include "daemon/ports/socket_frames.h"
#include "daemon/ports/transmit_window.h"
#include "daemon/ports/watched_socket.h"

namespace focalfleet {

class SocketCanPort : public PollablePort {
 public:
  struct Options {
    BusId bus;
    std::string interface;
    Hears hears = Hears::kUnits;
    std::uint32_t bit_rate_bps = 0;  // that the interface must have, if it has any; 0: any
    /// The data bit rate of a bus with CAN FD, for a host. Staging frames that are given one behind
    /// the other are sent in groups. 0: every frame is sent alone.
    std::uint32_t data_bit_rate_bps = 0;
    HostClock clock = HostClock();
    DurationNs retry_period = Milliseconds(200);  // real time
    // The clock of the frames below: bits do not hurry when the host's clock does. Empty: the
    // monotonic clock.
    std::function<HostInstant()> wire_clock = {};
    WallAhead (*wall_ahead)() = ReadWallAhead;
    InterfaceOpener open = OpenInterface;
    std::function<Result<CanLink>(const std::string& interface)> look = LookAtLinkInTime;
    SystemReceive receive = ::recvmmsg;
    LinkRecovery::Reviver revive = {};  // empty: ReviveLink
  };
  /// Tries to open the interface once. An interface that is down or missing is no error: the link
  /// is down.
  /// Errors: kInvalid: none can have this name; kRefused: it has another bit rate, or no CAN FD;
  /// kUnavailable: no descriptors left.
  static Result<std::unique_ptr<SocketCanPort>> Create(Options options);

  std::size_t Send(std::span<const CanFrame> frames) override;
  void Receive(HostInstant now, std::vector<ReceivedFrame>* out) override;
  [[nodiscard]] LinkState state() const override { return state_; }
  [[nodiscard]] int fd() const override { return socket_.fd(); }
  [[nodiscard]] HostInstant wake_at() const override;
  [[nodiscard]] DurationNs retry_full() const override;
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] const std::string& name() const override { return options_.interface; }
  [[nodiscard]] const std::string& trouble() const override { return trouble_; }

  /// True if the interface was there at the last look, be it up or down.
  [[nodiscard]] bool found() const { return found_; }
  /// The interface as it was at the last look.
  [[nodiscard]] const CanLink& link() const { return link_; }

 private:
  SocketCanPort(Options options, WatchedSocket socket);
  Status Open(bool may_wait);
  void Lose(const std::string& why);
  void NoteError(const can_frame& error, HostInstant now);
  void SetState(LinkState state, HostInstant now);
  void LookAgain(HostInstant now);
  void Recover(HostInstant now);
  /// Frames that were lost or forged are a trouble of a link that is up, for a while.
  void NoteMissed(HostInstant now);
  /// Passes down the frames that fit into `room` frames, or one group. Pre: room is not 0.
  BatchSent HandDown(std::span<const CanFrame> frames, std::size_t room, HostInstant monotonic);
  [[nodiscard]] std::size_t Room(bool urgent, HostInstant monotonic);
  [[nodiscard]] std::string WithCauses(const std::string& what) const;

  Options options_;
  WatchedSocket socket_;
  CanLink link_;
  TransmitWindow window_;
  LinkRecovery recovery_;
  ErrorTally errors_;
  LinkState state_ = LinkState::kDown;
  bool found_ = false;
  bool was_up_ = false;               // at any time
  bool lost_unreported_ = false;      // lost in Send; no Receive has run since
  HostInstant retry_at_{0};           // while there is no socket
  HostInstant look_at_ = kNever;      // next look at the state of a controller that is not well
  HostInstant waits_since_ = kNever;  // monotonic: start of the wait for outstanding confirmations
  PortCounters counters_;
  std::string trouble_;
  std::string missed_;  // the trouble that NoteMissed found; empty: none
  HostInstant missed_until_ = kNever;
  std::uint64_t lost_noted_ = 0;  // of the counters
  std::uint64_t forged_noted_ = 0;
  Aside aside_;  // of one Receive, kept for its buffers and its stamps
};

}  // namespace focalfleet
