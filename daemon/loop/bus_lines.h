// All buses as the event loop sees them: frames that came in, links that changed, frames that have
// to go out. A line is a port with its transmit queue; only lines with something to do are touched.
//
// A turn takes limits::kFramesPerStep frames, or the rest of the port that reaches it. The lines
// that it leaves are the first of the next turn, which is due at once. Up to 64 buses are read
// whole: otherwise units could count as silent while their answers wait.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/loop/transmit_queue.h"
#include "daemon/ports/pollable_port.h"
#include "daemon/status/shell_facts.h"
#include "fleet/coordinator.h"

namespace focalfleet {

class BusLines {
 public:
  /// `buses` and `ports` belong together, in ascending order of the buses.
  BusLines(std::vector<BusId> buses, std::vector<std::unique_ptr<PollablePort>> ports);

  [[nodiscard]] std::size_t size() const { return lines_.size(); }
  [[nodiscard]] int fd(std::size_t line) const { return lines_[line].port->fd(); }
  void MarkReady(std::size_t line) { lines_[line].ready = true; }

  /// Appends the frames of every line that is ready or due, as many as a turn takes, and the links
  /// that changed or have another trouble. The first call appends all links.
  void Receive(HostInstant now, std::vector<ReceivedFrame>* frames, std::vector<LinkEvent>* links);

  /// The frame waits for its port; a frame for a dead link is discarded.
  void Put(const OutFrame& frame, HostInstant decided_at);
  /// Offers waiting frames to the ports. Each line gets its own reading of the clock, for its start
  /// signals.
  void Flush(const HostClock& clock);

  /// The instant at which some line needs Receive or Flush though nothing happens.
  [[nodiscard]] HostInstant wake_at(HostInstant now, const HostClock& clock) const;
  [[nodiscard]] std::vector<ShellFacts::Bus> Facts() const;
  [[nodiscard]] const std::string& trouble(BusId bus) const;
  [[nodiscard]] const std::string& name(BusId bus) const;

 private:
  struct Line {
    BusId bus;
    std::unique_ptr<PollablePort> port;
    TransmitQueue transmit_queue;
    bool ready = true;
    bool reported = false;  // the coordinator has received a state of the link
    LinkState last = LinkState::kUp;
    std::string trouble;  // as last reported
  };
  [[nodiscard]] std::size_t IndexOf(BusId bus) const;

  std::vector<Line> lines_;
  std::size_t first_ = 0;  // line that is received first
  bool left_ = false;      // the last turn left lines that are ready or due
};

}  // namespace focalfleet
