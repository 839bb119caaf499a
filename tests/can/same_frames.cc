// same_frames REFERENCE_LOG LOG SPEED compares two candump logs of the same configuration. The
// reference is from in_process_log, the other from real interfaces at SPEED times real time. Every
// bus must carry the same configuration frames, for every unit in the same order. Polls, clock and
// repeats are counted apart and bounded. The program prints how far apart the buses began. The exit
// code is 0 where all that holds.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <string>

#include "protocol/wire/codec.h"
#include "tests/can/configuration_frames.h"

namespace focalfleet {
namespace {

using test::BusNode;
using test::CandumpLog;
using test::ConfigurationFrames;
using test::LoggedFrame;
using test::MaskedFrame;
using test::ParseCandump;
using test::SortOut;

// The daemon's defaults, in the fleet's time, and the bounds that follow from them.
constexpr double kClockPeriod_s = 0.5;
constexpr double kPollPeriodMin_s = 1;
constexpr double kRepeatsMax = 0.02;      // share of the configuration's frames
constexpr double kSkewTolerance_ms = 20;  // assumed by planner and proofs
constexpr double kStartDelayTick_s = 1e-4;

int complaints = 0;

void Complain(const std::string& what) {
  if (++complaints <= 20) std::printf("%s\n", what.c_str());
}

CandumpLog Read(const char* path) {
  std::ifstream in(path, std::ios::binary);
  auto log = ParseCandump({std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()});
  if (log) return std::move(*log);
  std::printf("%s: %s\n", path, log.error().text.c_str());
  std::exit(1);
}

std::string Text(const MaskedFrame& frame) {
  std::string text = Name(static_cast<Function>(frame.id >> 20 & 63));
  text += (frame.id >> 19 & 1) != 0 ? " of the unit " : " of the host ";
  for (const std::uint8_t byte : frame.data) {
    char digits[3];
    std::snprintf(digits, sizeof digits, "%02X", unsigned{byte});
    text += digits;
  }
  return text;
}

void CompareUnit(const BusNode& where, const std::vector<MaskedFrame>& reference,
                 const std::vector<MaskedFrame>& seen) {
  const auto [a, b] = std::ranges::mismatch(reference, seen);
  if (a == reference.end() && b == seen.end()) return;
  Complain(where.first + " node " + std::to_string(where.second) + ", configuration frame " +
           std::to_string(a - reference.begin()) + ": expected " +
           (a == reference.end() ? "nothing" : Text(*a)) + ", saw " +
           (b == seen.end() ? "nothing" : Text(*b)));
}

// A bus's frames are equal as a multiset where each unit's are equal, in order; the test is made
// both ways.
std::size_t Compare(const ConfigurationFrames& reference, const ConfigurationFrames& seen) {
  std::size_t frames = 0;
  for (const auto& [where, expected] : reference.of_unit) {
    frames += expected.size();
    const auto found = seen.of_unit.find(where);
    CompareUnit(where, expected,
                found == seen.of_unit.end() ? std::vector<MaskedFrame>() : found->second);
  }
  for (const auto& [where, frames_seen] : seen.of_unit)
    if (!reference.of_unit.contains(where)) CompareUnit(where, {}, frames_seen);
  if (seen.malformed != 0) Complain(std::to_string(seen.malformed) + " malformed frames");
  return frames;
}

std::uint64_t RepeatsOf(const ConfigurationFrames& frames) {
  std::uint64_t sum = 0;
  for (const auto& [interface, count] : frames.repeats) sum += count;
  return sum;
}

void BoundTheRest(const ConfigurationFrames& reference, const ConfigurationFrames& seen,
                  std::size_t frames, double speed) {
  const double buses =
      static_cast<double>(std::ranges::count_if(reference.of_unit, [](const auto& entry) {
        return entry.first.second == kBroadcastNode.value;
      }));
  const double units = static_cast<double>(reference.of_unit.size()) - buses;
  const double life_s = seen.seconds * speed;
  const auto of = [&](Function function) { return seen.count[static_cast<std::size_t>(function)]; };
  // Two more starts a bus are sent by design, in both logs.
  const double more =
      static_cast<double>(RepeatsOf(seen)) - static_cast<double>(RepeatsOf(reference));
  const auto bound = [](const char* what, double is, double at_most) {
    std::printf("  %-28s %10.0f, at most %.0f\n", what, is, at_most);
    if (is > at_most) Complain(std::string("too many: ") + what);
  };
  bound("configuration frames again", more, kRepeatsMax * static_cast<double>(frames));
  // Each unit's clock is read at identification, once in its move, and with polls at rest.
  bound("clock and its readings", static_cast<double>(of(Function::kClock).host),
        buses * (life_s / kClockPeriod_s + 2) + 2 * units +
            static_cast<double>(of(Function::kStatus).host));
  bound("clock answers", static_cast<double>(of(Function::kClock).unit),
        static_cast<double>(of(Function::kClock).host));
  // Each unit is asked once at identification, and then at most once a poll period.
  bound("status polls", static_cast<double>(of(Function::kStatus).host),
        units * (life_s / kPollPeriodMin_s + 2));
  bound("answers to them", static_cast<double>(of(Function::kStatus).unit),
        static_cast<double>(of(Function::kStatus).host));
  // Identification reads identity, two vectors and two carrier counts. A tenth of them is asked
  // again, and values that differ from the configured drive are written.
  double reading = 0;
  for (const Function function : {Function::kIdentify, Function::kVector, Function::kParameterRead,
                                  Function::kParameterWrite})
    reading += static_cast<double>(of(function).host);
  bound("reading units", reading, 5 * 1.1 * units);
}

struct Spread {
  double low = INFINITY;
  double high = -INFINITY;
  void Add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double width() const { return high - low; }
};

// Start times of the units by the wire: each start frame's end, plus the delay that it names. Units
// obey the first start frame that they hear.
void ReportSkew(const CandumpLog& log, double speed) {
  std::map<std::uint16_t, std::set<std::string>> begun;
  std::map<std::uint16_t, Spread> first;
  std::map<std::uint16_t, Spread> all;
  for (const LoggedFrame& logged : log.frames) {
    const auto host = DecodeHost(logged.frame);
    const auto* start = host ? std::get_if<Start>(&host->message) : nullptr;
    if (start == nullptr) continue;
    const double at_s = static_cast<double>(logged.at_us - log.frames.front().at_us) * 1e-6 +
                        start->delay_ticks * kStartDelayTick_s / speed;
    all[start->move.value].Add(at_s * 1e3);
    if (begun[start->move.value].insert(logged.interface).second)
      first[start->move.value].Add(at_s * 1e3);
  }
  for (const auto& [move, spread] : first) {
    const double skew_ms = spread.width() * speed;
    std::printf(
        "  move %d begins on %zu buses within %.2f ms of real time, %.2f ms of the fleet's (any of "
        "its start frames: %.2f ms); the planner allows %.0f ms\n",
        int{move}, begun[move].size(), spread.width(), skew_ms, all[move].width() * speed,
        kSkewTolerance_ms);
    if (skew_ms > kSkewTolerance_ms) Complain("the buses began too far apart");
  }
}

int Run(const char* reference_path, const char* path, double speed) {
  const CandumpLog log = Read(path);
  const ConfigurationFrames reference = SortOut(Read(reference_path));
  const ConfigurationFrames seen = SortOut(log);
  const std::size_t frames = Compare(reference, seen);
  if (frames == 0) Complain(std::string(reference_path) + ": no configuration in it");
  std::printf("%zu configuration frames of %zu logged in %.1f s:\n", frames, log.frames.size(),
              seen.seconds);
  BoundTheRest(reference, seen, frames, speed);
  ReportSkew(log, speed);
  std::printf("%d differences\n", complaints);
  return complaints == 0 ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int count, char** arguments) {
  if (count != 4) {
    std::fputs("usage: same_frames REFERENCE_LOG LOG SPEED\n", stderr);
    return 2;
  }
  return focalfleet::Run(arguments[1], arguments[2], std::atof(arguments[3]));
}
