#include "sim/drive/start_study.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "protocol/base/check.h"
#include "protocol/base/units.h"
#include "sim/drive/steady.h"

namespace focalfleet::sim {
namespace {

constexpr double kRealResolution = 1e-3;  // of a critical n that is not whole
constexpr int kRepeatMax = 255;           // the most that a unit's timer table holds

// Both levels have the same interface.
class Reduced {
 public:
  Reduced(const Drive::Setting& setting, const Modulation& modulation)
      : drive_(setting, modulation) {}
  void Place(double angle_rad) { drive_.Place(angle_rad, 0); }
  void Run(std::int64_t first, const Stage& stage) {
    drive_.RunVectors(first, stage.vectors, stage.repeat);
  }
  [[nodiscard]] double angle_rad() const { return drive_.shaft().angle_rad(); }
  [[nodiscard]] double load_Nm() const { return drive_.shaft().LoadTorque(); }
  [[nodiscard]] double copper_J() const { return drive_.copper_J(); }
  [[nodiscard]] double t_s() const { return drive_.t_s(); }

 private:
  ReducedDrive drive_;
};

class Pwm {
 public:
  Pwm(const Drive::Setting& setting, const Modulation& modulation)
      : drive_(setting), modulation_(modulation), table_(VectorTable(modulation)) {}
  void Place(double angle_rad) { drive_.Place(angle_rad, 0); }
  void Run(std::int64_t first, const Stage& stage) {
    modulation_.repeat = stage.repeat;
    RunVectors(&drive_, modulation_, table_, first, stage.vectors);
  }
  [[nodiscard]] double angle_rad() const { return drive_.shaft().angle_rad(); }
  [[nodiscard]] double load_Nm() const { return drive_.shaft().LoadTorque(); }
  [[nodiscard]] double copper_J() const { return drive_.energy().copper_J; }
  [[nodiscard]] double t_s() const { return drive_.t_s(); }

