// One bus on a SocketCAN interface: can0 of an adapter, or vcan0. A CAN_RAW socket, never waiting,
// in batches.
//
// Own frames are looped back to other sockets of this host (candump sees them), not to this one.
// Error frames of the controller say when it goes passive or bus-off. An interface that is down or
// not there takes the link down, no more: it is looked for again and opened when it is up.
#pragma once

#include <linux/can.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "daemon/ports/pollable_port.h"
#include "daemon/ports/watched_socket.h"

namespace focalfleet {

/// A bound socket, or -1 where the interface is there but down.
/// Errors: kUnavailable: the kernel has no CAN, or no such interface (named); kInvalid: none can
/// have this name.
Result<int> OpenInterface(const std::string& name);
/// As OpenInterface; another one in tests on a kernel without CAN.
using InterfaceOpener = std::function<Result<int>(const std::string& name)>;

class SocketCanPort : public PollablePort {
 public:
  struct Options {
    BusId bus;
    std::string interface;
    DurationNs retry_period = Milliseconds(200);
    InterfaceOpener open = OpenInterface;
  };
  /// Tries to open it once; an interface that is down or not there is down, no error.
  /// Errors: kInvalid: none can have this name; kUnavailable: no descriptors left.
  static Result<std::unique_ptr<SocketCanPort>> Create(Options options);

  std::size_t Send(std::span<const CanFrame> frames) override;
  void Receive(HostInstant now, std::vector<ReceivedFrame>* out) override;
  [[nodiscard]] LinkState state() const override { return state_; }
  /// The interface was there when it was last looked for, be it up or down.
  [[nodiscard]] bool found() const { return found_; }
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
  bool found_ = false;
  bool was_up_ = false;  // ever
  HostInstant wake_at_{0};
  PortCounters counters_;
  std::string trouble_;
  std::vector<can_frame> errors_;  // of one Receive, kept for its room
};

/// What an error frame says of the controller's state; none where it says nothing of it.
std::optional<LinkState> LinkStateOf(const can_frame& error);

}  // namespace focalfleet
