#include "daemon/control/server_client.h"

#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "daemon/control/messages.h"

namespace focalfleet {

bool ServerClient::Idle(std::size_t bytes_pause) const {
  if (open > 0) return false;
  if (!Listens(bytes_pause)) return true;  // what it has sent is not taken until it reads
  if (Ready(bytes_pause)) return false;
  char unread = 0;  // that has come since the last look
  return ::recv(fd, &unread, 1, MSG_PEEK | MSG_DONTWAIT) <= 0;
}

bool ServerClient::Read() {
  std::array<char, 65536> chunk;
  const ssize_t got = ::recv(fd, chunk.data(), chunk.size(), 0);
  if (got > 0) {
    input.Append({chunk.data(), static_cast<std::size_t>(got)});
    return true;
  }
  if (got == 0) {
    input_ended = true;
    return true;
  }
  // A peer closed with answers unread: its reset comes first, its last lines after it.
  return errno == EAGAIN || errno == EINTR || errno == ECONNRESET;
}

bool ServerClient::Write() {
  if (deaf) written = output.size();
  while (waiting() > 0) {
    const ssize_t sent = ::send(fd, output.data() + written, waiting(), MSG_NOSIGNAL);
    if (sent < 0) return errno == EAGAIN || errno == EINTR;
    written += static_cast<std::size_t>(sent);
  }
  output.clear();
  written = 0;
  return true;
}

bool ServerClient::CheckLength(std::size_t bytes_max) {
  if (input.first_bytes() <= bytes_max) return true;
  output += EncodeError(
      0, {ErrorCode::kInvalid, "a line of more than " + std::to_string(bytes_max) + " bytes"});
  output += '\n';
  input.Clear();
  closing = true;
  return false;
}

void ReportAndClose(int fd, ErrorCode code, const std::string& why) {
  const std::string text = EncodeError(0, {code, why}) + "\n";
  [[maybe_unused]] const ssize_t reported = ::send(fd, text.data(), text.size(), MSG_NOSIGNAL);
  ::close(fd);
}

}  // namespace focalfleet
