// This bench measures what the metrics cost the core: a sample of the whole fleet on the core's
// thread, with nobody asking and with clients that scrape without a pause. The bench also prints
// the size of the page, its series, and the time to make it.
//   metrics_bench [--units 5000] [--samples 500] [--clients 8]
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "daemon/metrics/metrics_endpoint.h"
#include "daemon/metrics/metrics_sampler.h"
#include "daemon/metrics/metrics_text.h"
#include "fleet/hex_layout.h"
#include "tests/bench/options.h"

namespace focalfleet {
namespace {

using bench::Option;

/// CPU time of this thread: what the clients take of the machine is not the core's.
double ThreadSeconds() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Bytes of one scrape; 0: refused.
std::size_t Scrape(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::size_t bytes = 0;
  const std::string request = "GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n";
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
      ::send(fd, request.data(), request.size(), MSG_NOSIGNAL) > 0) {
    char buffer[65'536];
    for (ssize_t got = 0; (got = ::recv(fd, buffer, sizeof buffer, 0)) > 0;)
      bytes += static_cast<std::size_t>(got);
  }
  ::close(fd);
  return bytes;
}

void Run(int units, int samples, int clients) {
  const Layout layout =
      Layout::Create(MakeHexLayout({.count = static_cast<std::uint32_t>(units)}), {}).value();
  const Coordinator coordinator(&layout, std::vector<UnitDrive>(layout.size()), {}, {});
  NewestValue<const PlannedPower> power;
  NewestValue<const FleetMetrics> values;
  ShellFacts facts;
  facts.buses.resize(layout.buses().size());
  MetricsSampler sampler({.layout = &layout,
                          .facts = [&] { return facts; },
                          .power = &power,
                          .out = &values,
                          .clock = HostClock()});
  HostInstant now;
  const auto sample = [&] {
    now = sampler.wake_at();
    sampler.SampleIfDue({.layout = &layout, .coordinator = &coordinator, .now = now, .at = {}});
  };
  const auto median_us = [&] {
    std::vector<double> taken;
    for (int i = 0; i < samples; ++i) {
      const double begun = ThreadSeconds();
      sample();
      taken.push_back(1e6 * (ThreadSeconds() - begun));
    }
    return bench::Median(taken);
  };
  sample();
  const double alone_us = median_us();

  const WorkCounters work;
  const auto newest = values.Take();
  const double begun = ThreadSeconds();
  const std::string page = MetricsText(*newest, work, ReadProcessFacts(), 0);
  const double text_ms = 1e3 * (ThreadSeconds() - begun);
  std::istringstream lines(page);
  int series = 0;
  for (std::string line; std::getline(lines, line);) series += line.starts_with('#') ? 0 : 1;

  MetricsEndpoint endpoint({.values = &values, .work = &work, .store_path = ""},
                           {.address = "127.0.0.1"});
  while (endpoint.port() == 0) std::this_thread::yield();
  std::atomic<bool> ending{false};
  std::atomic<int> scrapes{0};
  std::vector<std::jthread> threads;
  for (int c = 0; c < clients; ++c)
    threads.emplace_back([&] {
      while (!ending)
        if (Scrape(endpoint.port()) > 0) ++scrapes;
    });
  while (scrapes < clients) sample();
  const double scraped_us = median_us();
  ending = true;
  threads.clear();
  std::printf("units %d, buses %zu: %d series, page of %.0f kB made in %.1f ms of CPU\n", units,
              layout.buses().size(), series, 1e-3 * static_cast<double>(page.size()), text_ms);
  std::printf("a sample on the core's thread: %.0f us of CPU alone, %.0f us with %d clients\n",
              alone_us, scraped_us, clients);
  std::printf("scrapes meanwhile: %d\n", scrapes.load());
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) {
  focalfleet::Run(focalfleet::bench::Option(argc, argv, "--units", 5000),
                  focalfleet::bench::Option(argc, argv, "--samples", 500),
                  focalfleet::bench::Option(argc, argv, "--clients", 8));
}
