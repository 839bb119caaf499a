// The controllers that stand on one bus: their presence, their error counters, and their progress
// back from bus-off. A controller that is off neither sends nor receives until it has seen 128
// times eleven recessive bits.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/instants.h"
#include "protocol/base/rng.h"
#include "sim/world/bus/arbitration_queue.h"
#include "sim/world/bus/bus_counters.h"
#include "sim/world/bus/bus_options.h"
#include "sim/world/bus/error_counters.h"

namespace focalfleet::sim {

struct BusNode {
  ErrorCounters errors;
  bool there = true;               // has power and is plugged in
  bool off = false;                // bus-off
  std::uint32_t rows_missing = 0;  // of eleven recessive bits, until it is back
  HostInstant counts_from{0};      // those rows

  /// False: the node is away or off, and neither sends nor receives.
  [[nodiscard]] bool hears() const { return there && !off; }
  [[nodiscard]] Confinement state() const { return off ? Confinement::kOff : errors.state(); }
};

class BusNodes {
 public:
  /// The host's controller is there, as number kHostNode.
  explicit BusNodes(const BusOptions& options) : options_(options), nodes_(1) {}

  /// Returns the number of another node, which is there and error-free.
  std::uint32_t Attach();

  const BusNode& operator[](std::uint32_t node) const { return nodes_[node]; }
  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(nodes_.size()); }
  /// The number of nodes that hear.
  [[nodiscard]] std::uint32_t hearing() const { return hearing_; }
  /// All error counters are zero.
  [[nodiscard]] bool clean() const { return unclean_ == 0; }
  /// A random one of the nodes that hear, other than `sender`. Pre: there is one.
  [[nodiscard]] std::uint32_t DrawReceiver(std::uint32_t sender, Rng* chance) const;
  [[nodiscard]] const ConfinementCounters& counters() const { return counters_; }

  /// Applies `change` to the error counters of `node`. True: the node went off by it, and counts
  /// recessive rows from `now` on; the host's does so when it is restarted.
  template <class Change>
  bool Count(std::uint32_t node, HostInstant now, const Change& change);

  // ---- presence

  /// The node is away. When power returns its controller is as new.
  void PowerOff(std::uint32_t node);
  /// True: the node was away, and hears again.
  bool PowerOn(std::uint32_t node);
  /// The node is away, and its controller goes on.
  void Unplug(std::uint32_t node);
  /// As PowerOn. Where the node `has_frames`, it became passive while it was away.
  bool Plug(std::uint32_t node, bool has_frames, HostInstant now);

  // ---- the way to bus-off and back; `idle_at` is when the wire fell idle

  /// The node is off, as after a short circuit.
  void ThrowOff(std::uint32_t node, HostInstant now);
  /// The host's controller begins its recovery, if it is off.
  void RestartHost(HostInstant now);
  /// The instant at which the first of the off nodes is back; kNever: none will be by itself.
  [[nodiscard]] HostInstant NextRecovery(HostInstant idle_at) const;
  void CountRowsWhileIdle(HostInstant idle_at, HostInstant now);
  /// The end of a frame is one row.
  void CountRowOfFrame(HostInstant idle_at);
  void CountRowsNotBefore(HostInstant now);
  /// The nodes that are back by `now`: they hear, and are error-free.
  [[nodiscard]] std::vector<std::uint32_t> TakeRecovered(HostInstant idle_at, HostInstant now);

 private:
  void GoOff(std::uint32_t node, HostInstant now);
  [[nodiscard]] HostInstant BackAt(const BusNode& node, HostInstant idle_at) const;

  BusOptions options_;
  std::vector<BusNode> nodes_;
  std::vector<std::uint32_t> off_;
  ConfinementCounters counters_;
  std::uint32_t hearing_ = 1;  // nodes that are there and not off
  std::uint32_t unclean_ = 0;  // nodes with a counter that is not zero
};

template <class Change>
bool BusNodes::Count(std::uint32_t node, HostInstant now, const Change& change) {
  ErrorCounters& errors = nodes_[node].errors;
  const bool was_clean = errors.clean();
  const Confinement before = errors.state();
  change(&errors);
  if (was_clean != errors.clean()) unclean_ += was_clean ? 1u : UINT32_MAX;
  const Confinement after = errors.state();
  if (before == Confinement::kActive && after == Confinement::kPassive) ++counters_.went_passive;
  if (after != Confinement::kOff || nodes_[node].off) return false;
  GoOff(node, now);
  return true;
}

}  // namespace focalfleet::sim
