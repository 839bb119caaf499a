// A start study finds whether a load starts, and how fast the field may turn for it. Paper 1's rule
// is: from rest, 300 degrees of the output six times each way. The critical n is the least number
// of carrier periods a vector with which all twelve moves succeed. A move succeeds when the rotor
// ends in the electrical turn in which the field ends. The load varies over an output turn, so the
// place where a move starts matters. Before each move the rotor rests as far behind its vector as
// friction holds it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "sim/drive/drive.h"
#include "sim/drive/reduced_drive.h"

namespace focalfleet::sim {

/// The reduced level takes some milliseconds of CPU time a move, the PWM level seconds.
enum class DriveLevel { kReduced, kPwm };

/// Stages of equal time at the begin of a move, mirrored at its end. Stage s of S turns at (s + 1)
/// / (S + 1) of the full speed. Without stages the field turns at full speed at once.
struct Ramp {
  int stages = 0;
  double stage_s = 0.01;
};

/// A number of vectors, each shown for the same number of carrier periods.
struct Stage {
  std::int64_t vectors = 0;  // signed
  int repeat = 0;
};
/// The stages add up to `vectors`. A move too short for its ramp turns round before full speed.
std::vector<Stage> MakeProfile(std::int64_t vectors, const Modulation& modulation,
                               const Ramp& ramp);

struct StartRule {
  double move_deg = 300;  // of the output
  int moves_each_way = 6;
  Ramp ramp;
  std::function<void()> on_move = {};  // called at the end of each move; may be empty
};

/// The outcome of the moves of a rule.
struct MoveCount {
  int succeeded = 0;
  int moves = 0;
  double copper_J = 0;  // of all moves
  double time_s = 0;
  [[nodiscard]] bool all() const { return succeeded == moves; }
};
/// Pre: modulation.repeat > 0. Level PWM is that of `--full`.
MoveCount TryMoves(const Drive::Setting& setting, const Modulation& modulation,
                   const StartRule& rule, DriveLevel level);

/// The trial begins the field at once at the place of the highest load. The trial succeeds where
/// the rotor follows for `turns` electrical turns. A rotor that has caught up stays in step, so the
/// trial decides the same as TryMoves at a hundredth of its cost.
struct StartTrial {
  int turns = 60;
  Ramp ramp;
};
bool StartsAtWorstLoad(const Drive::Setting& setting, const Modulation& modulation,
                       const StartTrial& trial, DriveLevel level);

/// The least n that starts the worst load; all n above it up to `highest` start it too. The search
/// is a bisection: more time a vector never makes a start harder. None: not even `highest` starts
/// it; the load stalls.
std::optional<int> CriticalRepeat(const Drive::Setting& setting, const Modulation& modulation,
                                  const StartTrial& trial, DriveLevel level, int highest = 255);

/// The critical n between whole numbers, at the reduced level: V_bus * n without rounding.
std::optional<double> CriticalRepeatReal(const Drive::Setting& setting,
                                         const Modulation& modulation);
/// The same for a drive that exists. Pre: `drive` was made of the same setting and modulation; it
/// is copied.
std::optional<double> CriticalRepeatReal(const ReducedDrive& drive, const Drive::Setting& setting,
                                         const Modulation& modulation);

/// The mean load with which `repeat` is critical. A critical n determines no other number of the
/// load. Units: Nm at the motor shaft.
double LoadOfCriticalRepeat(const Drive::Setting& setting, const Modulation& modulation,
                            int repeat);

/// The inverse for many loads: the largest load that each n starts. Found by the reduced drive,
/// without a ramp, to 1e-4 of the stall torque; each n is tried once.
class CriticalLoads {
 public:
  CriticalLoads(const Drive::Setting& setting, const Modulation& modulation);

  /// The largest mean load at the motor shaft that n = `repeat` starts at its worst place. Units:
  /// Nm.
  double Of(int repeat);
  /// The least n that starts the load; none: no n does.
  std::optional<int> RepeatFor(double load_Nm);
  /// The mean power from the supply in steady rotation with this load. Pre: `repeat` starts it.
  [[nodiscard]] double Supply_W(int repeat, double load_Nm) const;

 private:
  Modulation modulation_;
  double variation_;
  ReducedDrive rested_;
  std::map<int, double> known_;  // ascending in both
};

}  // namespace focalfleet::sim
