#include "daemon/loop/event_loop.h"

#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string>

namespace focalfleet {
namespace {

// The data of an epoll event is the number of a bus line, or one of these constants.
constexpr std::uint64_t kRequests = std::uint64_t{1} << 32;
constexpr std::uint64_t kThreads = kRequests + 1;
constexpr std::uint64_t kTimer = kRequests + 2;
constexpr std::uint64_t kSignals = kRequests + 3;

sigset_t OurSignals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&set, number);
  return set;
}

}  // namespace

void EventLoop::BlockSignals() {
  const sigset_t set = OurSignals();
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
}

Result<std::unique_ptr<EventLoop>> EventLoop::Create(const Parts& parts) {
  std::unique_ptr<EventLoop> loop(new EventLoop(parts));
  FOCALFLEET_TRY(loop->Open());
  return loop;
}

EventLoop::EventLoop(const Parts& parts)
    : parts_(parts), shell_([this] {
        Shell::Parts shell = parts_.shell;
        shell.look = [this] { DispatchReady(0); };
        return shell;
      }()) {}

EventLoop::~EventLoop() {
  for (const int fd : {epoll_, timer_, signals_})
    if (fd >= 0) ::close(fd);
}

Status EventLoop::Open() {
  const sigset_t set = OurSignals();
  epoll_ = ::epoll_create1(EPOLL_CLOEXEC);
  timer_ = ::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  signals_ = ::signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
  if (epoll_ < 0 || timer_ < 0 || signals_ < 0)
    return Fail(ErrorCode::kUnavailable,
                std::string("no descriptors left: ") + std::strerror(errno));
  for (std::size_t line = 0; line < parts_.shell.lines->size(); ++line)
    if (parts_.shell.lines->fd(line) >= 0)
      FOCALFLEET_TRY(Watch(parts_.shell.lines->fd(line), line));
  FOCALFLEET_TRY(Watch(parts_.shell.handler->fd(), kRequests));
  FOCALFLEET_TRY(Watch(parts_.threads->fd(), kThreads));
  FOCALFLEET_TRY(Watch(timer_, kTimer));
  return Watch(signals_, kSignals);
}

Status EventLoop::Watch(int fd, std::uint64_t what) {
  epoll_event event{EPOLLIN, {.u64 = what}};
  if (::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) == 0) return {};
  return Fail(ErrorCode::kUnavailable, std::string("cannot watch: ") + std::strerror(errno));
}

void EventLoop::Run() {
  while (!stopping_) {
    Wait();
    shell_.Turn();
  }
  shell_.End();
}

void EventLoop::Wait() {
  const HostInstant wake = shell_.wake_at();
  if (wake <= parts_.shell.clock.Now()) return;
  ArmTimer(wake);
  DispatchReady(-1);
}

void EventLoop::DispatchReady(int timeout_ms) {
  std::array<epoll_event, 128> events;
  const int count =
      ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), timeout_ms);
  for (int i = 0; i < count; ++i) Dispatch(events[static_cast<std::size_t>(i)].data.u64);
}

void EventLoop::ArmTimer(HostInstant at) {
  const std::int64_t ns = at == kNever ? 0 : parts_.shell.clock.ToMonotonic(at);  // 0 disarms
  if (ns == timer_set_ns_) return;
  timer_set_ns_ = ns;
  itimerspec when{};
  when.it_value = {.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
  ::timerfd_settime(timer_, TFD_TIMER_ABSTIME, &when, nullptr);
}

void EventLoop::Dispatch(std::uint64_t what) {
  if (what < kRequests) {
    parts_.shell.lines->MarkReady(what);
  } else if (what == kRequests) {
    shell_.MarkRequests();
  } else if (what == kThreads) {
    parts_.threads->Clear();
  } else if (what == kSignals) {
    ReadSignals();
  } else if (what == kTimer) {
    std::uint64_t expirations = 0;
    [[maybe_unused]] const ssize_t got = ::read(timer_, &expirations, sizeof expirations);
    timer_set_ns_ = 0;
  }
}

void EventLoop::ReadSignals() {
  signalfd_siginfo info{};
  while (::read(signals_, &info, sizeof info) == sizeof info) {
    if (info.ssi_signo == SIGHUP) {
      // The configuration is not read anew while units may move.
      parts_.shell.service->BeginReload();
      parts_.hang_up();
      parts_.shell.service->EndReload();
      continue;
    }
    spdlog::info("{} received, ending", info.ssi_signo == SIGTERM ? "SIGTERM" : "SIGINT");
    stopping_ = true;
  }
}

}  // namespace focalfleet
