// This bench compares the cost of StatusPublisher with that of a bare publisher in C. Both publish
// the whole fleet at a fixed rate to one reader process, or to several. The figure is the CPU time
// of the publisher's process, in pairs that alternate. Other load of the machine therefore affects
// both alike.
//   dds_status_bench [--units 5000] [--cycles 60] [--hz 10] [--pairs 5] [--readers 1]
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "tests/bench/options.h"
#include "tests/daemon/dds/client_process.h"
#include "tests/daemon/dds/own_domain.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;
using test::ClientProcess;
using test::OwnDomain;

struct Load {
  int units;
  int cycles;
  int hz;
  int readers;
};

struct Outcome {
  double cpu_s = 0;
  unsigned long sent = 0;
  unsigned long received = 0;  // by all readers
};

Outcome Run(const char* publisher_program, const Load& load) {
  const std::string domain = std::to_string(OwnDomain());
  std::vector<std::unique_ptr<ClientProcess>> subscribers;
  for (int n = 0; n < load.readers; ++n) {
    subscribers.push_back(
        std::make_unique<ClientProcess>(std::vector<std::string>{SUBSCRIBER, domain}));
    if (subscribers.back()->Line() != "ready") std::abort();
  }
  ClientProcess publisher({publisher_program, domain, std::to_string(load.units),
                           std::to_string(load.cycles), std::to_string(load.hz)});
  Outcome outcome;
  if (std::sscanf(publisher.Line().c_str(), "%lf %lu", &outcome.cpu_s, &outcome.sent) != 2 ||
      publisher.Finish() != 0) {
    std::fprintf(stderr, "%s failed\n", publisher_program);
    std::exit(1);
  }
  for (const auto& subscriber : subscribers)
    outcome.received += std::strtoul(subscriber->Line().c_str(), nullptr, 10);
  return outcome;
}

/// Units: %; of what was sent to all readers.
double Share(const Outcome& outcome, const Load& load) {
  return 100.0 * static_cast<double>(outcome.received) /
         (static_cast<double>(outcome.sent) * load.readers);
}

int Main(int argc, char** argv) {
  const Load load{Option(argc, argv, "--units", 5000), Option(argc, argv, "--cycles", 60),
                  Option(argc, argv, "--hz", 10), Option(argc, argv, "--readers", 1)};
  const int pairs = Option(argc, argv, "--pairs", 5);
  setenv("CYCLONEDDS_URI", LOOPBACK_URI, 1);
  std::vector<double> bare;
  std::vector<double> ours;
  std::vector<double> ratios;
  for (int pair = 0; pair < pairs; ++pair) {
    // The order within a pair alternates, too.
    const Outcome first = Run(pair % 2 == 0 ? BARE_PUBLISHER : FLEET_PUBLISHER, load);
    const Outcome second = Run(pair % 2 == 0 ? FLEET_PUBLISHER : BARE_PUBLISHER, load);
    const Outcome& b = pair % 2 == 0 ? first : second;
    const Outcome& o = pair % 2 == 0 ? second : first;
    if (o.sent != b.sent || o.received == 0 || b.received == 0) {
      std::fprintf(stderr, "sent %lu and %lu, received %lu and %lu\n", b.sent, o.sent, b.received,
                   o.received);
      return 1;
    }
    bare.push_back(b.cpu_s);
    ours.push_back(o.cpu_s);
    ratios.push_back(o.cpu_s / b.cpu_s);
    std::printf(
        "pair %d: bare %.3f s (received %.2f %%), ours %.3f s (received %.2f %%), ratio %.3f\n",
        pair + 1, b.cpu_s, Share(b, load), o.cpu_s, Share(o, load), ratios.back());
    std::fflush(stdout);
  }
  std::printf(
      "dds_status: %d units, %d cycles at %d Hz, %d readers: CPU median bare %.3f s, ours %.3f s, "
      "ratio of medians %.3f, median ratio %.3f\n",
      load.units, load.cycles, load.hz, load.readers, Median(bare), Median(ours),
      Median(ours) / Median(bare), Median(ratios));
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
