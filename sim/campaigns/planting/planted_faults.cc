#include "sim/campaigns/planting/planted_faults.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/rng.h"
#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/terms/exchanged.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {
namespace {

using ComplexPlane = std::complex<double>;  // x + i y, mm

constexpr std::string_view kFaults[] = {kLostCommand, kStepLoss, kIdentitySwap, kSensorBias,
                                        kAirTurbulence};
constexpr std::string_view kCounted[] = {kLostCommand, kStepLoss, kIdentitySwap};

bool IsOf(std::span<const std::string_view> causes, std::string_view cause) {
  return std::ranges::find(causes, cause) != causes.end();
}

// Moves the fibre to where it is when the axis is `off_deg` from its command.
void Turn(std::size_t unit, std::size_t row, std::size_t axis, double off_deg, Campaign* campaign) {
  const CampaignUnit& u = campaign->units[unit];
  ComplexPlane pivot(u.base_x_mm, u.base_y_mm);
  if (axis == kPhi)
    pivot += std::polar(u.arm_mm[kTheta],
                        (campaign->cmd_deg[kTheta][row] + u.zero_deg[kTheta]) * kRadiansPerDegree);
  const ComplexPlane fibre(campaign->x_mm[row], campaign->y_mm[row]);
  const ComplexPlane turned =
      pivot + (fibre - pivot) * std::polar(1.0, off_deg * kRadiansPerDegree);
  campaign->x_mm[row] = turned.real(), campaign->y_mm[row] = turned.imag();
}

std::vector<std::size_t> Drawn(std::size_t count, double share, Rng* rng) {
  std::vector<std::size_t> drawn;
  for (std::size_t k = 0; k < count; ++k)
    if (share >= 1 || rng->Uniform() < share) drawn.push_back(k);
  if (drawn.empty() && count > 0) drawn.push_back(rng->Below(count));
  return drawn;
}

// The part of an axis' angle that a fault takes off at some of a unit's moves is missing until the
// unit is homed.
struct Loss {
  std::span<const std::size_t> axes;
  std::size_t moves = 1;
  double turns = 0;  // of the rotor, against the motion; 0: the whole move
};

void LoseAt(std::size_t unit, const Loss& loss, const CampaignFacts& facts, Rng* rng,
            Campaign* campaign) {
  const CampaignUnit& u = campaign->units[unit];
  const std::size_t begin = campaign->first_row[unit], end = campaign->first_row[unit + 1];
  std::vector<std::size_t> moves;
  for (std::size_t row = begin; row < end; ++row)
    if (std::ranges::any_of(loss.axes, [&](auto axis) { return facts.step_deg[axis][row] != 0; }))
      moves.push_back(row);
  std::set<std::size_t> at;
  while (at.size() < std::min(loss.moves, moves.size())) at.insert(moves[rng->Below(moves.size())]);
  double off_deg[2] = {0, 0};
  for (std::size_t row = begin; row < end; ++row) {
    if (facts.restarts[row] != 0) off_deg[kTheta] = off_deg[kPhi] = 0;
    for (const std::size_t axis : loss.axes) {
      const double step_deg = facts.step_deg[axis][row];
      if (at.count(row) != 0 && step_deg != 0)
        off_deg[axis] -=
            loss.turns == 0 ? step_deg : std::copysign(loss.turns * 360 / u.gear[axis], step_deg);
    }
    for (const std::size_t axis : {kPhi, kTheta}) Turn(unit, row, axis, off_deg[axis], campaign);
  }
}

void LoseMoves(const PlantedEffect& planted, const CampaignFacts& facts, Rng* rng,
               Campaign* campaign) {
  static constexpr std::size_t kBoth[] = {kTheta, kPhi};
  const std::size_t axis = planted.axis == "phi" ? kPhi : kTheta;
  Loss loss{.axes = kBoth};
  if (planted.cause == kStepLoss)
    loss.axes = std::span(&kBoth[axis], 1), loss.turns = planted.amplitude;
  else
    loss.moves = static_cast<std::size_t>(planted.amplitude);
  for (const std::size_t unit : Drawn(campaign->units.size(), planted.unit_share, rng))
    LoseAt(unit, loss, facts, rng, campaign);
}

Status ExchangeNames(const PlantedEffect& planted, const CampaignFacts& facts, Rng* rng,
                     Campaign* campaign) {
  std::vector<std::size_t> free(campaign->units.size());
  for (std::size_t unit = 0; unit < free.size(); ++unit) free[unit] = unit;
  const auto pairs = static_cast<std::size_t>(planted.amplitude);
  if (2 * pairs > free.size())
    return Fail(ErrorCode::kInvalid, "identity_swap: there are not so many pairs of units");
  const auto take = [&] {
    const std::size_t at = rng->Below(free.size()), unit = free[at];
    free.erase(free.begin() + static_cast<std::ptrdiff_t>(at));
    return unit;
  };
  for (std::size_t k = 0; k < pairs; ++k) {
    const std::size_t a = take(), b = take();
    // Undoing an exchange exchanges the places either way.
    UndoFibreSwap(facts.exposures, FibreSwap::Whole(*campaign, a, b), campaign);
  }
  return {};
}

void DistortTemperatures(const PlantedEffect& planted, const CampaignFacts& facts, Rng* rng,
                         Campaign* campaign) {
  std::vector<double> rails;
  for (const CampaignUnit& unit : campaign->units) rails.push_back(unit.rail);
  std::set<double> each(rails.begin(), rails.end());
  std::vector<std::size_t> units;
  if (each.size() > 1) {
    for (const std::size_t k : Drawn(each.size(), planted.unit_share, rng))
      for (std::size_t unit = 0; unit < rails.size(); ++unit)
        if (rails[unit] == *std::next(each.begin(), static_cast<std::ptrdiff_t>(k)))
          units.push_back(unit);
  } else {
    units = Drawn(rails.size(), planted.unit_share, rng);
  }
  const double mean_C = facts.Find("temp_C")->mean;
  for (Covariate& column : campaign->covariates)
    if (column.name == "temp_C")
      for (const std::size_t unit : units)
        for (std::size_t row = campaign->first_row[unit]; row < campaign->first_row[unit + 1];
             ++row)
          column.values[row] += planted.amplitude * (column.values[row] - mean_C);
}

// Air between fibres and camera: waves of all directions, new at each exposure.
void MoveAir(const PlantedEffect& planted, const CampaignFacts& facts, Rng* rng,
             Campaign* campaign) {
  constexpr int kWaves = 8;
  const double longest_mm = 2 * facts.radius_mm;
  struct Wave {
    ComplexPlane along;  // 1/mm
    ComplexPlane shift;  // um
    double phase;
  };
  std::vector<std::vector<Wave>> waves(facts.exposures.size());
  for (std::vector<Wave>& one : waves)
    for (int k = 0; k < kWaves; ++k)
      one.push_back(
          {std::polar(rng->Uniform(1, 3) / longest_mm, rng->Uniform(0, 2 * std::numbers::pi)),
           std::sqrt(2.0 / kWaves) * planted.amplitude * ComplexPlane(rng->Normal(), rng->Normal()),
           rng->Uniform()});
  for (std::size_t unit = 0; unit < campaign->units.size(); ++unit) {
    const CampaignUnit& u = campaign->units[unit];
    for (std::size_t row = campaign->first_row[unit]; row < campaign->first_row[unit + 1]; ++row)
      for (const Wave& wave : waves[facts.exposures.of_row[row]]) {
        const double turns = wave.along.real() * u.base_x_mm + wave.along.imag() * u.base_y_mm;
        const ComplexPlane shift =
            wave.shift * std::sin(2 * std::numbers::pi * (turns + wave.phase));
        campaign->x_mm[row] += 1e-3 * shift.real();
        campaign->y_mm[row] += 1e-3 * shift.imag();
      }
  }
}

}  // namespace

