#include "daemon/soak/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <variant>

#include "daemon/soak/true_arms.h"
#include "daemon/soak/virtual_time.h"

namespace focalfleet::soak {
namespace {

constexpr std::size_t kBrokenMax = 20;
/// A rotor lags behind its field by less than this at rest. Units: vectors.
constexpr double kLagVectors = 24;
/// The same where a camera found the unit. A fibre that is seen 10 um off, five times the camera's
/// noise, puts an arm of 8.25 mm 4 degrees off where the arm is stretched, and 1.7 degrees at 5
/// degrees from that.
constexpr double kSeenVectors = 400;
constexpr double kSeenStretchedVectors = 950;
constexpr double kStretchedDeg = 5;
/// From the fibre of a measured place to where it is: as much, and the lag of both rotors at the
/// reach of 16.5 mm.
constexpr double kSeen_mm = 0.04;
/// After each power cut a rotor settles where its field is applied anew, within half a turn of it.
/// A rotor at its stop is ahead of or behind a field that turns on by as much, and the daemon takes
/// the way of an open move for so much wider.
constexpr double kJumpVectors = 60;
/// A fault that kept a stop from a unit may lead to contact so long after it.
constexpr DurationNs kContactAfter = Seconds(60);
constexpr std::size_t kReportedMax = 64;
/// A start signal of so long ago makes no unit begin any more.
constexpr DurationNs kMoveStale = Seconds(600);
/// The program sizes its queues for the upload of a whole bus: for each unit the begin of a move,
/// and the usual 8 segments of both axes. A stop and a start may come to that.
constexpr std::size_t kFramesOfUnit = 1 + 2 * 8 + 2;
/// A disk fails for 15 s at a time, in which each unit begins and ends few moves.
constexpr std::size_t kBatchesOfUnit = 20;
constexpr std::size_t kBatchesAnyway = 200;
/// A row may be so much older than its commit, where the disk fails or the host stands still: seed
/// 207162 has a report of 32 s before.
constexpr DurationNs kRowHeld = Seconds(60);

std::size_t BusOf(const Plant& plant, std::size_t row) {
  const auto buses = plant.layout().buses();
  const auto at = std::lower_bound(buses.begin(), buses.end(), plant.layout().units()[row].bus);
  return static_cast<std::size_t>(at - buses.begin());
}

}  // namespace

Judge::Judge(const Plant* plant, const MemoryDisk* disk, const Troubles* troubles,
             const Draws& draws, Extent survives)
    : plant_(plant),
      troubles_(troubles),
      store_(disk, survives, Tells()),
      seen_(plant->layout().size()),
      stops_(plant, troubles, Tells()),
      motion_(plant, troubles, draws.rail_motors * MotorAsMeasured_W(), Tells()),
      blame_(plant, troubles, Tells()),
      host_alone_(draws.host_alone),
      frames_most_(plant->layout().buses().size()) {
  const auto units = plant->layout().units();
  near_.resize(units.size());
  for (std::size_t row = 0; row < units.size(); ++row)
    frames_most_[BusOf(*plant, row)] += kFramesOfUnit;
  for (std::size_t i = 0; i < units.size(); ++i)
    for (std::size_t j = i + 1; j < units.size(); ++j) {
      const double apart = std::hypot(units[i].base_fp.x_mm - units[j].base_fp.x_mm,
                                      units[i].base_fp.y_mm - units[j].base_fp.y_mm);
      if (apart < units[i].reach_mm() + units[j].reach_mm()) near_[i].push_back(j);
    }
}

StoreJudge::Broken Judge::Tells() {
  return [this](const std::string& rule, const std::string& what) { Broken(rule, what); };
}

void Judge::Broken(const std::string& rule, const std::string& what) {
  if (broken_.size() < kBrokenMax)
    broken_.push_back(
        fmt::format("{:.3f} s: {}: {}", 1e-9 * static_cast<double>(now_.ns), rule, what));
}

void Judge::LifeHasBegun() {
  store_.LifeHasBegun();
  reported_.clear();
  // A commit may be durable that the life before did not live to hear of.
  for (const auto& [serial, place] : store_.acknowledged().places) {
    reported_[serial].push_back(place);
    NoteSeen(serial, place);
  }
}

void Judge::Committed(std::span<const Row> rows, bool done) {
  if (done) NoteBlind(rows);
  store_.Committed(rows, done);
  if (!done) return;
  blame_.Committed(rows, HostInstant{ReadVirtualNs()});
  for (const Row& row : rows)
    if (const auto* vector = std::get_if<VectorRow>(&row)) {
      const HostInstant at{ReadVirtualNs()};
      Stored& stored =
          stored_.try_emplace(vector->serial.value, Stored{at, at, kLagVectors}).first->second;
      stored.last = at;
      // A hard stop or a camera is another witness than the unit's counts.
      if (vector->origin == Origin::kHoming || vector->knowledge[0].witness == Witness::kMeasured)
        stored.first = Troubles::kLongAgo;
      NoteSeen(vector->serial.value, PlaceOf(*vector));
      auto& places = reported_[vector->serial.value];
      places.push_back(PlaceOf(*vector));
      if (places.size() > kReportedMax) places.pop_front();
    }
}

/// The row of an intent stands before the row by which the store forgets the place.
void Judge::NoteBlind(std::span<const Row> rows) {
  std::map<std::uint32_t, StoredPlace> places;
  for (const Row& row : rows) {
    if (const auto* vector = std::get_if<VectorRow>(&row))
      places[vector->serial.value] = PlaceOf(*vector);
    const auto* intent = std::get_if<IntentRow>(&row);
    if (intent == nullptr) continue;
    const std::uint32_t serial = intent->serial.value;
    if (!places.contains(serial) && acknowledged().places.contains(serial))
      places[serial] = acknowledged().places.at(serial);
    const bool exact = places.contains(serial) && IsExact(places[serial]);
    if (!exact) blind_.insert({intent->unit.value, intent->move.value});
  }
}

void Judge::Sends(BusId bus, const CanFrame& frame) {
  motion_.Sends(bus, frame, HostInstant{ReadVirtualNs()});
  constexpr std::uint32_t kStart = 1, kHome = 8;
  const std::uint32_t function = frame.id >> 20 & 0x1f;
  if (function != kStart && function != kHome) return;
  const StoredPicture* durable = store_.Durable();
  if (durable == nullptr) return;
  const HostInstant now{ReadVirtualNs()};
  for (const auto& [serial, intent] : durable->intents)
    allowed_.insert_or_assign({intent.unit, intent.move}, now);
}

void Judge::Published(const StatusBatch& status) {
  for (const UnitStatusValue& value : status.units) {
    const auto row = plant_->layout().Find(value.unit);
    if (!row || value.serial.value == 0) continue;
    const Unit& unit = plant_->layout().unit(*row);
    const UnitDrive& drive = plant_->drives()[row->value];
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const int witness = static_cast<int>(value.witness[axis]);
      if (witness < 3) continue;  // reported as not exact
      const double step = DegreesPerVector(unit.axis[axis], drive.axis[axis]);
      const auto vectors = std::llround(value.low_deg[axis] / step);
      const auto known = reported_.find(value.serial.value);
      const bool stored = known != reported_.end() &&
                          std::ranges::any_of(known->second, [&](const StoredPlace& place) {
                            return place[axis].witness >= 3 && place[axis].low == vectors;
                          });
      if (stored) continue;
      const bool last = known != reported_.end() && !known->second.empty();
      const StoredAxis newest = last ? known->second.back()[axis] : StoredAxis{};
      Broken("reported", fmt::format("unit {} axis {} is reported to be {} at {}, which was never "
                                     "acknowledged; stored is witness {} at {}..{}",
                                     value.unit.value, axis, Name(value.witness[axis]), vectors,
                                     newest.witness, newest.low, newest.high));
    }
  }
}

