#include "fleet/coordinate/core.h"

#include <algorithm>

#include "protocol/base/check.h"
#include "protocol/base/limits.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet {
namespace {

// What an answer of eight bytes takes on average; the schedule only needs it to be fair.
constexpr std::uint32_t kAnswerBits = 145;
constexpr DurationNs kQueueFullWait = Milliseconds(20);
// 255 is left to those who stop the units past the coordinator (daemon/cli/direct_stop.cc).
constexpr std::uint8_t kLastSequence = 254;
/// Bus time that a stop of all has to itself: the frame on the wire, one that must be sent again,
/// and the stop.
constexpr std::uint32_t kStopAloneFrames = 4;

MoveId MoveAfter(MoveId move, std::uint32_t count) {
  constexpr std::uint32_t kIds = 65'535;  // 0 is none
  return {static_cast<std::uint16_t>((move.value + count - 1) % kIds + 1)};
}

Function AnswerFunction(const CanFrame& question) {
  const auto function = static_cast<Function>(question.id >> 20 & 63);
  return function == Function::kStop ? Function::kDone : function;
}

}  // namespace

Core::Core(const Layout* layout_in, std::vector<UnitDrive> drives_in,
           const CoordinatorConfig& config_in, StoredFleet stored)
    : layout(*layout_in),
      config(config_in),
      rates{config_in.bit_rate_bps, config_in.data_bit_rate_bps},
      drives(std::move(drives_in)),
      units(layout_in->size()),
      earlier_configurations(std::move(stored.configurations)),
      next_configuration(stored.next_configuration),
      next_alarm(stored.next_alarm),
      next_exposure(stored.next_exposure),
      next_move_(stored.next_move),
      is_changed_(layout_in->size(), 0) {
  FOCALFLEET_CHECK(drives.size() == units.size());
  for (const BusId id : layout.buses())
    buses.push_back({.id = id, .schedule = BusSchedule(rates), .view = {}, .units = {}});
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    const Unit& unit = layout.units()[n];
    units[n].view.enabled = unit.enabled;
    if (!unit.enabled) units[n].view.disabled_reason = "disabled in the units file";
    BusRecord* bus = FindBus(unit.bus);
    units[n].bus = static_cast<std::size_t>(bus - buses.data());
    bus->units.push_back({n});
    SetDue({n}, {INT64_MIN});
  }
  for (const auto& row : stored.units) {
    const auto i = layout.Find(row.unit);
    if (!i) continue;  // a place that the present layout does not have keeps its rows
    UnitView& view = unit(*i).view;
    view.bound_serial = row.serial;
    if (row.serial.value != 0) place_of[row.serial] = *i;
    if (!row.enabled) {
      view.enabled = false;
      view.disabled_reason = row.reason;
    }
  }
  for (const auto& row : stored.vectors) stored_vectors[row.serial] = row;
  for (const auto& row : stored.open_intents) intents[row.serial] = row;
  for (const auto& row : stored.parameters) {
    const auto place = place_of.find(row.serial);
    if (place == place_of.end()) continue;
    TakeParameter(row, &drives[place->second.value]);
  }
}

std::string Core::NameOf(PositionerIndex i) const {
  return "unit " + std::to_string(layout.unit(i).id.value);
}

