#include "fleet/coordinate/requests.h"

#include <algorithm>
#include <utility>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

// Average length of an answer of eight bytes. The schedule only needs it to be fair.
constexpr std::uint32_t kAnswerBits = 145;
constexpr DurationNs kQueueFullWait = Milliseconds(20);
// 255 is left to programs that stop the units past the coordinator (daemon/cli/direct_stop.cc).
constexpr std::uint8_t kLastSequence = 254;
/// Bus time that a stop of all has to itself: the frame on the wire, one that must be sent again,
/// and the stop.
constexpr std::uint32_t kStopAloneFrames = 4;

Function AnswerFunction(const CanFrame& question) {
  const auto function = static_cast<Function>(question.id >> 20 & 63);
  return function == Function::kStop ? Function::kDone : function;
}

}  // namespace

std::uint8_t SequenceBeforeRun(MoveId next_move) {
  // Without a divisor in common with 254, so that the 64 blocks begin apart, and the first one 113
  // numbers from the last. With 101 these two are 13 apart; with half or twice of 99 runs are 49 or
  // 56 apart. A run asks each unit 7 questions at its start, and one every 10 s at rest.
  constexpr std::uint32_t kApart = 99;
  return static_cast<std::uint8_t>(next_move.value / limits::kMovesReserved * kApart %
                                   kLastSequence);
}

Requests::Requests(const CoordinatorConfig& config, const StepState& step, UnitTable* units,
                   UnitTimers* timers, MoveId next_move)
    : config_(config),
      rates_{config.bit_rate_bps, config.data_bit_rate_bps},
      step_(step),
      units_(*units),
      timers_(*timers) {
  for (std::uint32_t n = 0; n < units_.size(); ++n)
    units_[{n}].request.sequence = SequenceBeforeRun(next_move);
}

std::uint8_t Requests::SequenceAfter(PositionerIndex i, int questions) const {
  const int last = units_[i].request.sequence;
  return static_cast<std::uint8_t>((last + questions - 1) % kLastSequence + 1);
}

void Requests::Ask(PositionerIndex i, const HostMessage& message, std::uint32_t answer_bits) {
  UnitRecord& record = units_[i];
  DropQuestion(i);
  record.request.sequence = SequenceAfter(i, 1);
  if (std::holds_alternative<Stop>(message)) {
    std::shift_right(record.request.stop_sequences.begin(), record.request.stop_sequences.end(), 1);
    record.request.stop_sequences.front() = record.request.sequence;
    record.motion.runs_freely = false;
  }
  const CanFrame frame = Encode(message, {units_.layout.unit(i).node, record.request.sequence});
  record.request.question = Question{.message = message,
                                     .answer_function = AnswerFunction(frame),
                                     .sequence = record.request.sequence,
                                     .answer_bits = answer_bits == 0 ? kAnswerBits : answer_bits};
  if (!units_.bus_of(i).schedule.Enqueue({frame, record.request.question->answer_bits, i})) {
    record.request.question->deadline = step_.now + kQueueFullWait;
    timers_.Set(i, record.request.question->deadline);
  } else {
    timers_.Set(i, kNever);
  }
}

bool Requests::AskAgain(PositionerIndex i) {
  UnitRecord& record = units_[i];
  Question& question = *record.request.question;
  if (question.tries++ >= limits::kRequestRetries) return false;
  ++units_.bus_of(i).view.retries;
  const CanFrame frame = Encode(question.message, {units_.layout.unit(i).node, question.sequence});
  question.deadline = kNever;
  if (!units_.bus_of(i).schedule.Enqueue({frame, question.answer_bits, i})) {
    question.deadline = step_.now + kQueueFullWait;
    timers_.Set(i, question.deadline);
  }
  return true;
}

DurationNs Requests::Patience() const {
  constexpr std::int64_t kWaits = (std::int64_t{1} << (limits::kRequestRetries + 1)) - 1;
  return config_.reply_wait * kWaits + config_.transmit_horizon * (limits::kRequestRetries + 1);
}

