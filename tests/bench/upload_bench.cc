// This bench uploads to whole buses on the simulated bit clock at 1 Mbit/s. The bench prints how
// much longer uploads take than the frames that arming needs, and how many bits a configured unit
// costs, beside jaeger's and DESI's.
//   upload_bench --units 100 --configurations 20 --seed 1
// Needed frames are counted once each: stage_begin, stage_segment, confirm, arm and the answers of
// the latter two. No figure depends on the machine.
//
// jaeger 1.11 (its source; paths of kaiju on its nominal grid, greedy, seed 3) sends 7548 frames
// for 500 robots. For each robot these are one SEND_NEW_TRAJECTORY (two u32), 13.1 points (steps
// i32, ticks i32; a chunk of them is as many frames) and one TRAJECTORY_DATA_END. Each is answered
// by an empty frame. Abort, stop and status of each robot before that are left out.
//
// DESI's frames are made by a program that is not public. The following is public: rows of a move
// table, one upload command a row at least, a checksum and an arming command, both answered. A
// usual move has at least three rows (the move, the jog against backlash, the final creep). Each
// frame is taken to be as short as such a frame can be.

#include <array>
#include <cinttypes>
#include <cstdio>
#include <iterator>
#include <span>

#include "protocol/base/rng.h"
#include "tests/bench/options.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/upload_on_wire.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;
using test::InProcessFleet;
using test::UploadOnWire;

/// The upload of each bus; empty where the units do not begin to move.
std::vector<UploadOnWire> UploadOnce(std::uint32_t units, std::uint64_t seed) {
  InProcessFleet fleet({.count = units, .units_per_bus = units, .seed = seed});
  fleet.Run(Milliseconds(2500));  // all units have been read
  std::vector<sim::WireFrame> wire;
  fleet.wire = &wire;
  fleet.ApplyRandom(seed);
  const bool moves = fleet.RunUntil(
      [&] { return fleet.coordinator().configuration().state == ConfigurationState::kMoving; },
      Seconds(60));
  std::vector<UploadOnWire> uploads;
  if (moves)
    for (const auto& [bus, upload] : test::MeasureUpload(wire)) uploads.push_back(upload);
  return uploads;
}

// ---- jaeger's frames, as its source composes them

constexpr double kJaegerPoints = 7548.0 / 500 - 2;