std::string Core::TroubleOf(PositionerIndex i) const {
  const UnitView& view = units[i.value].view;
  const std::string id = std::to_string(layout.unit(i).id.value);
  switch (view.phase) {
    case UnitPhase::kFault:
      if (!units[i.value].not_kept.empty())
        return "is not moved, for the store refuses its rows (" + units[i.value].not_kept +
               "): `focalfleet enable " + id + "` tries again";
      if (!units[i.value].unfit.empty() && view.reported_state != UnitState::kFault)
        return "is not fit to move: " + units[i.value].unfit;
      return "is in fault" +
             (view.fault == FaultCode::kNone ? "" : " (" + std::string(Name(view.fault)) + ")") +
             ": `focalfleet enable " + id + "` clears it";
    case UnitPhase::kForeign:
      return "has another serial number than the one that belongs there, " + WhoseSerial(i) +
             ": `focalfleet adopt " + id + "` accepts it";
    case UnitPhase::kSilent:
    case UnitPhase::kAbsent:
      if (units[i.value].other_version)
        return "speaks protocol version " + std::to_string(*units[i.value].other_version) +
               ", not " + std::to_string(kProtocolVersion) + " or " +
               std::to_string(kProtocolVersionWithSensors);
      if (units[i.value].no_serial)
        return "answers with serial number 0: its memory is lost, or it was never programmed";
      return view.phase == UnitPhase::kAbsent ? "has never answered" : "does not answer any more";
    case UnitPhase::kIdentifying:
      return "is still being read";
    case UnitPhase::kMoving:
    case UnitPhase::kHoming:
    case UnitPhase::kSettling:
      return "still moves";
    case UnitPhase::kStaging:
    case UnitPhase::kConfirming:
    case UnitPhase::kArming:
    case UnitPhase::kArmed:
      return "takes part in a configuration now";
    case UnitPhase::kReady:
      break;
  }
  return "is ready";
}

std::string Core::WhyNoPlace(PositionerIndex i) const {
  const bool interval = units[i.value].view.knowledge[0].witness == Witness::kInterval;
  return std::string("is ") + (interval ? "known only within an interval" : "not known") +
         ": `focalfleet home " + std::to_string(layout.unit(i).id.value) +
         "`, or `focalfleet measure` with a camera";
}

std::string Core::WhoseSerial(PositionerIndex i) const {
  const auto place = place_of.find(units[i.value].view.serial);
  return place == place_of.end() ? "which belongs to no unit"
                                 : "which belongs to " + NameOf(place->second);
}

BusRecord* Core::FindBus(BusId id) {
  const auto it = std::lower_bound(buses.begin(), buses.end(), id,
                                   [](const BusRecord& bus, BusId want) { return bus.id < want; });
  return it != buses.end() && it->id == id ? &*it : nullptr;
}

void Core::SetPhase(PositionerIndex i, UnitPhase phase) {
  UnitView& view = unit(i).view;
  FOCALFLEET_CHECK(IsAllowed(view.phase, phase));
  view.phase = phase;
  if (phase == UnitPhase::kMoving || phase == UnitPhase::kHoming) unit(i).runs_freely = true;
  Changed(i);
}

void Core::Changed(PositionerIndex i) {
  if (is_changed_[i.value] != 0) return;
  is_changed_[i.value] = 1;
  out->changed.push_back(i);
}

void Core::SetDue(PositionerIndex i, HostInstant at) {
  unit(i).due = at;
  if (at != kNever) timers_.push({at, i});
}

std::optional<PositionerIndex> Core::NextDue() {
  while (!timers_.empty() && timers_.top().at <= now) {
    const Timer timer = timers_.top();
    timers_.pop();
    if (unit(timer.unit).due != timer.at) continue;  // re-set since
    unit(timer.unit).due = kNever;
    return timer.unit;
  }
  return std::nullopt;
}

std::uint8_t Core::SequenceAfter(PositionerIndex i, int questions) const {
  const int last = units[i.value].sequence;  // 0: none was asked yet
  return static_cast<std::uint8_t>((last + questions - 1) % kLastSequence + 1);
}

void Core::Ask(PositionerIndex i, const HostMessage& message, std::uint32_t answer_bits) {
  UnitRecord& record = unit(i);
  DropQuestion(i);
  record.sequence = SequenceAfter(i, 1);
  if (std::holds_alternative<Stop>(message)) {
    std::shift_right(record.stop_sequences.begin(), record.stop_sequences.end(), 1);
    record.stop_sequences.front() = record.sequence;
    record.runs_freely = false;
  }
  const CanFrame frame = Encode(message, {layout.unit(i).node, record.sequence});
  record.question = Question{.message = message,
                             .answer_function = AnswerFunction(frame),
                             .sequence = record.sequence,
                             .answer_bits = answer_bits == 0 ? kAnswerBits : answer_bits};
  if (!bus_of(i).schedule.Enqueue({frame, record.question->answer_bits, i})) {
    record.question->deadline = now + kQueueFullWait;
    SetDue(i, record.question->deadline);
  } else {
    SetDue(i, kNever);
  }
}

