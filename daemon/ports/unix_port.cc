#include "daemon/ports/unix_port.h"

#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "daemon/control/unix_address.h"
#include "daemon/ports/socket_frames.h"

namespace focalfleet {

Result<std::unique_ptr<UnixPort>> UnixPort::Create(Options options) {
  FOCALFLEET_TRY(UnixAddress::Of(options.path));
  FOCALFLEET_TRY_ASSIGN(WatchedSocket socket, WatchedSocket::Create());
  std::unique_ptr<UnixPort> port(new UnixPort(std::move(options), std::move(socket)));
  port->Connect();
  return port;
}

void UnixPort::Connect() {
  const auto address = UnixAddress::Of(options_.path);
  if (!address) return;
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0 || ::connect(fd, address->get(), address->length()) != 0) {
    trouble_ = std::string("cannot connect: ") + std::strerror(errno);
    if (fd >= 0) ::close(fd);
    return;
  }
  socket_.Open(fd);
  wake_at_ = kNever;
  trouble_.clear();
  counters_.reconnects += std::exchange(was_up_, true) ? 1u : 0u;
}

void UnixPort::Lose(const std::string& why) {
  socket_.Close();
  trouble_ = why;
  wake_at_ = HostInstant{0};  // the next Receive knows the time and starts the wait
  ++counters_.link_errors;
}

std::size_t UnixPort::Send(std::span<const CanFrame> frames) {
  if (!socket_.open() || frames.empty()) return 0;
  const BatchSent sent = SendFrames(socket_.socket(), frames);
  const bool full = sent.error == EAGAIN || sent.error == ENOBUFS;
  if (sent.error != 0 && !full) {
    Lose(std::string("cannot send: ") + std::strerror(sent.error));
    return sent.taken;
  }
  socket_.WatchSending(full);
  return sent.taken;
}

void UnixPort::Receive(HostInstant now, std::vector<ReceivedFrame>* out) {
  if (!socket_.open()) {
    if (now < wake_at_) return;
    Connect();
    if (!socket_.open()) {
      wake_at_ = now + options_.retry_period;
      return;
    }
  }
  const BatchReceived received =
      ReceiveFrames(socket_.socket(), {options_.bus, options_.clock}, out, &counters_);
  if (!received.closed && received.error == 0) return;
  Lose(received.closed ? "the other end closed"
                       : std::string("cannot receive: ") + std::strerror(received.error));
  wake_at_ = now + options_.retry_period;
}

}  // namespace focalfleet
