#include "fleet/coordinate/bus_traffic.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace focalfleet {
namespace {

/// True for the frames that an upload consists of, both directions.
constexpr bool IsOfUpload(const CanFrame& frame) {
  const auto function = static_cast<Function>(frame.id >> 20 & 63);
  return function == Function::kStageBegin || function == Function::kStageSegment ||
         function == Function::kConfirm || function == Function::kArm ||
         function == Function::kProgress;
}

}  // namespace

BusTraffic::BusTraffic(const CoordinatorConfig& config, const StepState& step, UnitTable* units)
    : rates_{config.bit_rate_bps, config.data_bit_rate_bps}, step_(step), units_(*units) {}

void BusTraffic::CountHeard(const ReceivedFrame& received, BusRecord* bus) {
  ++bus->view.frames_received;
  heard_until_ = std::max(heard_until_, received.at);
  Count(bus, {&received.frame, 1});
}

void BusTraffic::EndStep() {
  for (BusRecord& bus : units_.buses) CloseLoadWindow(&bus);
  CountSent();
}

void BusTraffic::Count(BusRecord* bus, std::span<const CanFrame> frames) const {
  const OnWire passed = NextOnWire(frames, rates_);
  bus->view.bits += passed.bits;
  bus->window_bits += passed.bits;
  if (IsOfUpload(frames.front())) bus->view.upload.bits += passed.bits;
}

void BusTraffic::CountSent() {
  std::array<CanFrame, kGroupEntriesMax> together;
  const std::vector<OutFrame>& sent = step_.out->frames;
  for (std::size_t i = 0; i < sent.size();) {
    BusRecord* bus = units_.FindBus(sent[i].bus);
    std::size_t count = 0;
    do {
      together[count] = sent[i + count].frame;
      ++count;
    } while (rates_.data_bps > 0 && count < together.size() && i + count < sent.size() &&
             sent[i + count].bus == bus->id);
    const std::span<const CanFrame> front(together.data(), count);
    const std::size_t passed = NextOnWire(front, rates_).frames;
    Count(bus, front.first(passed));
    bus->view.frames_sent += passed;
    if (IsOfUpload(front[0])) bus->upload_began = std::min(bus->upload_began, step_.now);
    i += passed;
  }
}

void BusTraffic::CloseLoadWindow(BusRecord* bus) const {
  const HostInstant until = std::max(step_.now, heard_until_);
  if (bus->window_began == kNever) bus->window_began = until;
  const DurationNs window = until - bus->window_began;
  if (window < Milliseconds(1000)) return;
  bus->view.load = static_cast<double>(bus->window_bits) /
                   (window.seconds() * static_cast<double>(rates_.nominal_bps));
  bus->view.load_max = std::max(bus->view.load_max, bus->view.load);
  bus->window_began = until;
  bus->window_bits = 0;
}

}  // namespace focalfleet