void Requests::Forget(PositionerIndex i) {
  DropQuestion(i);
  units_.bus_of(i).schedule.Drop(units_.layout.unit(i).node);
}

void Requests::DropQuestion(PositionerIndex i) {
  UnitRecord& record = units_[i];
  const bool writes = record.request.question &&
                      std::holds_alternative<ParameterWrite>(record.request.question->message);
  record.request.question.reset();
  if (!writes || record.request.write_request == 0) return;
  step_.out->replies.push_back(
      {std::exchange(record.request.write_request, 0),
       true,
       Error{ErrorCode::kUnavailable,
             units_.NameOf(i) + " did not answer: it may have taken the value or not"},
       {}});
}

bool Requests::Answers(PositionerIndex i, Function function, std::uint8_t sequence) {
  UnitRecord& record = units_[i];
  if (!record.request.question || record.request.question->answer_function != function ||
      record.request.question->sequence != sequence || record.request.question->asked == kNever)
    return false;
  record.request.answered_asked = record.request.question->asked;
  record.request.question.reset();
  timers_.Set(i, step_.now);  // the next Service decides, unless the handler asks at once
  return true;
}

void Requests::SendNow(std::size_t bus, const HostMessage& message, NodeId node) {
  const CanFrame frame = Encode(message, {node, 0});
  step_.out->frames.push_back({units_.buses[bus].id, frame});
  units_.buses[bus].schedule.Charge(step_.now, FrameBits(frame));
  if (!std::holds_alternative<Stop>(message)) return;
  if (node == kBroadcastNode)
    units_.buses[bus].schedule.Hold(
        step_.now + BitTime(kStopAloneFrames * LongestFrameBits(rates_), config_.bit_rate_bps));
  for (const PositionerIndex i : units_.buses[bus].units) {
    if (node != kBroadcastNode && node != units_.layout.unit(i).node) continue;
    units_[i].request.reported_to_stop = step_.now;
    units_[i].motion.runs_freely = false;
  }
}

bool Requests::MayAnswerOurStop(PositionerIndex i, std::uint8_t sequence) const {
  const UnitRecord& record = units_[i];
  if (sequence != 0) return std::ranges::count(record.request.stop_sequences, sequence) > 0;
  return record.request.reported_to_stop.ns != INT64_MIN &&
         step_.now - record.request.reported_to_stop < config_.silence_limit;
}

void Requests::SetDeadline(PositionerIndex i) {
  if (!units_[i].request.question) return;
  Question& question = *units_[i].request.question;
  question.asked = std::min(question.asked, step_.now);
  // Each repeat waits twice as long as the one before. A host that was held up for a moment must
  // not take the silence for its units'.
  const std::int64_t patience = std::int64_t{1} << question.tries;
  question.deadline = std::min(step_.now + config_.transmit_horizon + config_.reply_wait * patience,
                               std::max(question.suspect_at, step_.now + config_.transmit_horizon));
  timers_.Set(i, question.deadline);
}

void Requests::Release() {
  for (std::size_t b = 0; b < units_.buses.size(); ++b) {
    BusRecord& bus = units_.buses[b];
    if (step_.now >= bus.clock_due) {
      const auto host_us =
          static_cast<std::uint64_t>(step_.now.ns / 1000) & ((std::uint64_t{1} << 48) - 1);
      if (bus.view.link == LinkState::kUp || bus.view.link == LinkState::kPassive)
        SendNow(b, Clock{host_us}, kBroadcastNode);
      bus.clock_due = step_.now + config_.clock_period;
    }
    asked_.clear();
    bus.schedule.Release(step_.now, config_.transmit_horizon, bus.id, &step_.out->frames, &asked_);
    for (const PositionerIndex i : asked_) SetDeadline(i);
    step_.out->wake_at = std::min(
        {step_.out->wake_at, bus.clock_due, bus.schedule.ReadyAt(config_.transmit_horizon)});
  }
}

}  // namespace focalfleet
