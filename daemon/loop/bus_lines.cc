#include "daemon/loop/bus_lines.h"

#include <algorithm>
#include <utility>

#include "daemon/ports/socket_frames.h"
#include "protocol/base/check.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

static_assert(limits::kFramesPerStep >= 64 * kFramesPerReceive, "64 buses are read whole");

/// No frame gets through, and waiting frames would be stale when the link lives again.
bool Dead(LinkState state) { return state == LinkState::kDown || state == LinkState::kOff; }

}  // namespace

BusLines::BusLines(std::vector<BusId> buses, std::vector<std::unique_ptr<PollablePort>> ports) {
  FOCALFLEET_CHECK(buses.size() == ports.size());
  lines_.reserve(buses.size());
  for (std::size_t i = 0; i < buses.size(); ++i)
    lines_.push_back(
        {.bus = buses[i], .port = std::move(ports[i]), .transmit_queue = TransmitQueue()});
}

std::size_t BusLines::IndexOf(BusId bus) const {
  const auto it = std::ranges::lower_bound(lines_, bus, {}, &Line::bus);
  FOCALFLEET_CHECK(it != lines_.end() && it->bus == bus);
  return static_cast<std::size_t>(it - lines_.begin());
}

void BusLines::Receive(HostInstant now, std::vector<ReceivedFrame>* frames,
                       std::vector<LinkEvent>* links) {
  const std::size_t most = frames->size() + limits::kFramesPerStep;
  const std::size_t first = first_;
  left_ = false;
  for (std::size_t n = 0; n < lines_.size(); ++n) {
    const std::size_t at = (first + n) % lines_.size();
    Line& line = lines_[at];
    if (line.ready || line.port->wake_at() <= now) {
      if (frames->size() >= most) {
        line.ready = true;
        if (!std::exchange(left_, true)) first_ = at;
        continue;
      }
      line.port->Receive(now, frames);
    }
    line.ready = false;
    const LinkState state = line.port->state();
    // A link that is down may have one trouble after another; only the first one is reported.
    const std::string& trouble = line.port->trouble();
    const bool more = state != LinkState::kDown && !trouble.empty() && trouble != line.trouble;
    if (line.reported && state == line.last && !more) continue;
    if (Dead(state)) line.transmit_queue.Clear();
    line.reported = true;
    line.last = state;
    line.trouble = trouble;
    links->push_back({line.bus, state, trouble});
  }
}

void BusLines::Put(const OutFrame& frame, HostInstant decided_at) {
  Line& line = lines_[IndexOf(frame.bus)];
  if (Dead(line.port->state())) return;
  static_cast<void>(line.transmit_queue.Put(frame.frame, decided_at));
}

void BusLines::Flush(const HostClock& clock) {
  for (Line& line : lines_)
    if (line.transmit_queue.size() > 0)
      line.transmit_queue.Flush(line.port.get(),
                                line.transmit_queue.holds_start() ? clock.Now() : HostInstant{0});
}

HostInstant BusLines::wake_at(HostInstant now, const HostClock& clock) const {
  HostInstant at = left_ ? now : kNever;
  for (const Line& line : lines_) {
    at = std::min(at, line.port->wake_at());
    const bool dead = Dead(line.port->state());
    if (line.transmit_queue.size() > 0)
      at = std::min(at, dead ? now : now + clock.Real(line.port->retry_full()));
  }
  return at;
}

std::vector<ShellFacts::Bus> BusLines::Facts() const {
  std::vector<ShellFacts::Bus> facts;
  facts.reserve(lines_.size());
  for (const Line& line : lines_)
    facts.push_back({.port = line.port->name(),
                     .trouble = line.port->trouble(),
                     .counters = line.port->counters(),
                     .transmit_queue = line.transmit_queue.counters(),
                     .waiting = line.transmit_queue.size()});
  return facts;
}

const std::string& BusLines::trouble(BusId bus) const {
  return lines_[IndexOf(bus)].port->trouble();
}
const std::string& BusLines::name(BusId bus) const { return lines_[IndexOf(bus)].port->name(); }

}  // namespace focalfleet
