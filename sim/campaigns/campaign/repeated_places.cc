#include "sim/campaigns/campaign/repeated_places.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/campaigns/campaign/place_steps.h"

namespace focalfleet::sim {
namespace {

// A row with a place whose unit had a place before.
struct Revisit {
  std::size_t row = 0;
  double moved_mm = 0;     // since then, by the table; 0: commanded to stay
  double off_mm[2] = {0};  // difference between the two places
  [[nodiscard]] bool repeats() const { return off_mm[0] == 0 && off_mm[1] == 0; }
};

// Revisits in the order of the rows. Angles are compared with those of the last place that was
// seen, so that moves between, without a place, count.
std::vector<Revisit> RevisitsOf(const Campaign& campaign) {
  std::vector<Revisit> revisits;
  const std::span<const double> rehomed = campaign.Find("rehomed");
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    bool any = false, stayed = true;
    std::size_t before = 0;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      stayed = stayed && !(!rehomed.empty() && rehomed[row] > 0.5);
      for (const std::size_t axis : {kTheta, kPhi})
        stayed = stayed && campaign.cmd_deg[axis][row] == campaign.from_deg[axis][row];
      if (!std::isfinite(campaign.x_mm[row])) continue;
      if (any) {
        Revisit revisit{.row = row};
        revisit.off_mm[0] = std::abs(campaign.x_mm[row] - campaign.x_mm[before]);
        revisit.off_mm[1] = std::abs(campaign.y_mm[row] - campaign.y_mm[before]);
        if (!stayed) {
          const PlacePoint from = PlaceOf(campaign.units[unit], campaign.cmd_deg[kTheta][before],
                                          campaign.cmd_deg[kPhi][before]);
          const PlacePoint to = PlaceOf(campaign.units[unit], campaign.cmd_deg[kTheta][row],
                                        campaign.cmd_deg[kPhi][row]);
          revisit.moved_mm = std::max(std::hypot(to.x_mm - from.x_mm, to.y_mm - from.y_mm),
                                      std::numeric_limits<double>::min());
        }
        revisits.push_back(revisit);
      }
      any = true, stayed = true, before = row;
    }
  }
  return revisits;
}

// Probability that a coordinate is rounded to the same step twice, where two measurements of it
// differ by a normal variable of this spread. The result is the mean of 1 - |difference| / step, as
// far as that is positive.
double SameStep(double step_mm, double spread_mm) {
  const double ratio = step_mm / spread_mm;
  return std::erf(ratio / std::numbers::sqrt2) -
         std::sqrt(2 / std::numbers::pi) / ratio * (1 - std::exp(-ratio * ratio / 2));
}

// The largest share of places at rest that repeat by chance.
double ShareByChance(const std::vector<Revisit>& revisits, double step_mm) {
  // Spread of a coordinate below that of any camera of a fibre positioner. The figure is assumed
  // where the places are too coarse to show their own. Twice of it misses places that are carried
  // on in steps of 10 um. Half of it finds some in those of a very good camera.
  constexpr double kGoodCamera_mm = 1e-3;
  constexpr double kNormal = 0.6745;        // median of a normal variable's size
  constexpr double kDiffersBy_steps = 1.5;  // steps between places that do differ
  if (!(step_mm > 0)) return 0;
  std::vector<double> off_mm;
  for (const Revisit& revisit : revisits)
    if (revisit.moved_mm == 0 && !revisit.repeats())
      off_mm.insert(off_mm.end(), {revisit.off_mm[0], revisit.off_mm[1]});
  double spread_mm = std::numbers::sqrt2 * kGoodCamera_mm;
  if (!off_mm.empty()) {
    const auto middle = off_mm.begin() + static_cast<std::ptrdiff_t>(off_mm.size() / 2);
    std::nth_element(off_mm.begin(), middle, off_mm.end());
    if (*middle > kDiffersBy_steps * step_mm) spread_mm = *middle / kNormal;
  }
  const double same = SameStep(step_mm, spread_mm);
  return same * same;
}