CanFrame JaegerFrame(Rng* rng, std::uint32_t command, std::uint8_t length) {
  CanFrame frame;
  const auto robot = static_cast<std::uint32_t>(1 + rng->Below(500));
  const auto number = static_cast<std::uint32_t>(rng->Below(64));
  frame.id = robot << 18 | command << 10 | number << 4;
  frame.length = length;
  return frame;
}
void Put32(std::uint32_t value, std::size_t at, CanFrame* frame) {
  for (std::size_t i = 0; i < 4; ++i)
    frame->data[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
}

double JaegerBitsPerRobot(std::uint64_t seed) {
  constexpr std::uint32_t kNew = 10;
  constexpr std::uint32_t kData = 11;
  constexpr std::uint32_t kEnd = 12;
  constexpr int kDraws = 20'000;
  constexpr double kStepsPerTurn = 1 << 30;
  constexpr double kTicksPerSecond = 2000;
  Rng rng = Rng::Stream(seed, "jaeger");
  double begin = 0;
  double point = 0;
  double end = 0;
  for (int n = 0; n < kDraws; ++n) {
    CanFrame frame = JaegerFrame(&rng, kNew, 8);
    Put32(static_cast<std::uint32_t>(3 + rng.Below(8)), 0, &frame);
    Put32(static_cast<std::uint32_t>(3 + rng.Below(8)), 4, &frame);
    begin += FrameBits(frame) + FrameBits(JaegerFrame(&rng, kNew, 0));
    frame = JaegerFrame(&rng, kData, 8);
    Put32(static_cast<std::uint32_t>(rng.Uniform(0, 0.99) * kStepsPerTurn), 0, &frame);
    Put32(static_cast<std::uint32_t>(rng.Uniform(0, 60) * kTicksPerSecond), 4, &frame);
    point += FrameBits(frame) + FrameBits(JaegerFrame(&rng, kData, 0));
    end += FrameBits(JaegerFrame(&rng, kEnd, 0)) + FrameBits(JaegerFrame(&rng, kEnd, 0));
  }
  return (begin + kJaegerPoints * point + end) / kDraws;
}

constexpr std::uint32_t kDataRates_bps[] = {2'000'000, 5'000'000};

/// The same uploads with their staging frames in CAN FD groups, as full as can be.
struct InGroups {
  std::uint64_t bits = 0;  // at the nominal rate
  std::uint64_t frames = 0;
  void Add(const UploadOnWire& upload, const BusRates& rates) {
    bits += upload.needed_bits_with(rates);
    frames += upload.frames - upload.staged.size();
    for (std::span<const CanFrame> rest = upload.staged; !rest.empty(); ++frames)
      rest = rest.subspan(NextOnWire(rest, rates).frames);
  }
};

constexpr std::uint32_t kDesiBitsLeast = 3 * (kFrameBitsMin + 8 * 8) + 4 * kFrameBitsMin;

int Run(int argc, char** argv) {
  const auto units = static_cast<std::uint32_t>(Option(argc, argv, "--units", 100));
  const int configurations = Option(argc, argv, "--configurations", 20);
  const auto seed = static_cast<std::uint64_t>(Option(argc, argv, "--seed", 1));
  std::vector<double> ratios;
  std::uint64_t bits = 0;
  std::uint64_t frames = 0;
  std::uint64_t segments = 0;
  std::uint64_t segment_bits = 0;
  std::uint64_t moved = 0;
  double longest_ms = 0;
  std::array<InGroups, std::size(kDataRates_bps)> in_groups{};
  for (int k = 0; k < configurations; ++k) {
    for (const UploadOnWire& upload : UploadOnce(units, seed + static_cast<std::uint64_t>(k))) {
      ratios.push_back(upload.ratio());
      bits += upload.needed_bits;
      frames += upload.frames;
      segments += upload.segments;
      segment_bits += upload.segment_bits;
      moved += upload.units;
      for (std::size_t r = 0; r < in_groups.size(); ++r)
        in_groups[r].Add(upload, {1'000'000, kDataRates_bps[r]});
      longest_ms = std::max(longest_ms, static_cast<double>(upload.elapsed_bits) * 1e-3);
    }
  }
  if (moved == 0) {
    std::fprintf(stderr, "upload_bench: nothing was uploaded\n");
    return 1;
  }
  const double n = static_cast<double>(moved);
  const double per_unit = static_cast<double>(bits) / n;
  const double segments_per_unit = static_cast<double>(segments) / n;
  const double jaeger = JaegerBitsPerRobot(seed);
  const double bits_per_segment = static_cast<double>(segment_bits) / static_cast<double>(segments);
  const double with_their_points =
      per_unit + (kJaegerPoints - segments_per_unit) * bits_per_segment;
  std::printf(
      "%d configurations, %u units on one bus of 1 Mbit/s: time over needed bits %.4f, worst "
      "%.4f; longest %.1f ms\n",
      configurations, units, Median(ratios), *std::max_element(ratios.begin(), ratios.end()),
      longest_ms);
  std::printf("bits a configured unit, both directions:\n");
  std::printf("  focalfleet  %7.0f  %.1f frames, %.2f segments\n", per_unit,
              static_cast<double>(frames) / n, segments_per_unit);
  for (std::size_t r = 0; r < in_groups.size(); ++r)
    std::printf("  focalfleet  %7.0f  %.1f frames; staged in CAN FD groups at %.0f Mbit/s\n",
                static_cast<double>(in_groups[r].bits) / n,
                static_cast<double>(in_groups[r].frames) / n, kDataRates_bps[r] * 1e-6);
  std::printf("  focalfleet  %7.0f  had it as many segments as jaeger has points\n",
              with_their_points);
  std::printf("  jaeger      %7.0f  %.1f frames with as many empty answers, %.1f points\n", jaeger,
              kJaegerPoints + 2, kJaegerPoints);
  std::printf("  DESI        %7u  at least; three rows, checksum, arming\n", kDesiBitsLeast);
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Run(argc, argv); }