bool Core::AskAgain(PositionerIndex i) {
  UnitRecord& record = unit(i);
  Question& question = *record.question;
  if (question.tries++ >= limits::kRequestRetries) return false;
  ++bus_of(i).view.retries;
  const CanFrame frame = Encode(question.message, {layout.unit(i).node, question.sequence});
  question.deadline = kNever;
  if (!bus_of(i).schedule.Enqueue({frame, question.answer_bits, i})) {
    question.deadline = now + kQueueFullWait;
    SetDue(i, question.deadline);
  }
  return true;
}

DurationNs Core::Patience() const {
  constexpr std::int64_t kWaits = (std::int64_t{1} << (limits::kRequestRetries + 1)) - 1;
  return config.reply_wait * kWaits + config.transmit_horizon * (limits::kRequestRetries + 1);
}

void Core::Forget(PositionerIndex i) {
  DropQuestion(i);
  bus_of(i).schedule.Drop(layout.unit(i).node);
}

void Core::DropQuestion(PositionerIndex i) {
  UnitRecord& record = unit(i);
  const bool writes =
      record.question && std::holds_alternative<ParameterWrite>(record.question->message);
  record.question.reset();
  if (!writes || record.write_request == 0) return;
  out->replies.push_back({std::exchange(record.write_request, 0),
                          true,
                          Error{ErrorCode::kUnavailable,
                                NameOf(i) + " did not answer: it may have taken the value or not"},
                          {}});
}

bool Core::Answers(PositionerIndex i, Function function, std::uint8_t sequence) {
  UnitRecord& record = unit(i);
  if (!record.question || record.question->answer_function != function ||
      record.question->sequence != sequence || record.question->asked == kNever)
    return false;
  record.answered_asked = record.question->asked;
  record.question.reset();
  SetDue(i, now);  // Service decides what comes next, unless the handler asks at once
  return true;
}

void Core::SendNow(std::size_t bus, const HostMessage& message, NodeId node) {
  const CanFrame frame = Encode(message, {node, 0});
  out->frames.push_back({buses[bus].id, frame});
  buses[bus].schedule.Charge(now, FrameBits(frame));
  if (!std::holds_alternative<Stop>(message)) return;
  if (node == kBroadcastNode)
    buses[bus].schedule.Hold(
        now + BitTime(kStopAloneFrames * LongestFrameBits(rates), config.bit_rate_bps));
  for (const PositionerIndex i : buses[bus].units) {
    if (node != kBroadcastNode && node != layout.unit(i).node) continue;
    unit(i).reported_to_stop = now;
    unit(i).runs_freely = false;
  }
}

bool Core::MayAnswerOurStop(PositionerIndex i, std::uint8_t sequence) const {
  const UnitRecord& record = units[i.value];
  if (sequence != 0) return std::ranges::count(record.stop_sequences, sequence) > 0;
  return record.reported_to_stop.ns != INT64_MIN &&
         now - record.reported_to_stop < config.silence_limit;
}

MoveId Core::TakeMoveId() {
  const MoveId taken = next_move_;
  next_move_ = MoveAfter(taken, 1);
  if (--moves_left_ < limits::kMovesReserved / 2) ReserveMoves();
  return taken;
}

void Core::ReserveMoves() {
  moves_left_ = limits::kMovesReserved;
  Note(NextMoveRow{MoveAfter(next_move_, moves_left_)});
  if (reserved_by_ == 0) reserved_by_ = batch_now();
}

void Core::Raise(Severity severity, std::optional<PositionerIndex> who, std::optional<BusId> bus,
                 std::string text) {
  AlarmRow row{
      .id = next_alarm++, .severity = severity, .unit = {}, .bus = bus, .text = std::move(text)};
  if (who) row.unit = layout.unit(*who).id;
  Note(std::move(row));
}

void Core::Tell(PositionerIndex i, UnitEventKind kind, std::string reason) {
  events.push_back({i, kind, std::move(reason)});
}

