#include "sim/campaigns/effects/empirical.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>

#include "sim/campaigns/effects/harmonic.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kKnotsMax = 65;
constexpr double kPlaceMm = 0.1;  // at an amplitude of 1
constexpr std::string_view kChannelNames[] = {"theta angle",
                                              "phi angle",
                                              "x",
                                              "y",
                                              "theta angle against its direction",
                                              "phi angle against its direction",
                                              "theta angle against its direction when it moved",
                                              "phi angle against its direction when it moved",
                                              "theta angle by its sine",
                                              "theta angle by its cosine",
                                              "phi angle by its sine",
                                              "phi angle by its cosine"};
static_assert(std::size(kChannelNames) == kEmpiricalChannels);

std::vector<double> RanksOf(const UnitTrack& track, const Template& form) {
  const FilledColumn& column = *track.facts->Find(form.covariate);
  std::vector<double> ranks(track.moves);
  for (std::size_t i = 0; i < track.moves; ++i) {
    const std::size_t row = track.RowOf(i);
    ranks[i] =
        form.knots.empty() ? double{column.rank[row]} : RankAt(form.knots, column.values[row]);
  }
  return ranks;
}

std::vector<double> CurveOf(const UnitTrack& track, const Template& form,
                            std::span<const double> amplitude) {
  const std::vector<double> ranks = RanksOf(track, form);
  std::vector<double> curve(track.moves, 0);
  for (std::size_t c = 0; c < form.columns; ++c) {
    if (amplitude[c] == 0) continue;
    const double half_turns = form.shape + static_cast<double>(c);
    const double* rank = ranks.data();
    double* sum = curve.data();
    for (std::size_t i = 0; i < track.moves; ++i)
      sum[i] += amplitude[c] * CosineOfTurns(half_turns / 2 * rank[i]);
  }
  return curve;
}

// Multiplies the curve by the direction of the axis' motion, and by 0 before its first move. With
// `held` the value at the axis' last move is used.
void TurnWithMotion(const UnitTrack& track, std::size_t axis, bool held,
                    std::vector<double>* curve) {
  double direction = 0, made = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i] != 0) direction = made = 0;
    if (track.step_deg[axis][i] != 0) {
      direction = Direction(track.step_deg[axis][i]);
      made = direction * (*curve)[i];
    }
    (*curve)[i] = held ? made : direction * (*curve)[i];
  }
}

void TurnWithAngle(const UnitTrack& track, std::size_t axis, bool sine,
                   std::vector<double>* curve) {
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double turns = (track.cmd_deg[axis][i] + track.unit->zero_deg[axis]) / 360;
    (*curve)[i] *= sine ? SineOfTurns(turns) : CosineOfTurns(turns);
  }
}

void AddCurve(const std::vector<double>& curve, double factor, std::vector<double>* sum) {
  for (std::size_t i = 0; i < curve.size(); ++i) (*sum)[i] += factor * curve[i];
}

void ApplyCurve(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                PoseErrors* errors) {
  std::vector<double> curve = CurveOf(track, form, amplitude);
  if (form.form == kPlaceX) return AddCurve(curve, kPlaceMm, &errors->x_mm);
  if (form.form == kPlaceY) return AddCurve(curve, kPlaceMm, &errors->y_mm);
  const std::size_t axis = kChannelNames[form.form].starts_with("phi") ? kPhi : kTheta;
  if (form.form >= kThetaSine)
    TurnWithAngle(track, axis, form.form == kThetaSine || form.form == kPhiSine, &curve);
  else if (form.form >= kThetaOdd)
    TurnWithMotion(track, axis, form.form >= kThetaHeld, &curve);
  AddCurve(curve, 1, &errors->angle_deg[axis]);
}

void ApplyRipple(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                 PoseErrors* errors) {
  AddHarmonic(track, AxisIndex(form), form.shape, amplitude, errors);
}

void ListNone(const CampaignFacts&, Templates*) {}

}  // namespace

const Effect& EmpiricalCurve() {
  static const Effect effect{.cause = "empirical_curve",
                             .amplitude_unit = "deg; in x and y 0.1 mm",
                             .prior_size = 0.05,
                             .owner = Owner::kUnit,
                             .list = ListNone,
                             .apply = ApplyCurve};
  return effect;
}

const Effect& EmpiricalRipple() {
  static const Effect effect{.cause = "empirical_ripple",
                             .amplitude_unit = "deg",
                             .prior_size = 0.05,
                             .owner = Owner::kUnit,
                             .list = ListNone,
                             .apply = ApplyRipple,
                             .of_poses_alone = EachForm};
  return effect;
}

const Effect* FindEmpirical(std::string_view cause) {
  for (const Effect* effect : {&EmpiricalCurve(), &EmpiricalRipple()})
    if (effect->cause == cause) return effect;
  return nullptr;
}

std::string_view ChannelOf(const Template& form) {
  if (form.effect == &EmpiricalRipple())
    return kChannelNames[form.axis == EffectAxis::kPhi ? kPhiAngle : kThetaAngle];
  return kChannelNames[form.form];
}

std::optional<EmpiricalChannel> ChannelNamed(std::string_view name) {
  for (int channel = 0; channel < kEmpiricalChannels; ++channel)
    if (kChannelNames[channel] == name) return static_cast<EmpiricalChannel>(channel);
  return std::nullopt;
}

std::vector<RankKnot> KnotsOf(const FilledColumn& column) {
  std::vector<RankKnot> all;
  for (std::size_t row = 0; row < column.values.size(); ++row)
    all.push_back({column.values[row], double{column.rank[row]}});
  std::sort(all.begin(), all.end(),
            [](const RankKnot& a, const RankKnot& b) { return a.value < b.value; });
  all.erase(std::unique(all.begin(), all.end(),
                        [](const RankKnot& a, const RankKnot& b) { return !(a.value < b.value); }),
            all.end());
  if (all.size() <= kKnotsMax) return all;
  std::vector<RankKnot> knots;
  std::size_t next = 0;
  const double first = all.front().rank, span = all.back().rank - all.front().rank;
  for (std::size_t k = 0; k + 1 < kKnotsMax; ++k) {
    const double wanted = first + span * static_cast<double>(k) / (kKnotsMax - 1);
    while (next + 1 < all.size() && all[next].rank < wanted) ++next;
    if (knots.empty() || all[next].value > knots.back().value) knots.push_back(all[next]);
  }
  if (all.back().value > knots.back().value) knots.push_back(all.back());
  return knots;
}

double RankAt(std::span<const RankKnot> knots, double value) {
  const auto above =
      std::upper_bound(knots.begin(), knots.end(), value,
                       [](double wanted, const RankKnot& knot) { return wanted < knot.value; });
  if (above == knots.begin()) return knots.front().rank;
  if (above == knots.end()) return knots.back().rank;
  const RankKnot& low = *std::prev(above);
  return low.rank + (above->rank - low.rank) * (value - low.value) / (above->value - low.value);
}

Template WholeCurve(const Template& look, const CampaignFacts& facts) {
  Template curve = look;
  curve.knots = KnotsOf(*facts.Find(look.covariate));
  // The column's values can distinguish so many cosines, without the constant.
  curve.columns = std::clamp<std::size_t>(curve.knots.size() - 1, 1, kEmpiricalCosines);
  // A look beyond the slowest cosines has the middle of them.
  curve.shape = std::max(1.0, look.shape - static_cast<double>(kEmpiricalCosines / 2));
  curve.label = "smooth curve over the ranks of " + look.covariate;
  return curve;
}

}  // namespace focalfleet::sim
