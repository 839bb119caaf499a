// The judge looks at a run from outside: at frames where a host gives them to its buses, at the
// disk as a power cut would leave it, at what is reported to readers and operators, and at where
// the units truly are. The judge shares no code with the daemon's store, knowledge or planning. Its
// rules:
//
//   start      A unit begins a move only where an intent for it was durable when the start signal,
//              or the order to home, was given to a bus; and the stored place was exact, unless it
//              homes.
//   place      A stored exact place is where the unit is. An open intent or an interval holds it.
//   reported   A place reported to readers is one that the store has acknowledged.
//   contact    No two arms touch, unless a fault kept every stop from one of them.
//   stop       Within a bound after a stop was ordered, no reachable unit moves; and after a stop
//              of all none begins before the next command.
//   twice      No move is begun twice.
//   bound      No more frames wait for a bus than the upload of all its units, and few batches for
//              the store.
//
// The store, stops, motion and alarms have judges of their own (store_judge.h, stop_judge.h,
// motion_judge.h, blame_judge.h): what survives a kill; stops; starts of one move apart, followers,
// power; units that are blamed for what the host did.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "daemon/soak/blame_judge.h"
#include "daemon/soak/draws.h"
#include "daemon/soak/motion_judge.h"
#include "daemon/soak/plant.h"
#include "daemon/soak/stop_judge.h"
#include "daemon/soak/store_judge.h"
#include "daemon/soak/troubles.h"
#include "daemon/status/shell_facts.h"
#include "daemon/status/status_batch.h"
#include "fleet/records.h"

namespace focalfleet::soak {

class Judge {
 public:
  /// With a camera, places are only as exact as it sees them.
  Judge(const Plant* plant, const MemoryDisk* disk, const Troubles* troubles, const Draws& draws,
        Extent survives = Extent::kAll);
  Judge(const Judge&) = delete;
  Judge& operator=(const Judge&) = delete;

  // ---- what it sees

  void Commits(std::span<const Row> rows) { store_.Commits(rows); }
  void Committed(std::span<const Row> rows, bool done);
  void Published(const StatusBatch& status);
  void Sends(BusId bus, const CanFrame& frame);
  /// Looks at the true state; call it ten times a second or more often.
  void Look(HostInstant now);
  [[nodiscard]] StopJudge& stops() { return stops_; }
  /// The store judge's.
  void LifeBegins() { store_.LifeBegins(); }
  void LifeHasBegun();
  /// The state of the queues of a life, buses in the layout's order.
  void Queues(std::size_t batches, std::span<const ShellFacts::Bus> buses);
  /// An operator takes the risk of contact from here on, or does not any more.
  void RiskTaken(bool taken) { risk_ = taken; }

  void Broken(const std::string& rule, const std::string& what);
  [[nodiscard]] const std::vector<std::string>& broken() const { return broken_; }
  [[nodiscard]] std::size_t IntentsOpen() const { return store_.IntentsOpen(); }
  /// The fleet as last acknowledged by the store.
  [[nodiscard]] const StoredPicture& acknowledged() const { return store_.acknowledged(); }
  /// Units whose arms touch, ascending.
  [[nodiscard]] std::vector<std::uint32_t> TouchingUnits() const;
  /// The store has an exact place of the hardware that is bound to the unit.
  [[nodiscard]] bool HasPlace(std::size_t row) const;

 private:
  struct Seen {
    std::uint32_t moves_begun = 0;
    std::uint32_t begun_twice = 0;
  };
  /// The callback of the judges that it is made of.
  StoreJudge::Broken Tells();
  void LookAtStarts(std::size_t row, const sim::UnitTruth& truth);
  /// Whether the unit's FLASH had false counts before the store first had its place. At its first
  /// contact a unit has no other witness.
  [[nodiscard]] bool IsItsOnlyWitness(std::size_t row) const;
  void LookAtPlace(std::size_t row, const sim::UnitTruth& truth);
  void LookAtFibre(std::size_t row, const sim::UnitTruth& truth, const StoredPlace& place);
  void LookForContact(std::span<const sim::UnitTruth> truths);
  void NoteBlind(std::span<const Row> rows);
  void NoteSeen(std::uint32_t serial, const StoredPlace& place);

  const Plant* plant_;
  const Troubles* troubles_;
  HostInstant now_{0};
  StoreJudge store_;
  struct Stored {
    HostInstant first;  // of its own counts; long ago once there was another witness
    HostInstant last;
    double slack_vectors = 0;  // of its counts
  };
  std::map<std::uint32_t, Stored> stored_;                     // times of places, by serial
  std::map<std::uint32_t, std::deque<StoredPlace>> reported_;  // acknowledged places, newest last
  using Move = std::pair<std::uint32_t, std::uint32_t>;        // unit, move
  std::map<Move, HostInstant> allowed_;  // by a durable intent, and when that was seen last
  std::set<Move> blind_;  // whose intent was acknowledged while the unit's place was not exact
  std::vector<Seen> seen_;
  StopJudge stops_;
  MotionJudge motion_;
  BlameJudge blame_;
  bool host_alone_;
  std::vector<std::size_t> frames_most_;  // that may wait. Shape: as the layout's buses
  std::vector<std::vector<std::size_t>> near_;
  std::set<std::pair<std::size_t, std::size_t>> touching_;
  bool risk_ = false;
  HostInstant forget_at_{0};  // stale moves
  std::vector<std::string> broken_;
};

}  // namespace focalfleet::soak