void Judge::Queues(std::size_t batches, std::span<const ShellFacts::Bus> buses) {
  const std::size_t batches_most = kBatchesAnyway + kBatchesOfUnit * plant_->layout().size();
  if (batches > batches_most) Broken("bound", fmt::format("{} batches wait", batches));
  for (std::size_t bus = 0; bus < buses.size(); ++bus)
    if (buses[bus].waiting > frames_most_[bus])
      Broken("bound", fmt::format("{} frames wait on {}, at most {} may", buses[bus].waiting,
                                  buses[bus].port, frames_most_[bus]));
}

void Judge::Look(HostInstant now) {
  now_ = now;
  std::vector<sim::UnitTruth> truths;
  truths.reserve(seen_.size());
  for (std::size_t row = 0; row < seen_.size(); ++row) {
    truths.push_back(plant_->world().Truth(row));
    LookAtStarts(row, truths.back());
    LookAtPlace(row, truths.back());
    stops_.Look(now, row, truths.back());
  }
  if (now > forget_at_) {
    forget_at_ = now + kMoveStale;
    std::erase_if(allowed_, [&](const auto& move) { return move.second < now - kMoveStale; });
    std::erase_if(blind_, [&](const Move& move) { return !allowed_.contains(move); });
  }
  motion_.Look(now, truths, near_);
  LookForContact(truths);
}

