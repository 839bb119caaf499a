// The controllers that stand on one bus: their presence, their error counters, and their progress
// back from bus-off.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/instants.h"
#include "protocol/base/rng.h"
#include "sim/world/bus/arbitration_queue.h"
#include "sim/world/bus/error_counters.h"

namespace focalfleet::sim {

struct BusNode {
  ErrorCounters errors;
  bool there = true;               // has power and is plugged in
  bool off = false;                // bus-off
  std::uint32_t rows_missing = 0;  // of eleven recessive bits, until it is back
  HostInstant counts_from{0};      // those rows
  std::vector<QueuedFrame> kept;   // while it cannot send
};

class BusNodes {
 public:
  /// The host's controller is there, as number kHostNode.
  explicit BusNodes(std::uint32_t bit_rate_bps) : bit_rate_bps_(bit_rate_bps), nodes_(1) {}

  /// Returns the number of another node, which is there and error-free.
  std::uint32_t Attach();

  BusNode& operator[](std::uint32_t node) { return nodes_[node]; }
  const BusNode& operator[](std::uint32_t node) const { return nodes_[node]; }
  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(nodes_.size()); }
  /// False: the node is away or off, and neither sends nor receives.
  [[nodiscard]] bool Hears(std::uint32_t node) const {
    return nodes_[node].there && !nodes_[node].off;
  }
  /// The number of nodes that hear.
  [[nodiscard]] std::uint32_t hearing() const { return hearing_; }
  /// All error counters are zero.
  [[nodiscard]] bool clean() const { return unclean_ == 0; }
  [[nodiscard]] bool any_off() const { return !off_.empty(); }
  /// A random one of the nodes that hear, other than `sender`. Pre: there is one.
  [[nodiscard]] std::uint32_t DrawReceiver(std::uint32_t sender, Rng* chance) const;

  struct Changed {
    bool became_passive = false;
    bool must_go_off = false;
  };
  /// Applies `change` to the error counters of `node`.
  template <class Change>
  Changed Count(std::uint32_t node, const Change& change);

  /// `node` is off, and counts recessive rows from `counts_from` on.
  void GoOff(std::uint32_t node, HostInstant counts_from);
  /// `node` is no longer there; an off node stays off.
  void Leave(std::uint32_t node);
  /// `node` is not off, whatever it was.
  void ClearOff(std::uint32_t node);
  /// `node`, which hears again, is counted among those that hear.
  void CountAsHearing() { ++hearing_; }

  // ---- the way back from bus-off; `idle_at` is when the wire fell idle

  /// The instant at which the first of the off nodes is back; kNever: none will be by itself.
  [[nodiscard]] HostInstant NextRecovery(HostInstant idle_at) const;
  void CountRowsWhileIdle(HostInstant idle_at, HostInstant now);
  /// The end of a frame is one row.
  void CountRowOfFrame(HostInstant idle_at);
  void CountRowsNotBefore(HostInstant now);
  /// The nodes that are back by `now`, no longer off.
  [[nodiscard]] std::vector<std::uint32_t> TakeRecovered(HostInstant idle_at, HostInstant now);

 private:
  [[nodiscard]] DurationNs Rows(std::uint32_t count) const;
  [[nodiscard]] HostInstant BackAt(const BusNode& node, HostInstant idle_at) const;

  std::uint32_t bit_rate_bps_;
  std::vector<BusNode> nodes_;
  std::vector<std::uint32_t> off_;
  std::uint32_t hearing_ = 1;  // nodes that are there and not off
  std::uint32_t unclean_ = 0;  // nodes with a counter that is not zero
};

template <class Change>
BusNodes::Changed BusNodes::Count(std::uint32_t node, const Change& change) {
  ErrorCounters& errors = nodes_[node].errors;
  const bool was_clean = errors.clean();
  const Confinement before = errors.state();
  change(&errors);
  if (was_clean != errors.clean()) unclean_ += was_clean ? 1u : UINT32_MAX;
  const Confinement after = errors.state();
  return {.became_passive = before == Confinement::kActive && after == Confinement::kPassive,
          .must_go_off = after == Confinement::kOff && !nodes_[node].off};
}

}  // namespace focalfleet::sim
