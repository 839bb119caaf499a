// Laws of parts with memory, by plays: a play keeps its output until its gap is used up. Many plays
// of several gaps side by side are the Prandtl-Ishlinskii model of a hysteresis.
#include <algorithm>
#include <cmath>
#include <vector>

#include "protocol/base/rng.h"
#include "tests/hidden/generator/curves.h"

namespace focalfleet::hidden {

namespace {

struct Play {
  double half_deg = 0;
  double share = 0;
  double out_deg = 0;
  void To(double rotor_deg) {
    out_deg = std::clamp(out_deg, rotor_deg - half_deg, rotor_deg + half_deg);
  }
};

// The axis' output, at the mean of its plays by their shares.
void FollowPlays(const Scene& scene, const Effect& effect, std::size_t unit,
                 std::vector<Play> plays, Track* track) {
  const Campaign& campaign = *scene.campaign;
  std::vector<double>& angle = track->angle_deg[effect.axis];
  const double into = effect.axis == kTheta ? -1 : 1;  // the stop at which it is homed
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    double sum = 0;
    for (Play& play : plays) {
      if (row.rehomed) play.out_deg = row.from_deg[effect.axis] - into * play.half_deg;
      play.To(angle[m]);
      sum += play.share * (play.out_deg - angle[m]);
    }
    angle[m] += sum;
  }
}

// A worn gear's gap is not the same all round.
void Backlash(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double mean_deg = std::abs(effect.Amount(unit)) / 2;
  const double spread = 0.1 + 0.3 * effect.shape[0], turn_rad = 2 * kPi * effect.shape[1];
  const double into = effect.axis == kTheta ? -1 : 1;
  std::vector<double>& angle = track->angle_deg[effect.axis];
  double out_deg = 0;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    const double half_deg = mean_deg * (1 + spread * std::cos(angle[m] * kDegree + turn_rad));
    if (row.rehomed) out_deg = row.from_deg[effect.axis] - into * half_deg;
    out_deg = std::clamp(out_deg, angle[m] - half_deg, angle[m] + half_deg);
    angle[m] = out_deg;
  }
}

// Asperities let go one after another: their gaps are spread by a power of two each.
void FrictionWindup(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double wind_up_deg = std::abs(effect.Amount(unit));
  if (wind_up_deg <= 0) return;
  const double longest_deg = 1.5 + 4 * effect.shape[0];
  std::vector<Play> plays;
  double all = 0;
  for (double half_deg = longest_deg; half_deg > longest_deg / 40; half_deg /= 2)
    plays.push_back({half_deg, 1}), all += half_deg;
  for (Play& play : plays) play.share = wind_up_deg / all;
  FollowPlays(scene, effect, unit, std::move(plays), track);
}

// The arm breaks loose at a load that differs from move to move, and then follows all the way.
void Stiction(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double loose_deg = std::abs(effect.Amount(unit));
  std::vector<double>& angle = track->angle_deg[effect.axis];
  Rng rng = Rng::Stream(effect.seed, "loose", unit);
  double out_deg = 0;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    const double now_deg = loose_deg * (1 + 0.1 * rng.Normal());
    if (row.rehomed) out_deg = row.from_deg[effect.axis];
    if (std::abs(angle[m] - out_deg) > now_deg) out_deg = angle[m];
    angle[m] = out_deg;
  }
}

// The bundle's pull grows with the cube of the way from the middle, without a loop.
void FibreTorque(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Unit& self = scene.campaign->units[unit];
  const std::size_t a = effect.axis;
  const double middle_deg = (self.min_deg[a] + self.max_deg[a]) / 2;
  const double half_deg = (self.max_deg[a] - self.min_deg[a]) / 2;
  for (double& angle : track->angle_deg[a]) {
    const double x = (angle - middle_deg) / half_deg;
    angle -= effect.Amount(unit) * (0.15 * x + 1.2 * x * x * x);
  }
}

}  // namespace

ApplyEffect HistoryCurveOf(std::string_view cause) {
  if (cause == "backlash") return Backlash;
  if (cause == "friction_windup") return FrictionWindup;
  if (cause == "stiction") return Stiction;
  if (cause == "fibre_torque") return FibreTorque;
  return nullptr;
}

}  // namespace focalfleet::hidden
