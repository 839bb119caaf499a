// UnixPort is one bus of focalfleet-sim: the client of its SOCK_SEQPACKET socket, one `struct
// can_frame` a packet. While the simulator is dead or not there yet, the link is down and the port
// tries again.
#pragma once

#include <memory>
#include <string>

#include "daemon/clock/clock.h"
#include "daemon/ports/pollable_port.h"
#include "daemon/ports/watched_socket.h"

namespace focalfleet {

class UnixPort : public PollablePort {
 public:
  struct Options {
    BusId bus;
    std::string path;
    DurationNs retry_period = Milliseconds(200);
    HostClock clock = HostClock();
  };
  /// Tries to connect once. A bus that is not there is no error: the link is down.
  /// Errors: kInvalid: the path is too long; kUnavailable: no descriptors left.
  static Result<std::unique_ptr<UnixPort>> Create(Options options);

  std::size_t Send(std::span<const CanFrame> frames) override;
  void Receive(HostInstant now, std::vector<ReceivedFrame>* out) override;
  [[nodiscard]] LinkState state() const override {
    return socket_.open() ? LinkState::kUp : LinkState::kDown;
  }
  [[nodiscard]] int fd() const override { return socket_.fd(); }
  [[nodiscard]] HostInstant wake_at() const override { return wake_at_; }
  [[nodiscard]] DurationNs retry_full() const override { return kRetryFull; }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] const std::string& name() const override { return options_.path; }
  [[nodiscard]] const std::string& trouble() const override { return trouble_; }

 private:
  UnixPort(Options options, WatchedSocket socket)
      : options_(std::move(options)), socket_(std::move(socket)) {}
  void Connect();
  void Lose(const std::string& why);

  Options options_;
  WatchedSocket socket_;
  HostInstant wake_at_{0};  // while the link is down: when to try again
  bool was_up_ = false;     // at any time
  PortCounters counters_;
  std::string trouble_;
};

}  // namespace focalfleet
