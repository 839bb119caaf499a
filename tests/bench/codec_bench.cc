// This bench runs frames through the codec on one core. The first load is all kinds of messages in
// random order. The second is the mix of an upload (begin, segments, confirm, arm, and their
// answers). The bench prints frames per CPU second each way and its allocations. The exit code is 1
// if there was an allocation, or if a frame did not come back unchanged.
//   codec_bench [--frames 20000000]
#include <cstdio>
#include <ctime>
#include <utility>
#include <vector>

#include "protocol/wire/codec.h"
#include "tests/bench/options.h"
#include "tests/protocol/random_messages.h"
#include "tests/support/alloc_guard.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;

constexpr std::size_t kDistinct = 4096;  // frames and messages stay in the first two caches
constexpr int kRuns = 5;

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <class Message>
struct Load {
  std::vector<Addressed<Message>> messages;
  std::vector<CanFrame> frames;
};

Address AnyAddress(Rng& rng) {
  return {{static_cast<std::uint8_t>(rng.Below(100))}, static_cast<std::uint8_t>(rng.Below(256))};
}

template <class Message, class Draw>
Load<Message> MakeLoad(Rng rng, Draw draw) {
  Load<Message> load;
  for (std::size_t i = 0; i < kDistinct; ++i) {
    load.messages.push_back({AnyAddress(rng), draw(rng, i)});
    load.frames.push_back(Encode(load.messages.back().message, load.messages.back().address));
  }
  return load;
}

// Alternatives of the variants: an upload of eight segments, and the unit's answers to it.
HostMessage OfAnUpload(Rng& rng, std::size_t i) {
  constexpr std::size_t kOrder[] = {6, 7, 7, 7, 7, 7, 7, 7, 7, 5, 4};
  return test::RandomHost(kOrder[i % std::size(kOrder)], rng);
}
UnitMessage ToAnUpload(Rng& rng, std::size_t i) {
  constexpr std::size_t kOrder[] = {3, 2, 5, 0};
  return test::RandomUnit(kOrder[i % std::size(kOrder)], rng);
}

auto DecodeAs(const CanFrame& frame, const HostMessage*) { return DecodeHost(frame); }
auto DecodeAs(const CanFrame& frame, const UnitMessage*) { return DecodeUnit(frame); }

struct Outcome {
  double encoded_per_s = 0;
  double decoded_per_s = 0;
  std::uint64_t allocations = 0;
  bool good = true;
};

template <class Message>
Outcome RunOnce(const Load<Message>& load, int frames) {
  Outcome outcome;
  const test::AllocGuard guard;
  std::uint64_t sum = 0;
  double begin = CpuSeconds();
  for (int i = 0; i < frames; ++i) {
    const auto& [address, message] = load.messages[static_cast<std::size_t>(i) % kDistinct];
    const CanFrame frame = Encode(message, address);
    sum += frame.id + frame.data[0];
  }
  outcome.encoded_per_s = frames / (CpuSeconds() - begin);
  begin = CpuSeconds();
  int good = 0;
  for (int i = 0; i < frames; ++i) {
    const auto decoded = DecodeAs(load.frames[static_cast<std::size_t>(i) % kDistinct],
                                  static_cast<const Message*>(nullptr));
    if (decoded) good += 1 + static_cast<int>(decoded->message.index() >> 8);
  }
  outcome.decoded_per_s = frames / (CpuSeconds() - begin);
  outcome.allocations = guard.allocations();
  outcome.good = good == frames && sum != 0;
  return outcome;
}

template <class Message>
bool Measure(const char* what, const Load<Message>& load, int frames) {
  std::vector<double> encoded;
  std::vector<double> decoded;
  std::uint64_t allocations = 0;
  bool good = true;
  for (int run = 0; run < kRuns; ++run) {
    const Outcome outcome = RunOnce(load, frames);
    encoded.push_back(outcome.encoded_per_s * 1e-6);
    decoded.push_back(outcome.decoded_per_s * 1e-6);
    allocations += outcome.allocations;
    good = good && outcome.good;
  }
  std::printf("%-22s %12.1f %12.1f %12llu%s\n", what, Median(encoded), Median(decoded),
              static_cast<unsigned long long>(allocations), good ? "" : "  WRONG");
  return good && allocations == 0;
}

int Main(int argc, char** argv) {
  const int frames = Option(argc, argv, "--frames", 20'000'000);
  const Rng rng(1);
  std::printf("%-22s %12s %12s %12s\n", "million per CPU second", "encoded", "decoded",
              "allocations");
  bool good = Measure(
      "host, every kind",
      MakeLoad<HostMessage>(rng, [](Rng& r, std::size_t) { return test::RandomHost(r); }), frames);
  good =
      Measure("unit, every kind",
              MakeLoad<UnitMessage>(rng, [](Rng& r, std::size_t) { return test::RandomUnit(r); }),
              frames) &&
      good;
  good = Measure("host, an upload", MakeLoad<HostMessage>(rng, OfAnUpload), frames) && good;
  good = Measure("unit, to an upload", MakeLoad<UnitMessage>(rng, ToAnUpload), frames) && good;
  return good ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
