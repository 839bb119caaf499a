// The fake daemon is the daemon's end of the control socket with scripted answers, on a thread of
// its own. The requests that it receives are kept.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "daemon/control/line_server.h"
#include "daemon/control/messages.h"

namespace focalfleet::test {

struct FakeAnswer {
  std::vector<Json> progress;
  int full_first = 0;  // so many requests find no place before the result is given
  Result<Json> result = Json::object();
  bool hang_up = false;   // closes everything instead of answering
  int answers_most = -1;  // after so many answers it hangs up; below 0: never
  std::vector<std::uint32_t> refused_units = {};  // with "not now"
};

class FakeDaemon {
 public:
  /// Verbs without a scripted answer are refused.
  FakeDaemon(const std::string& path, std::map<std::string, FakeAnswer> answers);
  FakeDaemon(const FakeDaemon&) = delete;
  FakeDaemon& operator=(const FakeDaemon&) = delete;
  ~FakeDaemon();

  [[nodiscard]] const std::string& path() const { return path_; }
  /// All requests so far, in the order in which they came.
  [[nodiscard]] std::vector<ControlRequest> requests() const;

 private:
  void Serve();
  bool AnswerLine(const IncomingLine& line);  // false: hang up

  std::string path_;
  std::map<std::string, FakeAnswer> answers_;
  std::optional<LineServer> server_;
  mutable std::mutex mutex_;
  std::vector<ControlRequest> requests_;
  int quit_[2] = {-1, -1};  // a pipe; closing it ends the thread
  std::thread thread_;
};

}  // namespace focalfleet::test
