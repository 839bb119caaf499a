#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <sstream>
#include <string>

#include "daemon/control/line_client.h"
#include "daemon/control/unix_address.h"
#include "daemon/doctor/read_facts.h"

namespace focalfleet::doctor {
namespace {

/// The errno of a connection to the socket; where it succeeds `peer` is the process that listens.
int Probe(const std::string& socket, ucred* peer) {
  const auto address = UnixAddress::Of(socket);
  if (!address) return ENAMETOOLONG;
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return errno;
  socklen_t size = sizeof *peer;
  const bool connected = ::connect(fd, address->get(), UnixAddress::length()) == 0 &&
                         ::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, peer, &size) == 0;
  const int error = connected ? 0 : errno;
  ::close(fd);
  return error;
}

/// The rest of the first line of the file that begins so; empty: there is none.
std::string LineOf(const std::string& path, const std::string& begin) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);)
    if (line.starts_with(begin)) return line.substr(begin.size());
  return "";
}

DaemonProcess ProcessOf(const ucred& peer) {
  DaemonProcess process{
      .user = IdentityOf(peer.uid), .open_files_max = {}, .may_configure_network = {}};
  const std::string folder = "/proc/" + std::to_string(peer.pid);
  std::istringstream groups(LineOf(folder + "/status", "Groups:"));
  process.user.groups.assign(1, peer.gid);
  for (std::uint32_t group = 0; groups >> group;) process.user.groups.push_back(group);
  std::istringstream files(LineOf(folder + "/limits", "Max open files"));
  if (std::uint64_t soft = 0; files >> soft) process.open_files_max = soft;
  std::istringstream capabilities(LineOf(folder + "/status", "CapEff:"));
  constexpr int kCapNetAdmin = 12;  // of linux/capability.h
  if (std::uint64_t bits = 0; capabilities >> std::hex >> bits)
    process.may_configure_network = (bits >> kCapNetAdmin & 1) != 0;
  return process;
}

}  // namespace

DaemonFacts ReadDaemon(const std::string& socket) {
  DaemonFacts daemon;
  daemon.socket = socket;
  ucred peer{};
  daemon.connect_error = Probe(socket, &peer);
  if (daemon.connect_error == 0) daemon.process = ProcessOf(peer);
  auto client = LineClient::Connect(socket, Seconds(3));
  if (!client) {
    daemon.silence = client.error().text;
    return daemon;
  }
  auto status =
      client->Call("status", Json::object(), {.silence_max = Seconds(3), .on_progress = {}});
  if (status)
    daemon.status = std::move(*status);
  else
    daemon.silence = status.error().text;
  return daemon;
}

}  // namespace focalfleet::doctor
