// One bus on a SocketCAN interface: can0 of an adapter, or vcan0. A CAN_RAW socket, never waiting,
// in batches.
//
// Own frames are looped back to other sockets of this host (candump sees them), not to this one.
// Error frames of the controller say when it goes passive or bus-off. An interface that goes down
// takes the link down, no more: it is looked for again and opened anew when it is up. Only at the
// start must it be there.
#pragma once

#include <linux/can.h>

#include <memory>
#include <optional>
#include <string>

#include "daemon/ports/pollable_port.h"
#include "daemon/ports/watched_socket.h"

namespace focalfleet {

class SocketCanPort : public PollablePort {
 public:
  struct Options {
    BusId bus;
    std::string interface;
    DurationNs retry_period = Milliseconds(200);
  };
  /// Errors: kUnavailable: the kernel has no CAN, or no such interface (named). One that is down is
  /// no error.
  static Result<std::unique_ptr<SocketCanPort>> Create(Options options);

  std::size_t Send(std::span<const CanFrame> frames) override;
  void Receive(HostInstant now, std::vector<ReceivedFrame>* out) override;
  [[nodiscard]] LinkState state() const override { return state_; }
  [[nodiscard]] int fd() const override { return socket_.fd(); }
  [[nodiscard]] HostInstant wake_at() const override { return wake_at_; }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] const std::string& name() const override { return options_.interface; }
  [[nodiscard]] const std::string& trouble() const override { return trouble_; }

 private:
  SocketCanPort(Options options, WatchedSocket socket)
      : options_(std::move(options)), socket_(std::move(socket)) {}
  Status Open();
  void Lose(const std::string& why);
  void NoteError(const can_frame& error);

  Options options_;
  WatchedSocket socket_;
  LinkState state_ = LinkState::kDown;
  HostInstant wake_at_{0};
  PortCounters counters_;
  std::string trouble_;
  std::vector<can_frame> errors_;  // of one Receive, kept for its room
};

/// What an error frame says of the controller's state; none where it says nothing of it.
std::optional<LinkState> LinkStateOf(const can_frame& error);

}  // namespace focalfleet