 private:
  Drive drive_;
  Modulation modulation_;
  std::vector<Pattern> table_;
};

// The rotor rests behind `field` vectors as far as friction holds it. False: the load exceeds the
// torque that the field can give.
template <class Level>
bool Rest(Level* level, const Modulation& modulation, std::int64_t field, double stall_Nm,
          int direction) {
  const double angle = static_cast<double>(field) * kTurnRad / modulation.subdivision;
  level->Place(angle);
  const double share = level->load_Nm() / stall_Nm;
  if (share >= 1) return false;
  level->Place(angle - direction * std::asin(share));
  return true;
}

template <class Level>
void RunProfile(Level* level, std::int64_t field, const std::vector<Stage>& profile) {
  for (const Stage& stage : profile) {
    // The vector shown at rest is the one before the first of the move.
    level->Run(stage.vectors > 0 ? field + 1 : field - 1, stage);
    field += stage.vectors;
  }
}

template <class Level>
MoveCount TryMovesAt(Level level, double stall_Nm, const Drive::Setting& setting,
                     const Modulation& modulation, const StartRule& rule) {
  const auto vectors =
      std::llround(rule.move_deg / 360 * setting.gearhead.ratio * modulation.subdivision);
  MoveCount count;
  std::int64_t field = 0;
  for (const int direction : {1, -1})
    for (int k = 0; k < rule.moves_each_way; ++k) {
      ++count.moves;
      if (!Rest(&level, modulation, field, stall_Nm, direction)) continue;
      RunProfile(&level, field, MakeProfile(direction * vectors, modulation, rule.ramp));
      const std::int64_t end = field + direction * vectors;
      const double off =
          level.angle_rad() / kTurnRad - static_cast<double>(end) / modulation.subdivision;
      // Lost turns stay lost: the next move starts where the rotor is.
      const auto lost = std::llround(off);
      count.succeeded += lost == 0 ? 1 : 0;
      field = end + lost * modulation.subdivision;
      if (rule.on_move) rule.on_move();
    }
  count.copper_J = level.copper_J();
  count.time_s = level.t_s();
  return count;
}

template <class Level>
bool StartsAt(Level level, double stall_Nm, const Modulation& modulation, const StartTrial& trial) {
  if (!Rest(&level, modulation, 0, stall_Nm, 1)) return false;
  const std::int64_t vectors = static_cast<std::int64_t>(trial.turns) * modulation.subdivision;
  RunProfile(&level, 0, MakeProfile(vectors, modulation, trial.ramp));
  return std::abs(level.angle_rad() - trial.turns * kTurnRad) < kTurnRad / 2;
}

Drive::Setting AtWorstLoad(Drive::Setting setting) {
  setting.motor.load_Nm *= 1 + setting.motor.load_variation;
  setting.motor.load_variation = 0;
  return setting;
}

double Stall(const Drive::Setting& setting, const Modulation& modulation) {
  return ReducedDrive(setting, modulation).stall_Nm();
}

bool StartsReal(const ReducedDrive& rested, double load_Nm, const Modulation& modulation,
                double repeat) {
  const double stall_Nm = rested.stall_Nm();
  if (load_Nm >= stall_Nm) return false;
  ReducedDrive drive = rested;
  drive.SetLoad(load_Nm);
  drive.Place(-std::asin(load_Nm / stall_Nm), 0);
  constexpr int kTurns = 30;
  for (int turn = 0; turn < kTurns; ++turn) {
    drive.RunVectors(1, modulation.subdivision, repeat);
    // A lost turn is not regained.
    if (drive.shaft().angle_rad() < (turn + 0.5) * kTurnRad) return false;
  }
  return true;
}

}  // namespace

std::vector<Stage> MakeProfile(std::int64_t vectors, const Modulation& modulation,
                               const Ramp& ramp) {
  const std::int64_t direction = vectors < 0 ? -1 : 1;
  std::int64_t left = std::abs(vectors);
  std::vector<Stage> up;
  for (int s = 0; s < ramp.stages; ++s) {
    const int repeat =
        std::min(kRepeatMax, (modulation.repeat * (ramp.stages + 1) + s) / (s + 1));  // rounded up
    const auto count =
        std::max<std::int64_t>(1, std::llround(ramp.stage_s / (repeat * modulation.carrier_s())));
    if (2 * count > left) break;
    left -= 2 * count;
    up.push_back({direction * count, repeat});
  }
  std::vector<Stage> profile = up;
  // Full speed comes only after the whole ramp.
  const bool whole = up.size() == static_cast<std::size_t>(ramp.stages);
  if (left > 0)
    profile.push_back(
        {direction * left, whole || up.empty() ? modulation.repeat : up.back().repeat});
  profile.insert(profile.end(), up.rbegin(), up.rend());
  return profile;
}

MoveCount TryMoves(const Drive::Setting& setting, const Modulation& modulation,
                   const StartRule& rule, DriveLevel level) {
  FOCALFLEET_CHECK(modulation.repeat > 0);
  const double stall_Nm = Stall(setting, modulation);
  return level == DriveLevel::kReduced
             ? TryMovesAt(Reduced(setting, modulation), stall_Nm, setting, modulation, rule)
             : TryMovesAt(Pwm(setting, modulation), stall_Nm, setting, modulation, rule);
}

bool StartsAtWorstLoad(const Drive::Setting& setting, const Modulation& modulation,
                       const StartTrial& trial, DriveLevel level) {
  const Drive::Setting worst = AtWorstLoad(setting);
  const double stall_Nm = Stall(worst, modulation);
  return level == DriveLevel::kReduced
             ? StartsAt(Reduced(worst, modulation), stall_Nm, modulation, trial)
             : StartsAt(Pwm(worst, modulation), stall_Nm, modulation, trial);
}

std::optional<int> CriticalRepeat(const Drive::Setting& setting, const Modulation& modulation,
                                  const StartTrial& trial, DriveLevel level, int highest) {
  if (level == DriveLevel::kReduced && trial.ramp.stages == 0) {
    const auto real = CriticalRepeatReal(setting, modulation);
    if (!real || *real > highest) return std::nullopt;
    return static_cast<int>(std::ceil(*real - kRealResolution));
  }
  const auto starts = [&](int repeat) {
    Modulation at = modulation;
    at.repeat = repeat;
    return StartsAtWorstLoad(setting, at, trial, level);
  };
  // The search goes upwards: a slow field is costly to simulate, and mostly not needed.
  int fails = 0;
  int works = std::min(4, highest);
  while (!starts(works)) {
    if (works == highest) return std::nullopt;
    fails = works;
    works = std::min(works + works / 2, highest);
  }
  while (works - fails > 1) {
    const int middle = (fails + works) / 2;
    (starts(middle) ? works : fails) = middle;
  }
  return works;
}

std::optional<double> CriticalRepeatReal(const Drive::Setting& setting,
                                         const Modulation& modulation) {
  return CriticalRepeatReal(ReducedDrive(setting, modulation), setting, modulation);
}

std::optional<double> CriticalRepeatReal(const ReducedDrive& drive, const Drive::Setting& setting,
                                         const Modulation& modulation) {
  const double worst_Nm = AtWorstLoad(setting).motor.load_Nm;
  const auto starts = [&](double repeat) {
    return StartsReal(drive, worst_Nm, modulation, repeat);
  };
  // The search goes upwards, because a load that fails does so within a turn or two.
  double fails = 0.5;
  double works = 2;
  while (!starts(works)) {
    if (works >= kRepeatMax) return std::nullopt;
    fails = works;
    works = std::min(1.4 * works, static_cast<double>(kRepeatMax));
  }
  while (works - fails > kRealResolution) {
    const double middle = (fails + works) / 2;
    (starts(middle) ? works : fails) = middle;
  }
  return works;
}

double LoadOfCriticalRepeat(const Drive::Setting& setting, const Modulation& modulation,
                            int repeat) {
  const ReducedDrive rested(setting, modulation);
  double starts = 0;
  double stalls = rested.stall_Nm();
  for (int k = 0; k < 24; ++k) {
    const double worst = (starts + stalls) / 2;
    // The critical load for `repeat` is the one that half a count less would not start.
    (StartsReal(rested, worst, modulation, repeat - 0.5) ? starts : stalls) = worst;
  }
  return starts / (1 + setting.motor.load_variation);
}

CriticalLoads::CriticalLoads(const Drive::Setting& setting, const Modulation& modulation)
    : modulation_(modulation),
      variation_(setting.motor.load_variation),
      rested_(setting, modulation) {}

double CriticalLoads::Of(int repeat) {
  const auto above = known_.lower_bound(repeat);
  if (above != known_.end() && above->first == repeat) return above->second;
  // More time a vector never makes a start harder, so neighbours bound the result.
  double starts = above == known_.begin() ? 0 : std::prev(above)->second * (1 + variation_);
  double stalls = above == known_.end() ? rested_.stall_Nm() : above->second * (1 + variation_);
  const double fine_Nm = 1e-4 * rested_.stall_Nm();
  while (stalls - starts > fine_Nm) {
    const double middle = (starts + stalls) / 2;
    (StartsReal(rested_, middle, modulation_, repeat) ? starts : stalls) = middle;
  }
  return known_[repeat] = starts / (1 + variation_);
}

std::optional<int> CriticalLoads::RepeatFor(double load_Nm) {
  // The search goes upwards: a slow field is costly to simulate, and mostly not needed.
  int fails = 0;
  int works = 4;
  while (Of(works) < load_Nm) {
    if (works == kRepeatMax) return std::nullopt;
    fails = works;
    works = std::min(works + works / 2, kRepeatMax);
  }
  while (works - fails > 1) {
    const int middle = (fails + works) / 2;
    (Of(middle) >= load_Nm ? works : fails) = middle;
  }
  return works;
}

double CriticalLoads::Supply_W(int repeat, double load_Nm) const {
  constexpr int kSettlingTurns = 20;
  constexpr int kTurns = 5;
  ReducedDrive drive = rested_;
  drive.SetLoad(load_Nm);
  drive.Place(-std::asin(std::min(1.0, load_Nm / rested_.stall_Nm())), 0);
  drive.RunVectors(1, std::int64_t{kSettlingTurns} * modulation_.subdivision, repeat);
  const double before_J = drive.supply_J();
  const double before_s = drive.t_s();
  drive.RunVectors(1, std::int64_t{kTurns} * modulation_.subdivision, repeat);
  return (drive.supply_J() - before_J) / (drive.t_s() - before_s);
}

}  // namespace focalfleet::sim
