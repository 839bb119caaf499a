#include <arpa/inet.h>
#include <ifaddrs.h>
#include <linux/can.h>
#include <net/if.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>

#include "daemon/doctor/read_facts.h"

namespace focalfleet::doctor {
namespace {

int AfCanError() {
  const int fd = ::socket(AF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  if (fd < 0) return errno;
  ::close(fd);
  return 0;
}

void ReadClock(HostFacts* host) {
  timex clock{};  // modes 0: the kernel's state is asked for, and nothing is set
  const int state = ::adjtimex(&clock);
  host->clock_synchronised = state >= 0 && state != TIME_ERROR && (clock.status & STA_UNSYNC) == 0;
  host->clock_error_s = 1e-6 * static_cast<double>(clock.maxerror);
}

std::optional<std::uint64_t> NumberInFile(const char* path) {
  std::ifstream file(path);
  std::uint64_t number = 0;
  if (file >> number) return number;
  return std::nullopt;
}

/// The local ports in the kernel's table; its lines are `  sl  address:port ...` in hexadecimal.
void ReadPorts(const char* table, std::set<std::uint16_t>* ports) {
  std::ifstream file(table);
  for (std::string line; std::getline(file, line);) {
    const std::size_t slot = line.find(':');
    const std::size_t colon = slot == std::string::npos ? slot : line.find(':', slot + 1);
    if (colon == std::string::npos) continue;
    std::uint16_t port = 0;
    const char* const begin = line.data() + colon + 1;
    if (std::from_chars(begin, line.data() + line.size(), port, 16).ec == std::errc())
      ports->insert(port);
  }
}

std::string TextOf(const sockaddr* address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (address->sa_family == AF_INET) {
    sockaddr_in in{};
    std::memcpy(&in, address, sizeof in);
    ::inet_ntop(AF_INET, &in.sin_addr, text.data(), text.size());
  } else if (address->sa_family == AF_INET6) {
    sockaddr_in6 in{};
    std::memcpy(&in, address, sizeof in);
    ::inet_ntop(AF_INET6, &in.sin6_addr, text.data(), text.size());
  }
  return text.data();
}

std::vector<NetworkInterface> ReadInterfaces() {
  std::vector<NetworkInterface> interfaces;
  ifaddrs* list = nullptr;
  if (::getifaddrs(&list) != 0) return interfaces;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    auto found = std::ranges::find(interfaces, entry->ifa_name, &NetworkInterface::name);
    if (found == interfaces.end())
      found = interfaces.insert(interfaces.end(),
                                {.name = entry->ifa_name,
                                 .addresses = {},
                                 .up = (entry->ifa_flags & IFF_UP) != 0,
                                 .multicast = (entry->ifa_flags & IFF_MULTICAST) != 0});
    if (entry->ifa_addr != nullptr)
      if (std::string text = TextOf(entry->ifa_addr); !text.empty())
        found->addresses.insert(std::move(text));
  }
  ::freeifaddrs(list);
  return interfaces;
}

}  // namespace

HostFacts ReadHost() {
  HostFacts host;
  host.af_can_error = AfCanError();
  ReadClock(&host);
  rlimit files{};
  if (::getrlimit(RLIMIT_NOFILE, &files) == 0) host.open_files_max = files.rlim_cur;
  host.receive_buffer_max = NumberInFile("/proc/sys/net/core/rmem_max");
  ReadPorts("/proc/net/udp", &host.udp_ports);
  ReadPorts("/proc/net/udp6", &host.udp_ports);
  host.interfaces = ReadInterfaces();
  return host;
}

}  // namespace focalfleet::doctor
