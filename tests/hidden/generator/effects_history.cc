// Parts between rotor and arm that depend on the way there. Each is integrated along the whole way
// of every move, unidirectional approaches included, in steps far below its own scale.
#include <algorithm>
#include <cmath>

#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

namespace {

// Runs `follow(step_deg, rotor_deg, speed)` along the way and `rest()` at its end; `home(angle)` at
// a stop. The axis is at the last result of `follow`.
template <class Mechanism>
void FollowWay(const Scene& scene, const Effect& effect, std::size_t unit, Mechanism mechanism,
               Track* track) {
  const Campaign& campaign = *scene.campaign;
  std::vector<double>& angle = track->angle_deg[effect.axis];
  double rotor_deg = 0;
  double out_deg = 0;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    if (row.rehomed) {  // theta against its lower stop, phi against its upper one
      rotor_deg = row.from_deg[effect.axis];
      out_deg = mechanism.Home(rotor_deg, effect.axis == kTheta ? -1 : 1);
    }
    if (row.Moved(effect.axis)) {
      const double way_deg = angle[m] - rotor_deg;
      const int steps = static_cast<int>(
          std::clamp(std::ceil(std::abs(way_deg) / mechanism.step_deg), 16.0, 1500.0));
      const double ramp_deg = 0.8;
      for (int i = 1; i <= steps; ++i) {
        const double gone = std::abs(way_deg) * i / steps;
        const double left = std::max(0.0, std::abs(way_deg) - gone);
        const double speed = std::sqrt(std::min({1.0, gone / ramp_deg, left / ramp_deg}));
        out_deg = mechanism.Follow(rotor_deg + way_deg * i / steps, way_deg / steps, speed);
      }
      out_deg = mechanism.Rest(out_deg);
      rotor_deg = angle[m];
    }
    angle[m] = out_deg;
  }
}

// Play: the arm stays until a flank takes it along. Angles are counted from the middle of the gap.
struct Play {
  double step_deg;
  double half_deg;
  double out_deg = 0;
  double Home(double rotor_deg, double into) { return out_deg = rotor_deg - into * half_deg; }
  double Follow(double rotor_deg, double, double) {
    return out_deg = std::clamp(out_deg, rotor_deg - half_deg, rotor_deg + half_deg);
  }
  double Rest(double angle_deg) const { return angle_deg; }
};

void Backlash(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double gap_deg = std::abs(effect.Amount(unit));
  if (gap_deg <= 0) return;
  FollowWay(scene, effect, unit, Play{std::clamp(gap_deg / 3, 0.05, 2.0), gap_deg / 2}, track);
}

// LuGre: bristles bend until they slide; the slower, the more they bend (Stribeck).
struct Bristles {
  double step_deg;
  double wind_up_deg;  // of the shaft when they slide at speed
  double pre_sliding_deg;
  double bend = 0;
  double Home(double rotor_deg, double into) {
    bend = into;
    return rotor_deg - wind_up_deg * bend;
  }
  double Follow(double rotor_deg, double by_deg, double speed) {
    const double limit = 1 + 0.25 * std::exp(-speed * speed / 0.04);
    bend += by_deg / pre_sliding_deg - std::abs(by_deg) / pre_sliding_deg * bend / limit;
    return rotor_deg - wind_up_deg * bend;
  }
  double Rest(double angle_deg) const { return angle_deg; }
};

void FrictionWindup(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double wind_up_deg = std::abs(effect.Amount(unit));
  if (wind_up_deg <= 0) return;
  const double pre_sliding_deg = 0.6 + 3.4 * effect.shape[0];
  FollowWay(scene, effect, unit, Bristles{pre_sliding_deg / 12, wind_up_deg, pre_sliding_deg},
            track);
}

// The arm sticks until the shaft is wound up so far that it breaks loose, and then slides with a
// fraction of that.
struct StickAndSlide {
  double step_deg;
  double loose_deg;
  double out_deg = 0;
  bool slides = false;
  double Home(double rotor_deg, double) { return out_deg = rotor_deg; }
  double Follow(double rotor_deg, double by_deg, double) {
    const double wound_deg = rotor_deg - out_deg;
    if (std::abs(wound_deg) > loose_deg) slides = true;
    if (slides && wound_deg * by_deg > 0)
      out_deg = rotor_deg - std::copysign(0.1 * loose_deg, wound_deg);
    return out_deg;
  }
  double Rest(double angle_deg) {
    slides = false;
    return angle_deg;
  }
};

void Stiction(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double loose_deg = std::abs(effect.Amount(unit));
  if (loose_deg <= 0) return;
  FollowWay(scene, effect, unit, StickAndSlide{std::clamp(loose_deg / 8, 0.01, 0.5), loose_deg},
            track);
}

// The fibre bundle is a spring that hardens towards the ends of the range and winds with hysteresis
// (Bouc-Wen).
struct FibreSpring {
  double step_deg;
  double amount_deg;
  double middle_deg;
  double half_range_deg;
  double hysteresis;
  double loop = 0;
  [[nodiscard]] double Bent(double rotor_deg) const {
    const double x = (rotor_deg - middle_deg) / half_range_deg;
    return rotor_deg - amount_deg * (0.35 * x + x * x * x + hysteresis * loop);
  }
  double Home(double rotor_deg, double into) {
    loop = into;
    return Bent(rotor_deg);
  }
  double Follow(double rotor_deg, double by_deg, double) {
    loop += (by_deg - 0.5 * std::abs(by_deg) * loop - 0.5 * by_deg * std::abs(loop)) / 18;
    return Bent(rotor_deg);
  }
  double Rest(double angle_deg) const { return angle_deg; }
};

void FibreTorque(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Unit& self = scene.campaign->units[unit];
  const std::size_t a = effect.axis;
  FollowWay(scene, effect, unit,
            FibreSpring{2.0, effect.Amount(unit), (self.min_deg[a] + self.max_deg[a]) / 2,
                        (self.max_deg[a] - self.min_deg[a]) / 2, 0.1 + 0.2 * effect.shape[0]},
            track);
}

}  // namespace

std::vector<EffectKind> HistoryEffects() {
  const std::vector<Owner> mechanical = {Owner::kUnit, Owner::kPlate};
  return {
      {"backlash",
       Stage::kHistory,
       AxisUse::kEither,
       0.06,
       "deg",
       30,
       false,
       mechanical,
       {},
       1,
       false,
       Backlash},
      {"friction_windup",
       Stage::kHistory,
       AxisUse::kEither,
       0.04,
       "deg",
       20,
       false,
       mechanical,
       {},
       1,
       false,
       FrictionWindup},
      {"stiction",
       Stage::kHistory,
       AxisUse::kEither,
       0.2,
       "deg",
       20,
       false,
       mechanical,
       {},
       1,
       false,
       Stiction},
      {"fibre_torque",
       Stage::kHistory,
       AxisUse::kEither,
       0.05,
       "deg",
       40,
       false,
       mechanical,
       {},
       1,
       false,
       FibreTorque},
  };
}

}  // namespace focalfleet::hidden
