#include "tests/can/bus_story.h"

namespace focalfleet::test {
namespace {

// A segment may arrive twice (a retry); its index gives its place.
struct Upload {
  StageBegin begin;
  std::array<std::map<std::uint8_t, Segment>, kAxisCount> segments;
};

class Listener {
 public:
  void Hear(const LoggedFrame& logged) {
    interface_ = &logged.interface;
    at_us_ = logged.at_us;
    ++story_.frames[logged.interface];
    const auto host = DecodeHost(logged.frame);
    if (host) {
      to_ = host->address;
      std::visit([this](const auto& m) { FromHost(m); }, host->message);
      return;
    }
    const auto unit = DecodeUnit(logged.frame);
    if (unit) {
      to_ = unit->address;
      std::visit([this](const auto& m) { FromUnit(m); }, unit->message);
      return;
    }
    const bool from_unit = host.error() == Malformed::kDirection;
    story_.malformed.push_back(logged.interface + " " + std::to_string(logged.frame.id) + ": " +
                               Name(from_unit ? unit.error() : host.error()));
  }

  BusStory Take() { return std::move(story_); }

 private:
  BusNode Here() const { return {*interface_, to_.node.value}; }
  OverheardUnit& Unit() { return story_.units[Here()]; }

  template <class Message>
  void FromHost(const Message&) {}
  void FromHost(const StageBegin& m) { uploads_[Here()] = {m, {}}; }
  void FromHost(const StageSegment& m) {
    Upload& upload = uploads_[Here()];
    upload.segments[Index(m.axis)][m.index] = m.segment;
  }
  void FromHost(const Confirm& m) {
    const Upload& upload = uploads_[Here()];
    if (upload.begin.move != m.move) return;
    StagedMove staged{.move = m.move, .mode = upload.begin.mode};
    for (const Axis axis : kAxes)
      for (const auto& [index, segment] : upload.segments[Index(axis)])
        if (!staged.path[Index(axis)].full()) staged.path[Index(axis)].Append(segment);
    Unit().moves[m.move.value].staged = staged;
  }
  void FromHost(const Start& m) {
    for (auto& [where, unit] : story_.units) {
      const auto move = unit.moves.find(m.move.value);
      if (where.first != *interface_ || move == unit.moves.end() || !move->second.armed) continue;
      if (move->second.done) continue;  // a repeated start; this motion is over
      if (move->second.started_us.empty()) unit.began_at[m.move.value] = unit.at;
      move->second.started_us.push_back(at_us_);
    }
  }

  template <class Message>
  void FromUnit(const Message&) {}
  void FromUnit(const IdentifyReply& m) { Unit().serial = m.serial; }
  void FromUnit(const VectorReply& m) {
    Unit().at[Index(m.axis)] = m.turns * m.subdivision + m.vector;
  }
  void FromUnit(const ConfirmReply& m) {
    OverheardMove& move = Unit().moves[m.move.value];
    move.confirmed = m.answer;
    move.confirmed_digest = m.digest;
  }
  void FromUnit(const ArmReply& m) {
    if (m.answer == Answer::kOk) Unit().moves[m.move.value].armed = true;
  }
  void FromUnit(const Done& m) {
    OverheardUnit& unit = Unit();
    if (const auto move = unit.moves.find(m.move.value); move != unit.moves.end())
      move->second.done = m;
    for (const Axis axis : kAxes) unit.at[Index(axis)] = m.position[Index(axis)];
  }

  const std::string* interface_ = nullptr;
  std::int64_t at_us_ = 0;
  Address to_{};
  std::map<BusNode, Upload> uploads_;
  BusStory story_;
};

}  // namespace

std::array<std::int32_t, kAxisCount> OverheardMove::Way() const {
  std::array<std::int32_t, kAxisCount> way{};
  for (const Axis axis : kAxes)
    for (const Segment& segment : staged.path[Index(axis)].segments())
      way[Index(axis)] += segment.delta;
  return way;
}

BusStory Listen(const CandumpLog& log) {
  Listener listener;
  for (const LoggedFrame& logged : log.frames) listener.Hear(logged);
  return listener.Take();
}

}  // namespace focalfleet::test
