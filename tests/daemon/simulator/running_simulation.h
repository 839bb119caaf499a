// focalfleet-sim as a child process, and a client on one of its buses. Both wait for events with a
// limit; nothing sleeps.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "protocol/wire/codec.h"

namespace focalfleet::test {

class RunningSimulation {
 public:
  /// The program runs and has printed `ready`, or ready() is false.
  explicit RunningSimulation(std::vector<std::string> arguments);
  RunningSimulation(const RunningSimulation&) = delete;
  RunningSimulation& operator=(const RunningSimulation&) = delete;
  ~RunningSimulation();

  [[nodiscard]] bool ready() const { return ready_; }
  /// Sends SIGTERM; returns the exit code.
  int Terminate();
  /// Waits for an end that another cause brings about.
  int Wait();
  [[nodiscard]] pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  bool ready_ = false;
};

class BusClient {
 public:
  explicit BusClient(const std::string& path);
  BusClient(const BusClient&) = delete;
  BusClient& operator=(const BusClient&) = delete;
  ~BusClient();

  [[nodiscard]] bool connected() const { return connected_; }
  void Send(std::uint8_t node, const HostMessage& message, std::uint8_t sequence = 1);
  /// Returns the next frame, from any node; none after 20 s.
  std::optional<CanFrame> Receive();
  /// Returns the next message of a unit.
  template <class M>
  std::optional<M> ReceiveFromUnit() {
    const auto frame = Receive();
    if (!frame) return std::nullopt;
    const auto decoded = DecodeUnit(*frame);
    if (!decoded || !std::holds_alternative<M>(decoded->message)) return std::nullopt;
    return std::get<M>(decoded->message);
  }

 private:
  int fd_ = -1;
  bool connected_ = false;
};

struct Said {
  int exit = -1;
  std::string out;
  std::string err;
};
/// Runs focalfleet-sim to its end.
Said RunToEnd(std::vector<std::string> arguments);

}  // namespace focalfleet::test
