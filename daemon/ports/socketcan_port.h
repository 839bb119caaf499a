// One bus on a SocketCAN interface: can0 of an adapter, or vcan0. A CAN_RAW socket, never waiting,
// in batches, with at most three of our frames below it (transmit_window.h). Own frames are looped
// back to other sockets of this host (candump sees them).
//
// An interface that is down or not there takes the link down, no more: it is looked for again and
// opened when it is up, be it the same or another of the same name. One whose bit rate is wrong is
// not used, nor is one without CAN FD where that is asked for. A controller that goes bus-off is
// brought back where that is possible (link_recovery.h), otherwise `trouble` says what a person has
// to do.
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
    std::uint32_t bit_rate_bps = 0;  // that the interface must have, if it has any; 0: whatever
    /// Of a bus with CAN FD, for a host: staging frames that are handed over one behind the other
    /// go down in groups. 0: every frame goes alone.
    std::uint32_t data_bit_rate_bps = 0;
    HostClock clock = HostClock();
    DurationNs retry_period = Milliseconds(200);  // real time
    // What the frames below go by: bits do not hurry when the host's clock does. None: the
    // monotonic clock.
    std::function<HostInstant()> wire_clock = {};
    WallAhead (*wall_ahead)() = ReadWallAhead;
    InterfaceOpener open = OpenInterface;
    LinkRecovery::Reviver revive = {};  // none: ReviveLink
  };
  /// Tries to open it once; an interface that is down or not there is down, no error.
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

  /// The interface was there when it was last looked for, be it up or down.
  [[nodiscard]] bool found() const { return found_; }
  /// As it was when it was last looked at.
  [[nodiscard]] const CanLink& link() const { return link_; }

 private:
  SocketCanPort(Options options, WatchedSocket socket);
  Status Open();
  void Lose(const std::string& why);
  void NoteError(const can_frame& error, HostInstant now);
  void SetState(LinkState state, HostInstant now);
  void LookAgain(HostInstant now);
  void Recover(HostInstant now);
  /// Hands down what fits into `room` frames, or one group. Pre: room is not 0.
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
  bool was_up_ = false;               // ever
  bool lost_untold_ = false;          // by Send, and no Receive has been since
  HostInstant retry_at_{0};           // while there is no socket
  HostInstant look_at_ = kNever;      // while the controller is not well: its state is asked for
  HostInstant waits_since_ = kNever;  // monotonic: confirmations are outstanding since
  PortCounters counters_;
  std::string trouble_;
  Aside aside_;  // of one Receive, kept for its room and its stamps
};

}  // namespace focalfleet
