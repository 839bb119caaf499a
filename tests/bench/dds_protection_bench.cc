// This bench compares the kinds of protection of DDS Security (deploy/dds-security/make-keys): CPU
// time of a publisher of the whole fleet with one reader, the share of the samples that reach it,
// and the longest time without any. Rounds go through all kinds in turn, so that other load of the
// machine affects them alike. Figures are medians of the rounds.
//   dds_protection_bench [--units 5000] [--cycles 60] [--hz 10] [--rounds 3]
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/bench/options.h"
#include "tests/daemon/dds/client_process.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;
using test::ClientProcess;
using test::OwnDomain;

constexpr const char* kWithout = "without";  // no DDS Security at all
constexpr const char* kKinds[] = {kWithout, "none", "sign", "encrypt", "data-sign", "data-encrypt"};

struct Load {
  int units, cycles, hz;
};

struct Figures {
  std::vector<double> cpu_s, received_share, longest_ms;
};

void MakeKeys(const std::string& kind, const std::string& folder) {
  const std::string command = MAKE_KEYS " " + folder + " --domain " + std::to_string(OwnDomain()) +
                              " --protection " + kind + " > /dev/null";
  if (std::system(command.c_str()) != 0) std::exit(1);
}

void Run(const std::string& keys, const Load& load, Figures* figures) {
  const std::string domain = std::to_string(OwnDomain());
  std::vector<std::string> reader = {WATCHER, domain};
  std::vector<std::string> writer = {FLEET_PUBLISHER, domain, std::to_string(load.units),
                                     std::to_string(load.cycles), std::to_string(load.hz)};
  if (!keys.empty()) {
    reader.push_back(keys + "/monitor");
    writer.push_back(keys + "/daemon");
  }
  ClientProcess watcher(reader);
  ClientProcess publisher(writer);
  double cpu_s = 0;
  unsigned long sent = 0;
  if (std::sscanf(publisher.Line().c_str(), "%lf %lu", &cpu_s, &sent) != 2 ||
      publisher.Finish() != 0) {
    std::fprintf(stderr, "the publisher failed\n");
    std::exit(1);
  }
  // The watcher prints a line a second: a whole one later, all has come that will come.
  unsigned long units = 0, samples = 0, longest_ms = 0, missed = 0, before = sent;
  while (samples != before) {
    before = samples;
    if (std::sscanf(watcher.Line().c_str(), "%lu %lu %lu %lu", &units, &samples, &longest_ms,
                    &missed) != 4)
      std::exit(1);
  }
  figures->cpu_s.push_back(cpu_s * 1000 / load.cycles);
  figures->received_share.push_back(1 - static_cast<double>(missed) / static_cast<double>(sent));
  figures->longest_ms.push_back(static_cast<double>(longest_ms));
}

int Main(int argc, char** argv) {
  const Load load{Option(argc, argv, "--units", 5000), Option(argc, argv, "--cycles", 60),
                  Option(argc, argv, "--hz", 10)};
  const int rounds = Option(argc, argv, "--rounds", 3);
  setenv("CYCLONEDDS_URI", LOOPBACK_URI, 1);
  const test::ScratchFolder folder;
  std::vector<Figures> figures(std::size(kKinds));
  for (int round = 0; round < rounds; ++round)
    for (std::size_t k = 0; k < std::size(kKinds); ++k) {
      const std::string kind = kKinds[k];
      const std::string keys = kind == kWithout ? "" : folder / kind;
      if (round == 0 && !keys.empty()) MakeKeys(kind, keys);
      Run(keys, load, &figures[k]);
    }
  std::printf("%d units at %d Hz, %d cycles, medians of %d rounds\n", load.units, load.hz,
              load.cycles, rounds);
  std::printf("%-14s %22s %8s %16s %16s\n", "protection", "CPU s per 1000 cycles", "ratio",
              "received, share", "longest gap, ms");
  const double base = Median(figures[0].cpu_s);
  for (std::size_t k = 0; k < std::size(kKinds); ++k)
    std::printf("%-14s %22.2f %8.2f %16.4f %16.0f\n", kKinds[k], Median(figures[k].cpu_s),
                Median(figures[k].cpu_s) / base, Median(figures[k].received_share),
                Median(figures[k].longest_ms));
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