// Whether more places at rest repeat than chance explains.
bool AreCarriedOn(const std::vector<Revisit>& revisits, double share) {
  constexpr double kSure = 5;  // standard deviations
  double rest = 0, repeats = 0;
  for (const Revisit& revisit : revisits) {
    if (revisit.moved_mm > 0) continue;
    rest += 1;
    if (revisit.repeats()) repeats += 1;
  }
  return repeats > rest * share + kSure * std::sqrt(rest * share * (1 - share)) + 0.5;
}

// Counts of one exposure: places of units that had one before.
struct ExposureCount {
  std::size_t all = 0, repeat = 0;            // of all units
  std::size_t moved = 0;                      // of those that were moved at all
  std::size_t far_moved = 0, far_repeat = 0;  // of those that were moved far
};

// An exposure is a copy where half of the units that were moved far repeat their place, and chance
// does not explain it. The same holds where all units repeat, however little they were moved.
// Shape: (exposures).
std::vector<char> FindCopies(const Exposures& exposures, const std::vector<Revisit>& revisits,
                             double step_mm, double share) {
  // Probability that chance alone makes an exposure a copy: one in a million, and a campaign has 10
  // to 1000. Half and twice of it change the least number of units that can show a copy by less
  // than one.
  constexpr double kCopyChance = 1e-6;
  // Shorter moves may be held back by play and stiction, some 10 um at the fibre, and rounded away.
  // Half of this bound is still above those. Twice of it only leaves fewer rows as evidence.
  constexpr double kMoved_mm = 0.1;
  constexpr double kSteps = 3;
  // Two units may both be stuck. With twice of it a copy is not seen where fewer than six units
  // moved.
  constexpr std::size_t kRowsMin = 3;
  const double far_mm = std::max(kMoved_mm, kSteps * step_mm);
  std::vector<ExposureCount> counts(exposures.size());
  for (const Revisit& revisit : revisits) {
    ExposureCount& count = counts[exposures.of_row[revisit.row]];
    const std::size_t repeats = revisit.repeats() ? 1 : 0;
    ++count.all, count.repeat += repeats;
    if (revisit.moved_mm > 0) ++count.moved;
    if (revisit.moved_mm >= far_mm) ++count.far_moved, count.far_repeat += repeats;
  }
  std::vector<char> copies;
  for (const ExposureCount& count : counts) {
    const bool by_most = count.far_repeat >= kRowsMin && 2 * count.far_repeat >= count.far_moved;
    const bool by_all = count.moved > 0 && count.all >= kRowsMin && count.repeat == count.all &&
                        std::pow(share, count.all) < kCopyChance;
    copies.push_back(by_most || by_all ? 1 : 0);
  }
  return copies;
}

}  // namespace

RepeatedPlaces FindRepeatedPlaces(const Campaign& campaign) {
  RepeatedPlaces found;
  const std::vector<Revisit> revisits = RevisitsOf(campaign);
  if (std::ranges::none_of(revisits, &Revisit::repeats)) return found;
  const Exposures exposures = FindExposures(campaign);
  const double step_mm = FindPlaceSteps(campaign).wider_mm();
  const double share = ShareByChance(revisits, step_mm);
  const std::vector<char> copies = FindCopies(exposures, revisits, step_mm, share);
  const bool carried_on = AreCarriedOn(revisits, share);
  for (const Revisit& revisit : revisits) {
    if (!revisit.repeats()) continue;
    if (copies[exposures.of_row[revisit.row]] != 0)
      found.copied.push_back(revisit.row);
    else if (carried_on && revisit.moved_mm == 0)
      found.carried_on.push_back(revisit.row);
  }
  for (std::size_t e = 0; e < copies.size(); ++e)
    if (copies[e] != 0) found.copies.push_back(exposures.move_id[e]);
  return found;
}

RepeatedPlaces ForgetRepeatedPlaces(Campaign* campaign) {
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  RepeatedPlaces found = FindRepeatedPlaces(*campaign);
  for (const std::vector<std::size_t>* rows : {&found.carried_on, &found.copied})
    for (const std::size_t row : *rows) campaign->x_mm[row] = campaign->y_mm[row] = kMissing;
  return found;
}

}  // namespace focalfleet::sim
