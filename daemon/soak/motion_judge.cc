#include "daemon/soak/motion_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/soak/true_arms.h"
#include "sim/drive/motor/motor_parameters.h"
#include "sim/drive/steady.h"

namespace focalfleet::soak {
namespace {

/// Start signals of a move are whole ticks of 0.1 ms, and are shortened by what they waited.
constexpr DurationNs kNamedApart = Milliseconds(1);
/// A number of a move is used again after 65,535 others.
constexpr DurationNs kNumberLasts = Seconds(60);
/// From the end of a unit by itself to the stop of those that would run into it: the notice of 1 s,
/// the stop on its way, and two looks.
constexpr DurationNs kFollowersStopWithin = Milliseconds(1300);
/// A clock may run so much faster than the host's.
constexpr double kQuickClock = 0.006;
constexpr double kEndsEarly_s = 0.3;
/// The time after a fault of bus or host in which its effects go on.
constexpr DurationNs kAfterFault = Seconds(5);
/// Moves are over so long after they began.
constexpr DurationNs kMoveLasts = Seconds(90);
/// The two derivations of a motor's power agree within 2 %.
constexpr double kPowerLess = 0.97;

std::uint32_t Word(const CanFrame& frame, std::size_t at, std::size_t bytes) {
  std::uint32_t word = 0;
  for (std::size_t k = 0; k < bytes; ++k) word |= std::uint32_t{frame.data[at + k]} << 8 * k;
  return word;
}

double SecondsOf(DurationNs time) { return 1e-9 * static_cast<double>(time.ns); }

}  // namespace

double MotorAsMeasured_W() {
  static const double power_W = [] {
    sim::Drive::Setting setting;
    setting.motor = sim::kParameterSets[0].motor;
    setting.motor.load_variation = 0;
    setting.bridge = {.v_bus_V = 1.8, .rise_s = 10e-9, .fall_s = 10e-9, .dead_time_s = 50e-9};
    const sim::Modulation modulation;
    const auto state = sim::FindSteadyState(setting, modulation, setting.motor.load_Nm);
    return state ? sim::MeasureSteadyWave(setting, modulation, *state).power.supply_W : 0.0;
  }();
  return power_W;
}

MotionJudge::MotionJudge(const Plant* plant, const Troubles* troubles, double rail_limit_W,
                         Broken broken)
    : plant_(plant),
      troubles_(troubles),
      rail_limit_W_(rail_limit_W),
      broken_(std::move(broken)),
      staged_(plant->layout().size()),
      courses_(plant->layout().size()),
      moves_begun_(plant->layout().size()),
      vectors_(plant->layout().size()) {
  const auto units = plant->layout().units();
  for (std::size_t row = 0; row < units.size(); ++row)
    rows_[{units[row].bus.value, units[row].node.value}] = row;
}

std::size_t MotionJudge::BusOf(std::size_t row) const {
  const auto buses = plant_->layout().buses();
  const auto at = std::lower_bound(buses.begin(), buses.end(), plant_->layout().units()[row].bus);
  return static_cast<std::size_t>(at - buses.begin());
}

bool MotionJudge::IsExcused(std::size_t row, HostInstant since) const {
  return troubles_->host > since || troubles_->buses[BusOf(row)] > since ||
         troubles_->deaf[row] > since;
}

void MotionJudge::Sends(BusId bus, const CanFrame& frame, HostInstant now) {
  constexpr std::uint32_t kStart = 1, kStageBegin = 5, kStageSegment = 6;
  constexpr double kTick_s = 1e-4, kTimer_Hz = 144e6;
  const std::uint32_t function = frame.id >> 20 & 0x3f;
  if (function == kStart) return SendsStart(bus, frame, now);
  if (function != kStageBegin && function != kStageSegment) return;
  const auto found = rows_.find({bus.value, frame.id >> 11 & 0xff});
  if (found == rows_.end()) return;
  Staged& staged = staged_[found->second];
  if (function == kStageBegin) {
    staged = {.move = Word(frame, 0, 2), .way = {}};
    for (std::size_t axis = 0; axis < 2; ++axis) staged.way[axis].resize(frame.data[2 + axis]);
    return;
  }
  const std::size_t axis = frame.id & 7;
  const std::size_t index = frame.data[0];
  if (axis > 1 || index >= staged.way[axis].size()) return;
  std::int32_t delta = static_cast<std::int32_t>(Word(frame, 4, 3));
  if (delta >= 1 << 23) delta -= 1 << 24;
  const double counter1 = plant_->drives()[found->second].axis[axis].counter1;
  staged.way[axis][index] = {Word(frame, 1, 3) * kTick_s, static_cast<double>(delta),
                             std::abs(delta) * (frame.data[7] * counter1 / kTimer_Hz)};
}

void MotionJudge::SendsStart(BusId bus, const CanFrame& frame, HostInstant now) {
  const std::uint32_t move = Word(frame, 0, 2);
  const HostInstant named = now + DurationNs{std::int64_t{Word(frame, 2, 3)} * 100'000};
  const auto [first, fresh] = begins_at_.try_emplace(move, named, now + kNumberLasts);
  if (!fresh && first->second.second < now) first->second = {named, now + kNumberLasts};
  const DurationNs apart = named - first->second.first;
  if (std::abs(apart.ns) > kNamedApart.ns)
    broken_("start", fmt::format("a start signal of move {} on bus {} names an instant {:.1f} ms "
                                 "off the first one",
                                 move, bus.value, 1e-6 * static_cast<double>(apart.ns)));
}

/// Notes begins of moves and ends before their time.
void MotionJudge::Follow(HostInstant now, std::size_t row, const sim::UnitTruth& truth) {
  Course& course = courses_[row];
  const bool moves = truth.powered && truth.state == UnitState::kMoving;
  if (truth.moves_begun != moves_begun_[row]) {
    moves_begun_[row] = truth.moves_begun;
    const bool staged = staged_[row].move == truth.last_move.value && truth.began != kNever;
    course = {.staged = staged_[row], .began = truth.began, .over = !staged};
  }
  if (course.over || course.halted != kNever || moves) return;
  double end_s = 0;
  for (const auto& axis : course.staged.way)
    for (const Segment& segment : axis) end_s = std::max(end_s, segment.start_s + segment.lasts_s);
  if (SecondsOf(now - course.began) < end_s * (1 - kQuickClock) - kEndsEarly_s)
    course.halted = now;
  else
    course.over = true;
}

/// The time from now on until the follower, going on as it does, touches the first unit where that
/// stands. None: never.
std::optional<double> MotionJudge::MeetsIn(HostInstant now, std::size_t follower, std::size_t first,
                                           std::span<const sim::UnitTruth> truths) const {
  constexpr double kStep_s = 0.05;
  const auto units = plant_->layout().units();
  const Course& course = courses_[follower];
  const double apart_mm = units[follower].arm_half_width_mm + units[first].arm_half_width_mm;
  const TrueArm stands = ArmOf(units[first], truths[first].angle_deg);
  const auto at = [&](std::size_t axis, double time_s) {
    double vectors = 0;
    for (const Segment& segment : course.staged.way[axis])
      if (segment.lasts_s > 0)
        vectors +=
            segment.delta * std::clamp((time_s - segment.start_s) / segment.lasts_s, 0.0, 1.0);
    return vectors;
  };
  double end_s = 0;
  for (const auto& axis : course.staged.way)
    for (const Segment& segment : axis) end_s = std::max(end_s, segment.start_s + segment.lasts_s);
  const double begun_s = SecondsOf(now - course.began);
  for (double ahead_s = 0; begun_s + ahead_s <= end_s + kStep_s; ahead_s += kStep_s) {
    std::array<double, kAxisCount> angle_deg = truths[follower].angle_deg;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      angle_deg[axis] +=
          (at(axis, begun_s + ahead_s) - at(axis, begun_s)) * 360 /
          (plant_->drives()[follower].axis[axis].subdivision * units[follower].axis[axis].gear);
    if (Between(ArmOf(units[follower], angle_deg), stands) < apart_mm) return ahead_s;
  }
  return std::nullopt;
}

void MotionJudge::LookAtFollowers(HostInstant now, std::span<const sim::UnitTruth> truths,
                                  std::span<const std::vector<std::size_t>> near) {
  const auto look = [&](std::size_t first, std::size_t follower) {
    const Course& halted = courses_[first];
    const Course& going = courses_[follower];
    // A follower that began later was planned with the first unit's next move, and that unit's not
    // beginning it is noticed as late as an end.
    if (halted.over || halted.halted == kNever ||
        now < std::max(halted.halted, going.began) + kFollowersStopWithin)
      return;
    const bool goes = !going.over && going.halted == kNever && truths[follower].powered &&
                      truths[follower].state == UnitState::kMoving;
    if (!goes || IsExcused(follower, halted.halted - kAfterFault) ||
        IsExcused(first, halted.halted - kAfterFault))
      return;
    const auto meets_in = MeetsIn(now, follower, first, truths);
    if (!meets_in) return;
    broken_("followers",
            fmt::format("unit {} ended by itself {:.1f} s ago, and unit {} goes on to where it "
                        "stands, in {:.1f} s",
                        truths[first].id.value, SecondsOf(now - halted.halted),
                        truths[follower].id.value, *meets_in));
  };
  for (std::size_t i = 0; i < near.size(); ++i)
    for (const std::size_t j : near[i]) {
      look(i, j);
      look(j, i);
    }
}

/// The mean over the time since the last look, of motors that turn at their drives' own pace; a
/// slower motor counts for less than it draws. Homing and moves that begin later than their plan
/// are not the plan's.
void MotionJudge::LookAtPower(HostInstant now, std::span<const sim::UnitTruth> truths) {
  struct Rail {
    double power_W = 0;
    std::uint32_t move = 0;
    bool judged = true;
  };
  std::map<std::uint32_t, Rail> rails;
  const double since_s = SecondsOf(now - looked_);
  for (std::size_t row = 0; row < truths.size(); ++row) {
    const sim::UnitTruth& truth = truths[row];
    const std::array<double, kAxisCount> before = std::exchange(vectors_[row], truth.vectors);
    Rail& rail = rails[plant_->layout().units()[row].rail.value];
    if (IsExcused(row, now - kMoveLasts) || truth.state == UnitState::kHoming) rail.judged = false;
    if (!truth.powered || truth.state != UnitState::kMoving) continue;
    if (std::exchange(rail.move, truth.last_move.value) != truth.last_move.value &&
        rail.power_W > 0)
      rail.judged = false;  // two moves at a time
    const auto named = begins_at_.find(truth.last_move.value);
    if (named == begins_at_.end() ||
        std::abs((named->second.first - truth.began).ns) > Milliseconds(15).ns)
      rail.judged = false;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const AxisDrive& drive = plant_->drives()[row].axis[axis];
      const double vector_s = drive.repeat * (drive.counter1 / 144e6);
      const double share = std::abs(truth.vectors[axis] - before[axis]) * vector_s / since_s;
      rail.power_W += std::min(share, 1.0) * kPowerLess * MotorAsMeasured_W();
    }
  }
  for (const auto& [number, rail] : rails)
    if (rail.judged && rail.power_W > rail_limit_W_)
      broken_("power", fmt::format("rail {} gives {:.1f} mW, and a plan may take {:.1f} mW", number,
                                   1e3 * rail.power_W, 1e3 * rail_limit_W_));
}

void MotionJudge::Look(HostInstant now, std::span<const sim::UnitTruth> truths,
                       std::span<const std::vector<std::size_t>> near) {
  for (std::size_t row = 0; row < truths.size(); ++row) Follow(now, row, truths[row]);
  LookAtFollowers(now, truths, near);
  if (rail_limit_W_ > 0 && now > looked_) LookAtPower(now, truths);
  looked_ = now;
}

}  // namespace focalfleet::soak