void Core::ReplyWhenDurable(std::uint64_t request, std::string text) {
  kept_replies_.push_back({batch_now(), request, std::move(text)});
}

void Core::RefuseReplies(std::uint64_t first_batch, std::uint64_t last_batch,
                         const std::string& why) {
  for (KeptReply& kept : kept_replies_)
    if (kept.batch >= first_batch && kept.batch <= last_batch) kept.refused = why;
}

void Core::SayWhatIsDurable() {
  while (!kept_replies_.empty()) {
    KeptReply& kept = kept_replies_.front();
    if (!kept.refused.empty()) {
      out->replies.push_back(
          {kept.request,
           true,
           Error{ErrorCode::kUnavailable,
                 "effective now, NOT stored: the store refuses it (" + kept.refused + ")"},
           {}});
    } else if (committed_through >= kept.batch) {
      out->replies.push_back({kept.request, true, {}, std::move(kept.text)});
    } else if (store_failing) {
      out->replies.push_back(
          {kept.request,
           true,
           Error{ErrorCode::kUnavailable,
                 "effective now, NOT stored: the store cannot be written; it is tried again, but "
                 "lost if the daemon ends before that succeeds"},
           {}});
    } else {
      return;
    }
    kept_replies_.pop_front();
  }
}

Pose Core::PlaceAt(PositionerIndex i, const Pose& count) const {
  const Pose& offset = units[i.value].view.offset;
  return {count[0] + offset[0], count[1] + offset[1]};
}

std::array<VectorRange, kAxisCount> Core::RangesOf(PositionerIndex i) const {
  std::array<VectorRange, kAxisCount> ranges;
  for (const Axis axis : kAxes) {
    const VectorRange counts =
        RangeOf(layout.unit(i).axis[Index(axis)], drives[i.value].axis[Index(axis)]);
    const std::int32_t offset = units[i.value].view.offset[Index(axis)];
    ranges[Index(axis)] = {counts.low + offset, counts.high + offset};
  }
  return ranges;
}

Pose Core::NearestInReach(PositionerIndex i, const Pose& pose) const {
  const std::array<VectorRange, kAxisCount> ranges = RangesOf(i);
  const std::size_t theta = Index(Axis::kTheta);
  const std::int32_t turn =
      NearestVectors(360, layout.unit(i).axis[theta], drives[i.value].axis[theta]);
  Pose nearest = pose;
  for (const std::int32_t other : {pose[theta] - turn, pose[theta] + turn})
    if (!ranges[theta].contains(nearest[theta]) && ranges[theta].contains(other))
      nearest[theta] = other;
  for (const Axis axis : kAxes) {
    const auto& [low, high] = ranges[Index(axis)];
    nearest[Index(axis)] = std::clamp(nearest[Index(axis)], low, high);
  }
  return nearest;
}

void Core::See(PositionerIndex i, const Pose& place, MeasurementSource source) {
  UnitView& view = unit(i).view;
  const Pose believed = PlaceOf(view.knowledge);
  for (const Axis axis : kAxes)
    view.offset[Index(axis)] += place[Index(axis)] - believed[Index(axis)];
  Know(i, Exactly(Witness::kMeasured, place),
       source == MeasurementSource::kCamera ? Origin::kCamera : Origin::kSensors);
}

void Core::Expect(PositionerIndex i, const Pose& offset) {
  UnitView& view = unit(i).view;
  Pose place = PlaceOf(view.knowledge);
  for (const Axis axis : kAxes)
    place[Index(axis)] += offset[Index(axis)] - view.offset[Index(axis)];
  view.offset = offset;
  Know(i, Exactly(Witness::kReported, place), Origin::kCampaign);
}

void Core::Know(PositionerIndex i, const UnitKnowledge& knowledge, Origin origin) {
  UnitRecord& record = unit(i);
  record.view.knowledge = knowledge;
  Changed(i);
  VectorRow row{
      .serial = record.view.serial,
      .knowledge = knowledge,
      .offset = record.view.offset,
      .subdivision = {drives[i.value].axis[0].subdivision, drives[i.value].axis[1].subdivision},
      .move = record.view.move,
      .origin = origin};
  stored_vectors[row.serial] = row;
  Note(std::move(row));
}

