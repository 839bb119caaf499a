// This bench compares the cost of Store::Commit with that of a bare sqlite3 loop. Both update both
// axes of all serials in one durable transaction, on the same disk, taking turns.
//   store_bench [--serials 5000] [--rounds 200]
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <vector>

#include "daemon/store/store.h"
#include "tests/bench/bare_store.h"
#include "tests/bench/options.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;

double CpuMs() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1e3 * static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-3 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

struct Times {
  std::vector<double> wall_ms;
  std::vector<double> cpu_ms;

  bool Add(const std::function<bool()>& work) {
    const double cpu = CpuMs();
    const auto began = std::chrono::steady_clock::now();
    const bool done = work();
    wall_ms.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began)
            .count());
    cpu_ms.push_back(CpuMs() - cpu);
    return done;
  }
};

// The core writes the rows, so this time is not measured here.
void SetRows(std::int32_t k, std::vector<Row>* rows) {
  for (std::size_t i = 0; i < rows->size(); ++i) {
    (*rows)[i] = VectorRow{.serial = {static_cast<std::uint32_t>(i + 1)},
                           .knowledge = Exactly(Witness::kReported, Pose{k, k}),
                           .subdivision = {96, 96},
                           .move = {static_cast<std::uint16_t>(k)},
                           .origin = Origin::kMove};
  }
}

int Run(int serials, int rounds, const std::string& folder) {
  bare_store bare{};
  auto store = Store::Open(folder + "/fleet.db");
  if (!store || bare_store_open(&bare, (folder + "/bare.db").c_str()) != 0) return 1;
  std::vector<Row> rows(static_cast<std::size_t>(serials));
  Times ours;
  Times theirs;
  for (int round = -3; round < rounds; ++round) {  // the first rounds warm up
    const std::int32_t k = 1000 + round;
    const WallTime now = WallTime::Now();
    SetRows(k, &rows);
    if (round == 0) ours = theirs = {};
    const auto commit = [&] { return (*store)->Commit(rows, now).has_value(); };
    const auto update = [&] {
      return bare_store_update(&bare, static_cast<std::uint32_t>(serials), k, now.ns) == 0;
    };
    const bool done = round % 2 == 0 ? ours.Add(commit) && theirs.Add(update)
                                     : theirs.Add(update) && ours.Add(commit);
    if (!done) return 1;
  }
  bare_store_close(&bare);
  std::printf(
      "store: %d vectors a transaction, %d transactions each: "
      "median wall bare %.2f ms, ours %.2f ms, ratio %.3f; "
      "median CPU bare %.2f ms, ours %.2f ms, ratio %.3f\n",
      2 * serials, rounds, Median(theirs.wall_ms), Median(ours.wall_ms),
      Median(ours.wall_ms) / Median(theirs.wall_ms), Median(theirs.cpu_ms), Median(ours.cpu_ms),
      Median(ours.cpu_ms) / Median(theirs.cpu_ms));
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) {
  // The folder is on the disk where the bench is started, not in a /tmp that may be memory.
  const focalfleet::test::ScratchFolder folder(std::filesystem::current_path().string());
  return focalfleet::Run(focalfleet::bench::Option(argc, argv, "--serials", 5000),
                         focalfleet::bench::Option(argc, argv, "--rounds", 200), folder.path());
}
