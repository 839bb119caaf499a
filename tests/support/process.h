// A child process of a test, with its output in a file. The process is killed at the latest when
// the object goes out of scope, so a failing test leaves none behind.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace focalfleet::test {

class Process {
 public:
  /// The program runs. Pre: arguments[0] is a path. Output and errors are appended to `log`.
  Process(const std::vector<std::string>& arguments, const std::string& log);
  Process(Process&& other) noexcept : pid_(other.pid_) { other.pid_ = -1; }
  Process& operator=(Process&& other) noexcept;
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process();

  void Signal(int number) const;
  /// Waits for its end. Returns the exit status, or 128 + signal.
  int Wait();
  /// As Wait; returns none where the process has not ended within `limit_ms`.
  std::optional<int> WaitFor(int limit_ms);
  [[nodiscard]] bool running();
  [[nodiscard]] pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
};

/// Lets real time pass, so that another process can proceed.
void Pause(int milliseconds);

/// Polls `done` every 10 ms; false where `limit_ms` passed without it.
template <class Predicate>
bool WaitUntil(const Predicate& done, int limit_ms) {
  for (int waited = 0; waited < limit_ms; waited += 10) {
    if (done()) return true;
    Pause(10);
  }
  return done();
}

}  // namespace focalfleet::test