void Core::EndIntent(PositionerIndex i, IntentEnd end) {
  const auto it = intents.find(unit(i).view.serial);
  if (it == intents.end()) return;
  Note(IntentEndRow{it->second.serial, it->second.move, end});
  intents.erase(it);
}

void Core::BeginStep(const Inputs& inputs, Effects* effects) {
  out = effects;
  now = inputs.now;
  committed_through = inputs.committed_through;
  store_failing = inputs.store_failing;
  std::fill(is_changed_.begin(), is_changed_.end(), std::uint8_t{0});
  if (reserved_by_ == 0) ReserveMoves();
}

void Core::Count(BusRecord* bus, std::span<const CanFrame> frames) {
  const OnWire passed = NextOnWire(frames, rates);
  bus->view.bits += passed.bits;
  bus->window_bits += passed.bits;
  if (IsOfUpload(frames.front())) bus->view.upload.bits += passed.bits;
}

void Core::CountSent() {
  std::array<CanFrame, kGroupEntriesMax> together;
  const std::vector<OutFrame>& sent = out->frames;
  for (std::size_t i = 0; i < sent.size();) {
    BusRecord* bus = FindBus(sent[i].bus);
    std::size_t count = 0;
    do {
      together[count] = sent[i + count].frame;
      ++count;
    } while (rates.data_bps > 0 && count < together.size() && i + count < sent.size() &&
             sent[i + count].bus == bus->id);
    const std::span<const CanFrame> front(together.data(), count);
    const std::size_t passed = NextOnWire(front, rates).frames;
    Count(bus, front.first(passed));
    bus->view.frames_sent += passed;
    if (IsOfUpload(front[0])) bus->upload_began = std::min(bus->upload_began, now);
    i += passed;
  }
}

void Core::CloseLoadWindow(BusRecord* bus) const {
  const HostInstant until = std::max(now, heard_until);
  if (bus->window_began == kNever) bus->window_began = until;
  const DurationNs window = until - bus->window_began;
  if (window < Milliseconds(1000)) return;
  bus->view.load = static_cast<double>(bus->window_bits) /
                   (window.seconds() * static_cast<double>(config.bit_rate_bps));
  bus->view.load_max = std::max(bus->view.load_max, bus->view.load);
  bus->window_began = until;
  bus->window_bits = 0;
}

void Core::EndStep() {
  SayWhatIsDurable();
  for (BusRecord& bus : buses) {
    if (now >= bus.clock_due) {
      const auto host_us =
          static_cast<std::uint64_t>(now.ns / 1000) & ((std::uint64_t{1} << 48) - 1);
      if (bus.view.link == LinkState::kUp || bus.view.link == LinkState::kPassive)
        SendNow(static_cast<std::size_t>(&bus - buses.data()), Clock{host_us}, kBroadcastNode);
      bus.clock_due = now + config.clock_period;
    }
    asked_.clear();
    bus.schedule.Release(now, config.transmit_horizon, bus.id, &out->frames, &asked_);
    for (const PositionerIndex i : asked_) {
      if (!unit(i).question) continue;
      Question& question = *unit(i).question;
      question.asked = std::min(question.asked, now);
      // Each repeat waits twice as long as the one before: a host that was held up for a moment
      // must not take the silence for its units'.
      const std::int64_t patience = std::int64_t{1} << question.tries;
      question.deadline = std::min(now + config.transmit_horizon + config.reply_wait * patience,
                                   std::max(question.suspect_at, now + config.transmit_horizon));
      SetDue(i, question.deadline);
    }
    out->wake_at =
        std::min({out->wake_at, bus.clock_due, bus.schedule.ReadyAt(config.transmit_horizon)});
    CloseLoadWindow(&bus);
  }
  CountSent();
  if (!timers_.empty()) out->wake_at = std::min(out->wake_at, timers_.top().at);
  if (!out->rows.empty()) out->batch = next_batch++;
}

}  // namespace focalfleet
