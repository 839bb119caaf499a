// An axis in closed form: field -> rotor -> gear -> play -> output. Along a path the field is
// piecewise monotone. On a monotone piece a friction band (rotor) and a play (backlash) are a max
// or a min with their former place. The state at any instant therefore costs O(segments), without
// steps of time.
//
// The rotor keeps to the field only up to a whole electrical turn. `offset_turns_` counts the turns
// between the firmware's count and the rotor. The offset changes when the hard stop holds the rotor
// or the rotor cannot follow. Another reason is a stored vector that is applied to a rotor that
// stands elsewhere.
#pragma once

#include <cstdint>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "protocol/base/rng.h"
#include "sim/world/axis/axis_memory.h"
#include "sim/world/axis/field_path.h"
#include "sim/world/axis/motor.h"

namespace focalfleet::sim {

/// The deviation of an axis' place from its place at another time changes with the way between. The
/// axis loses its memory over this much of way (an Ornstein-Uhlenbeck process in the travelled
/// angle). After a way d the scatter x becomes x exp(-d/L) + s sqrt(1 - exp(-2d/L)) N(0, 1). Two
/// places that lie a short way apart differ by s sqrt(2d/L), so a correction of some degrees hardly
/// scatters. With s = 0.1 deg the difference is 0.040 deg after 30 deg and 0.028 deg after 15. A
/// positioner on a bench shows 0.04 and at most 0.03 (tests/sim/drive/measured_moves_test.cc).
inline constexpr double kScatterTravelDeg = 360;

/// The constant traits of one axis. Angles are the output's, in degrees.
struct AxisTraits {
  double gear = 1;             // as built; the description may say otherwise
  double stop_low_deg = -1e9;  // hard stops
  double stop_high_deg = 1e9;
  double load_phase_deg = 0;  // the place over an output turn where the load is highest
  double backlash_deg = 0;    // full width
  double periodic_deg = 0;    // amplitude, one period an output turn
  double periodic_phase_deg = 0;
  double scatter_deg = 0;  // standard deviation after a long way, see kScatterTravelDeg
  // Share of the gear's motion that arrives: below 1 the axis slips, at 0 it is dead.
  double grip = 1;
  std::uint64_t scatter_seed = 0;
};

class AxisModel {
 public:
  /// A new axis at `position` whole vectors, rotor and field agreeing. `motor` outlives it.
  struct Start {
    std::int32_t position = 0;
    std::uint16_t subdivision = 96;
    double believed_gear = 1;
  };
  AxisModel(const AxisTraits& traits, const Motor* motor, const Start& start);
  /// An axis restored from its memory; without power.
  AxisModel(const AxisTraits& traits, const Motor* motor, const AxisMemory& memory);

  // ---- the operations of the unit's bridge

  /// Applies a vector after power was off: the rotor turns to the nearest place that agrees with
  /// it.
  struct Field {
    std::int32_t position = 0;  // vectors, whole turns included, as the firmware counts
    std::uint16_t subdivision = 96;
  };
  void Energise(const Field& field);
  /// Begins to follow `path`, which begins at the vector applied now.
  void Run(const FieldPath& path);
  /// The field stays at the vector that is applied at `at`; the rotor comes to rest.
  void Halt(HostInstant at);
  /// Power is lost at `at`: the rotor stays where it is.
  void Release(HostInstant at);
  /// The firmware counts on from another number for the same vector. Pre: congruent in
  /// `subdivision`.
  void Recount(std::int32_t position);

  // ---- the true state

  [[nodiscard]] double AngleDeg(HostInstant at) const;
  [[nodiscard]] AxisMemory Memory(HostInstant at) const;
  [[nodiscard]] std::int32_t Applied(HostInstant at) const { return path_.Applied(at); }

 private:
  struct Moment {  // the quantities that change along a path
    double rotor_turns = 0;
    double output_deg = 0;
    std::int64_t offset_turns = 0;
  };
  /// The state at `at`. Settled: the field stays where it is, and the rotor has come to rest behind
  /// it.
  [[nodiscard]] Moment At(HostInstant at, bool settled) const;
  void FollowPiece(const FieldPath::Piece& piece, double now_ns, bool settled,
                   Moment* moment) const;
  struct Pull {
    double field_turns = 0;  // as the firmware counts
    double extra_lag_turns = 0;
    bool up = true;
  };
  void Drag(const Pull& pull, Moment* moment) const;
  void Turn(double rotor_turns, Moment* moment) const;
  void LockOn(double field_turns, Moment* moment) const;
  [[nodiscard]] double LoadShare(double rotor_turns) const;
  [[nodiscard]] double DrivenDeg(double rotor_turns) const;
  [[nodiscard]] double WayDeg() const;  // of path_, there and back
  [[nodiscard]] double ScatterDeg(HostInstant at) const;
  void Fold(HostInstant at, bool settled);

  AxisTraits traits_;
  const Motor* motor_;
  double stop_low_turns_ = -1e9;  // where the rotor cannot go on
  double stop_high_turns_ = 1e9;
  AxisMemory memory_;  // as of the begin of path_
  std::int64_t offset_turns_ = 0;
  double next_scatter_deg_ = 0;  // reached at the end of path_
  std::uint16_t subdivision_ = 96;
  FieldPath path_;
};

}  // namespace focalfleet::sim