void Judge::LookAtStarts(std::size_t row, const sim::UnitTruth& truth) {
  Seen& seen = seen_[row];
  if (truth.begun_twice > seen.begun_twice)
    Broken("twice",
           fmt::format("unit {} began move {} twice", truth.id.value, truth.last_move.value));
  seen.begun_twice = truth.begun_twice;
  if (truth.moves_begun == seen.moves_begun) return;
  seen.moves_begun = truth.moves_begun;
  stops_.LookAtStart(row, truth);
  const auto allowed = allowed_.find({truth.id.value, truth.last_move.value});
  if (allowed == allowed_.end())
    Broken("start", fmt::format("unit {} began move {} without a durable intent", truth.id.value,
                                truth.last_move.value));
  else if (truth.state == UnitState::kMoving && blind_.contains(allowed->first))
    Broken("start", fmt::format("unit {} began move {} from a place that is not known",
                                truth.id.value, truth.last_move.value));
}

std::vector<std::uint32_t> Judge::TouchingUnits() const {
  std::set<std::uint32_t> units;
  for (const auto& [i, j] : touching_)
    for (const std::size_t row : {i, j}) units.insert(plant_->layout().units()[row].id.value);
  return {units.begin(), units.end()};
}

bool Judge::HasPlace(std::size_t row) const {
  const auto unit = acknowledged().units.find(plant_->layout().units()[row].id.value);
  if (unit == acknowledged().units.end()) return false;
  const auto place = acknowledged().places.find(unit->second.serial);
  return place != acknowledged().places.end() && IsExact(place->second);
}

bool Judge::IsItsOnlyWitness(std::size_t row) const {
  if (troubles_->counts_lost[row] == Troubles::kLongAgo) return false;
  const UnitId unit = plant_->layout().units()[row].id;
  const auto known = stored_.find(plant_->world().flash(unit).serial.value);
  return known == stored_.end() || troubles_->counts_lost[row] <= known->second.first;
}

void Judge::LookAtPlace(std::size_t row, const sim::UnitTruth& truth) {
  const auto unit = acknowledged().units.find(truth.id.value);
  if (unit == acknowledged().units.end()) return;
  const std::uint32_t serial = unit->second.serial;
  // Other hardware at this place has a place of its own; the store speaks of what was bound here.
  if (serial != plant_->world().flash(truth.id).serial.value) return;
  if (IsItsOnlyWitness(row)) return;
  const auto known = stored_.find(serial);
  const auto place = acknowledged().places.find(serial);
  const auto intent = acknowledged().intents.find(serial);
  const std::vector<HostInstant>& cuts = troubles_->jumps[row];
  const auto since = std::ranges::count_if(cuts, [&](HostInstant cut) {
    return known == stored_.end() || cut > known->second.last - kRowHeld;
  });
  double slack = known == stored_.end() ? kLagVectors : known->second.slack_vectors;
  const bool open = intent != acknowledged().intents.end();
  slack =
      std::max(slack, kJumpVectors * static_cast<double>(std::max<std::ptrdiff_t>(since, open)));
  if (!open && since == 0 && place != acknowledged().places.end())
    LookAtFibre(row, truth, place->second);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    double low = -1e18, high = 1e18;
    if (intent != acknowledged().intents.end()) {
      low = static_cast<double>(intent->second.low[axis]);
      high = static_cast<double>(intent->second.high[axis]);
    } else if (place != acknowledged().places.end() && place->second[axis].witness >= 1) {
      low = static_cast<double>(place->second[axis].low);
      high = static_cast<double>(place->second[axis].high);
    }
    const double off = std::max(low - truth.vectors[axis], truth.vectors[axis] - high);
    if (off <= slack) continue;
    Broken("place",
           fmt::format("unit {} axis {} is at {:.1f}, stored is {}{:.0f}..{:.0f}", truth.id.value,
                       axis, truth.vectors[axis],
                       intent != acknowledged().intents.end() ? "an open move within " : "", low,
                       high));
  }
}

