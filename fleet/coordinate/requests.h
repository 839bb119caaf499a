// Requests are questions to units. A unit has at most one question open, with a deadline, a
// sequence number, and a bounded number of repeats. Every frame of the host passes here: questions
// through the queue of their bus, stops, starts and the clock past it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "fleet/coordinate/coordinator_config.h"
#include "fleet/coordinate/step_state.h"
#include "fleet/coordinate/unit_table.h"
#include "fleet/coordinate/unit_timers.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet {

/// The sequence number before the first question of a run. An answer to the run before may be held
/// up on its way, and should answer nothing of this one: it would give a place or a clock of
/// earlier. Each run that has stored anything has taken a block of move numbers, and begins 99
/// numbers behind the one before it: a run that was killed young has no number in common with the
/// next one. An answer to a long run may have any, and meets an open question by chance, once in
/// 254. `next_move`: as stored.
[[nodiscard]] std::uint8_t SequenceBeforeRun(MoveId next_move);

class Requests {
 public:
  /// All arguments but `next_move` outlive this. `next_move`: as stored before this run.
  Requests(const CoordinatorConfig& config, const StepState& step, UnitTable* units,
           UnitTimers* timers, MoveId next_move);

  /// Replaces any open question. Where the bus's queue is full the question is asked when it has
  /// room. `answer_bits`: length of the answer, where that is known; 0: a fair guess.
  void Ask(PositionerIndex i, const HostMessage& message, std::uint32_t answer_bits = 0);
  /// The sequence number of the question after `questions` more ones.
  [[nodiscard]] std::uint8_t SequenceAfter(PositionerIndex i, int questions) const;
  /// Drops the open question, and what waits for the unit on its bus.
  void Forget(PositionerIndex i);
  /// True where a repeat went out; false where the last one is over without an answer.
  [[nodiscard]] bool AskAgain(PositionerIndex i);
  /// Matches an answer to the open question; false: late, doubled, or to a question that was not
  /// asked, or has not left yet.
  [[nodiscard]] bool Answers(PositionerIndex i, Function function, std::uint8_t sequence);
  /// How long a question may stay open, all repeats included.
  [[nodiscard]] DurationNs Patience() const;

  /// Sends a frame past the queue: stops, starts, the clock.
  void SendNow(std::size_t bus, const HostMessage& message, NodeId node);
  /// True where a `done, stopped` under this sequence number may answer a stop of this host. Then
  /// it is a copy, or the answer to a stop past the queue. Pre: no open question waits for it.
  [[nodiscard]] bool MayAnswerOurStop(PositionerIndex i, std::uint8_t sequence) const;

  /// Sends the clock where it is due, releases what the buses have room for, and sets the deadlines
  /// of the questions that left.
  void Release();

 private:
  void DropQuestion(PositionerIndex i);
  void SetDeadline(PositionerIndex i);

  const CoordinatorConfig& config_;
  const BusRates rates_;
  const StepState& step_;
  UnitTable& units_;
  UnitTimers& timers_;
  std::vector<PositionerIndex> asked_;  // of Release; kept for its memory
};

}  // namespace focalfleet
