// A thread that looks at the credentials of DDS Security: it warns before one of them ends, and
// asks for new participants when the files have changed.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <stop_token>
#include <string>
#include <thread>

#include "daemon/clock/wall_time.h"
#include "daemon/dds/credentials.h"

namespace focalfleet {

class CredentialWatch {
 public:
  struct Options {
    std::string folder;
    /// All functions are called on the thread of the watch.
    std::function<void(const ShellNote&)> note = [](const ShellNote&) {};
    /// Called when other credentials have replaced those in use. `end` is when those in use end,
    /// and the largest WallTime where that is not known.
    std::function<void(WallTime end)> renew = [](WallTime) {};
    /// Receives each new reason why the files cannot be read.
    std::function<void(const std::string&)> tell = [](const std::string&) {};
    std::function<WallTime()> now = &WallTime::Now;
    /// A look reads six files. Half of this would renew no sooner for people; twice as much would
    /// leave little of the last hour's warning to a clock that stepped.
    std::chrono::milliseconds period{10'000};
  };
  explicit CredentialWatch(Options options);
  CredentialWatch(const CredentialWatch&) = delete;
  CredentialWatch& operator=(const CredentialWatch&) = delete;
  ~CredentialWatch() = default;  // the thread, the last member, ends first

 private:
  void Look();

  static constexpr WallTime kNoEnd{std::numeric_limits<std::int64_t>::max()};
  Options options_;
  CredentialClock clock_;
  std::string used_;  // state of the files that participants use
  WallTime used_end_ = kNoEnd;
  std::string seen_;  // at the last look
  std::string trouble_;
  std::jthread thread_;
};

}  // namespace focalfleet