bool IsPlantedFault(std::string_view cause) { return IsOf(kFaults, cause); }

Status PlantFault(const PlantedEffect& planted, const CampaignFacts& facts, std::uint64_t seed,
                  Campaign* campaign) {
  const bool of_an_axis = planted.cause == kStepLoss;
  const bool is_axis = planted.axis == "theta" || planted.axis == "phi";
  if (!planted.axis.empty() && !(of_an_axis && is_axis))
    return Fail(ErrorCode::kInvalid, planted.cause + ": not on axis '" + planted.axis + "' here");
  if (planted.form >= 0) return Fail(ErrorCode::kInvalid, planted.cause + ": it has no shapes");
  constexpr double kMost = 1e6;
  if (IsOf(kCounted, planted.cause) && !(planted.amplitude >= 1 && planted.amplitude <= kMost &&
                                         planted.amplitude == std::floor(planted.amplitude)))
    return Fail(ErrorCode::kInvalid, planted.cause + ": a whole number from 1 on is expected");
  Rng rng = Rng::Stream(seed, planted.cause);
  if (planted.cause == kLostCommand || planted.cause == kStepLoss)
    LoseMoves(planted, facts, &rng, campaign);
  else if (planted.cause == kIdentitySwap)
    return ExchangeNames(planted, facts, &rng, campaign);
  else if (planted.cause == kSensorBias)
    DistortTemperatures(planted, facts, &rng, campaign);
  else
    MoveAir(planted, facts, &rng, campaign);
  return {};
}

}  // namespace focalfleet::sim
