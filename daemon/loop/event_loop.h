// The event loop of the core thread. Each turn waits until an input is there (frames, requests, a
// plan, a commit, a signal) or a time is due. Then the shell (shell.h) takes its turn.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "daemon/loop/event_signal.h"
#include "daemon/loop/job_thread.h"
#include "daemon/loop/shell.h"
#include "daemon/loop/store_thread.h"

namespace focalfleet {

using PlannerThread = JobThread<PlannerWork, PlanDone>;
using CameraThread = JobThread<CameraWork, ExposureDone>;
using ReaderThread = JobThread<StoreQuestion, StoreAnswer>;
using StateThread = JobThread<StateRows, std::string>;

class EventLoop {
 public:
  /// All parts outlive the loop, which sets `shell.look`. Pre: the shell has a service report.
  struct Parts {
    Shell::Parts shell;
    const EventSignal* threads = nullptr;  // raised by planner, camera, store, reader, state
    std::function<void()> hang_up;         // what SIGHUP asks for: the log is opened anew
  };

  /// SIGTERM, SIGINT and SIGHUP come as data from now on. Pre: no other thread runs yet.
  static void BlockSignals();

  /// Errors: kUnavailable: no descriptors left.
  static Result<std::unique_ptr<EventLoop>> Create(const Parts& parts);
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;
  ~EventLoop();

  /// The loop ran until SIGTERM or SIGINT came; the last rows are with the store's thread.
  void Run();

  [[nodiscard]] std::uint64_t steps() const { return shell_.steps(); }

 private:
  explicit EventLoop(const Parts& parts);
  Status Open();
  Status Watch(int fd, std::uint64_t what);
  void Wait();
  void ArmTimer(HostInstant at);
  void DispatchReady(int timeout_ms);
  void Dispatch(std::uint64_t what);
  void ReadSignals();

  Parts parts_;
  Shell shell_;
  int epoll_ = -1;
  int timer_ = -1;
  int signals_ = -1;
  std::int64_t timer_set_ns_ = 0;
  bool stopping_ = false;
};

}  // namespace focalfleet
