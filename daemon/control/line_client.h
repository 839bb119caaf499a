// The client's end of a control socket, for programs that may wait: one request at a time, with a
// limit on silence.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "daemon/control/messages.h"
#include "protocol/base/instants.h"
#include "protocol/base/result.h"

namespace focalfleet {

class LineClient {
 public:
  struct CallOptions {
    std::optional<DurationNs> silence_max = Seconds(10);  // none: wait for ever
    std::function<void(const Json&)> on_progress;         // may be empty
    /// On whose behalf it is asked, where this process is the daemon (http/ does it).
    std::optional<Caller> caller = {};
  };

  /// The client is connected. Errors: kUnavailable, names the path: no server listens there, the
  /// socket may not be opened, or the server has not taken a connection for `patience` (it hangs,
  /// or is stopped).
  static Result<LineClient> Connect(const std::string& path, DurationNs patience = Seconds(10));

  LineClient(LineClient&& other) noexcept;
  LineClient& operator=(LineClient&& other) noexcept;
  LineClient(const LineClient&) = delete;
  LineClient& operator=(const LineClient&) = delete;
  ~LineClient();

  /// Sends one request and waits for its last answer: the result object.
  /// Errors: that of the server's answer; kUnavailable where the connection broke or stayed silent.
  /// In the latter case connected() is false, and it is unknown whether the request took effect.
  Result<Json> Call(const std::string& verb, const Json& args, const CallOptions& options);
  Result<Json> Call(const std::string& verb, const Json& args) {
    return Call(verb, args, CallOptions{});
  }

  [[nodiscard]] bool connected() const { return fd_ >= 0; }

 private:
  LineClient(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
  Status SendAll(std::string_view bytes, const CallOptions& options);
  Result<std::string> NextLine(const CallOptions& options);
  tl::unexpected<Error> Broken(const std::string& why);

  int fd_ = -1;
  std::string path_;
  std::uint64_t next_id_ = 1;
  std::string received_;
};

}  // namespace focalfleet