/// The count of a unit keeps the error with which its place was measured last.
void Judge::NoteSeen(std::uint32_t serial, const StoredPlace& place) {
  constexpr int kMeasured = 4;
  const auto known = stored_.find(serial);
  const auto unit = std::ranges::find_if(
      acknowledged().units, [&](const auto& each) { return each.second.serial == serial; });
  if (place[1].witness != kMeasured || known == stored_.end() || unit == acknowledged().units.end())
    return;
  const auto row = plant_->layout().Find(UnitId{unit->first});
  if (!row) return;
  const Unit& arm = plant_->layout().unit(*row);
  const double phi_deg = arm.axis[1].zero_deg +
                         static_cast<double>(place[1].low) *
                             DegreesPerVector(arm.axis[1], plant_->drives()[row->value].axis[1]);
  known->second.slack_vectors =
      std::abs(phi_deg) < kStretchedDeg ? kSeenStretchedVectors : kSeenVectors;
}

/// A measured place is one of the fibre; the axes are worth less near the stretched arm.
void Judge::LookAtFibre(std::size_t row, const sim::UnitTruth& truth, const StoredPlace& place) {
  constexpr int kMeasured = 4;
  if (place[0].witness != kMeasured || place[1].witness != kMeasured) return;
  const Unit& unit = plant_->layout().units()[row];
  std::array<double, kAxisCount> stored_deg{};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    stored_deg[axis] = static_cast<double>(place[axis].low) *
                       DegreesPerVector(unit.axis[axis], plant_->drives()[row].axis[axis]);
  const double off_mm =
      std::abs(ArmOf(unit, stored_deg).fibre - ArmOf(unit, truth.angle_deg).fibre);
  if (off_mm > kSeen_mm)
    Broken("place", fmt::format("the fibre of unit {} is {:.3f} mm from its measured place",
                                truth.id.value, off_mm));
}

void Judge::LookForContact(std::span<const sim::UnitTruth> truths) {
  const auto units = plant_->layout().units();
  std::vector<TrueArm> arms;
  for (std::size_t row = 0; row < units.size(); ++row)
    arms.push_back(ArmOf(units[row], truths[row].angle_deg));
  for (std::size_t i = 0; i < units.size(); ++i)
    for (const std::size_t j : near_[i]) {
      const double apart = Between(arms[i], arms[j]);
      const bool touch = apart < units[i].arm_half_width_mm + units[j].arm_half_width_mm;
      if (!touch) {
        touching_.erase({i, j});
        continue;
      }
      if (!touching_.insert({i, j}).second) continue;
      const HostInstant since = now_ - kContactAfter;
      bool excused = risk_ || (!host_alone_ && troubles_->away > since);
      for (const std::size_t row : {i, j})
        excused = excused || troubles_->buses[BusOf(*plant_, row)] > since ||
                  troubles_->deaf[row] > since || IsItsOnlyWitness(row);
      if (!excused)
        Broken("contact", fmt::format("units {} and {} touch, {:.3f} mm apart", units[i].id.value,
                                      units[j].id.value, apart));
    }
}

}  // namespace focalfleet::soak
