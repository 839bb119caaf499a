#include "daemon/control/line_client.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "daemon/control/unix_address.h"

namespace focalfleet {
namespace {

/// Waits for `events`. False: none came for `silence_max`.
Result<bool> WaitFor(int fd, short events, std::optional<DurationNs> silence_max) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::nanoseconds(silence_max ? silence_max->ns : 0);
  for (;;) {
    int wait_ms = -1;
    if (silence_max) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count();
      wait_ms = static_cast<int>(std::clamp<std::int64_t>(left, 0, 1'000'000));
    }
    pollfd poller{fd, events, 0};
    const int ready = ::poll(&poller, 1, wait_ms);
    if (ready > 0) return true;
    if (ready == 0) return false;
    if (errno != EINTR) return Fail(ErrorCode::kUnavailable, std::strerror(errno));
  }
}

}  // namespace

Result<LineClient> LineClient::Connect(const std::string& path, DurationNs patience) {
  using Clock = std::chrono::steady_clock;
  FOCALFLEET_TRY_ASSIGN(const UnixAddress address, UnixAddress::Of(path));
  // The socket does not block: a blocking connect would wait without limit for a server whose
  // backlog is full, and there is no event to poll for.
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0)
    return Fail(ErrorCode::kUnavailable, std::string("no socket: ") + std::strerror(errno));
  LineClient client(fd, path);
  const auto end = Clock::now() + std::chrono::nanoseconds(patience.ns);
  while (::connect(fd, address.get(), address.length()) != 0) {
    if (errno == EINTR) continue;
    if (errno != EAGAIN)
      return Fail(ErrorCode::kUnavailable,
                  "nobody answers at " + path + ": " + std::strerror(errno));
    if (Clock::now() >= end)
      return Fail(ErrorCode::kUnavailable, path + ": no connection is taken there in time");
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return client;
}

LineClient::LineClient(LineClient&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      path_(std::move(other.path_)),
      next_id_(other.next_id_),
      received_(std::move(other.received_)) {}

LineClient& LineClient::operator=(LineClient&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(path_, other.path_);
  std::swap(next_id_, other.next_id_);
  std::swap(received_, other.received_);
  return *this;
}

LineClient::~LineClient() {
  if (fd_ >= 0) ::close(fd_);
}

tl::unexpected<Error> LineClient::Broken(const std::string& why) {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  return Fail(ErrorCode::kUnavailable, path_ + ": " + why);
}

Status LineClient::SendAll(std::string_view bytes, const CallOptions& options) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    } else if (errno == EAGAIN) {
      const auto ready = WaitFor(fd_, POLLOUT, options.silence_max);
      if (!ready) return Broken(ready.error().text);
      if (!*ready) return Broken("the request was not taken in time");
    } else if (errno == EPIPE || errno == ECONNRESET) {
      return {};  // the server closed, and may have sent the reason
    } else if (errno != EINTR) {
      return Broken(std::string("the connection broke: ") + std::strerror(errno));
    }
  }
  return {};
}

Result<std::string> LineClient::NextLine(const CallOptions& options) {
  std::size_t searched = 0;
  for (;;) {
    if (const auto end = received_.find('\n', searched); end != std::string::npos) {
      std::string line = received_.substr(0, end);
      received_.erase(0, end + 1);
      return line;
    }
    searched = received_.size();
    const auto ready = WaitFor(fd_, POLLIN, options.silence_max);
    if (!ready) return Broken(ready.error().text);
    if (!*ready) return Broken("no answer in time");
    std::array<char, 65536> chunk;
    const ssize_t got = ::recv(fd_, chunk.data(), chunk.size(), 0);
    if (got == 0) return Broken("the connection was closed before the answer came");
    if (got > 0) {
      received_.append(chunk.data(), static_cast<std::size_t>(got));
    } else if (errno != EAGAIN && errno != EINTR && errno != ECONNRESET) {
      // The kernel reports a reset once, before the bytes that were sent ahead of it.
      return Broken(std::string("the connection broke: ") + std::strerror(errno));
    }
  }
}

Result<Json> LineClient::Call(const std::string& verb, const Json& args,
                              const CallOptions& options) {
  if (!connected()) return Fail(ErrorCode::kUnavailable, path_ + ": not connected");
  const std::uint64_t id = next_id_++;
  FOCALFLEET_TRY(SendAll(
      EncodeRequest({.id = id, .verb = verb, .args = args, .caller = options.caller}) + "\n",
      options));
  for (;;) {
    FOCALFLEET_TRY_ASSIGN(const std::string line, NextLine(options));
    auto answer = DecodeAnswer(line);
    if (!answer) return Broken(answer.error().text);
    // Id 0: the server could not read the id of the request; only this one is open.
    if (answer->id != id && answer->id != 0) continue;
    switch (answer->kind) {
      case ControlAnswer::Kind::kProgress:
        if (options.on_progress) options.on_progress(answer->body);
        break;
      case ControlAnswer::Kind::kResult:
        return std::move(answer->body);
      case ControlAnswer::Kind::kError:
        return tl::unexpected<Error>(std::move(answer->error));
    }
  }
}

}  // namespace focalfleet
