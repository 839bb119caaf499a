// Does a load start, and how fast may the field turn so that it does? Paper 1's rule: from rest,
// 300 degrees of the output six times each way; the critical n is the least number of carrier
// periods a vector with which all twelve succeed. A move succeeds when the rotor ends in the
// electrical turn in which the field ends. Load varies over an output turn, so where a move starts
// matters; before each the rotor rests as far behind its vector as friction holds it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "sim/drive/drive.h"
#include "sim/drive/reduced_drive.h"

namespace focalfleet::sim {

/// Reduced: some milliseconds of CPU time a move; PWM: seconds.
enum class DriveLevel { kReduced, kPwm };

/// Stages of equal time at the begin of a move, mirrored at its end: stage s of S turns at
/// (s + 1) / (S + 1) of the full speed. No stages: the field turns at full speed at once.
struct Ramp {
  int stages = 0;
  double stage_s = 0.01;
};

/// Some vectors, each shown for the same number of carrier periods.
struct Stage {
  std::int64_t vectors = 0;  // signed
  int repeat = 0;
};
/// Adds up to `vectors`. A move too short for its ramp turns round before full speed.
std::vector<Stage> MakeProfile(std::int64_t vectors, const Modulation& modulation,
                               const Ramp& ramp);

struct StartRule {
  double move_deg = 300;  // of the output
  int moves_each_way = 6;
  Ramp ramp;
  std::function<void()> on_move = {};  // hears each move's end; may be empty
};

/// What came of the moves of a rule.
struct MoveCount {
  int succeeded = 0;
  int moves = 0;
  double copper_J = 0;  // of all moves
  double time_s = 0;
  [[nodiscard]] bool all() const { return succeeded == moves; }
};
/// Pre: modulation.repeat > 0. `level` PWM: `--full`.
MoveCount TryMoves(const Drive::Setting& setting, const Modulation& modulation,
                   const StartRule& rule, DriveLevel level);

/// Whether the field, begun at once at the place of the highest load, takes the rotor along for
/// `turns` electrical turns. Decides what TryMoves decides (a rotor that has caught up stays) at a
/// hundredth of its cost.
struct StartTrial {
  int turns = 60;
  Ramp ramp;
};
bool StartsAtWorstLoad(const Drive::Setting& setting, const Modulation& modulation,
                       const StartTrial& trial, DriveLevel level);

/// Least n that starts the worst load, and all above it up to `highest` (by bisection: more time a
/// vector never hurts). None: not even `highest` does; the load stalls.
std::optional<int> CriticalRepeat(const Drive::Setting& setting, const Modulation& modulation,
                                  const StartTrial& trial, DriveLevel level, int highest = 255);

/// The same between whole numbers, at the reduced level: what V_bus * n is when n is not rounded.
std::optional<double> CriticalRepeatReal(const Drive::Setting& setting,
                                         const Modulation& modulation);
/// Pre: `drive` was made of the same setting and modulation; it is copied.
std::optional<double> CriticalRepeatReal(const ReducedDrive& drive, const Drive::Setting& setting,
                                         const Modulation& modulation);

/// The mean load with which `repeat` is critical: the one number about the load that a critical n
/// tells. Units: Nm at the motor shaft.
double LoadOfCriticalRepeat(const Drive::Setting& setting, const Modulation& modulation,
                            int repeat);

/// The same the other way round, for many loads: what each n starts at most. By the reduced drive,
/// without a ramp, to 1e-4 of the stall torque; each n is tried once.
class CriticalLoads {
 public:
  CriticalLoads(const Drive::Setting& setting, const Modulation& modulation);

  /// Mean load at the motor shaft that n = `repeat` starts at its worst place, at most. Units: Nm.
  double Of(int repeat);
  /// Least n that starts it; none: no n does.
  std::optional<int> RepeatFor(double load_Nm);
  /// Mean power from the supply in steady rotation with this load. Pre: `repeat` starts it.
  [[nodiscard]] double Supply_W(int repeat, double load_Nm) const;

 private:
  Modulation modulation_;
  double variation_;
  ReducedDrive rested_;
  std::map<int, double> known_;  // ascending in both
};

}  // namespace focalfleet::sim
