// The pulse on the SYNC line at the common start: the line is active at the planned instant and at
// rest again a little later. Units take the edge only within a window before their own start
// (docs/protocol.md). A pulse that would come after that start is left out.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "daemon/ports/sync_line.h"
#include "protocol/base/instants.h"

namespace focalfleet {

class SyncPulse {
 public:
  struct Options {
    DurationNs late_most = Milliseconds(5);  // a later pulse is left out
    DurationNs width = Milliseconds(10);
  };
  SyncPulse(std::unique_ptr<SyncLine> line, const Options& options)
      : line_(std::move(line)), options_(options) {}

  /// A pulse is planned; a planned one that has not come yet is replaced.
  void Plan(HostInstant at) { at_ = at; }

  /// The line is as planned for `now`. The result is the trouble, for the log; empty: none.
  std::string Serve(HostInstant now);

  [[nodiscard]] HostInstant wake_at() const { return std::min(at_, down_at_); }
  [[nodiscard]] std::uint64_t pulses() const { return pulses_; }
  [[nodiscard]] std::uint64_t missed() const { return missed_; }
  [[nodiscard]] const std::string& name() const { return line_->name(); }

 private:
  std::unique_ptr<SyncLine> line_;
  Options options_;
  HostInstant at_ = kNever;
  HostInstant down_at_ = kNever;
  std::uint64_t pulses_ = 0;
  std::uint64_t missed_ = 0;
};

}  // namespace focalfleet
