#include "fleet/plan/rail_curves.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "fleet/estimate.h"

namespace focalfleet {
namespace {

constexpr double kSlotS = 0.05;

}  // namespace

RailCurves::RailCurves(const PlanRequest& request, const PlanOptions& options, double within_s)
    : request_(request), options_(options), powers_(options.motor) {
  const double last_s = within_s / (1 - options.clock_error) + options.start_skew_s;
  const auto slots = static_cast<std::size_t>(last_s / kSlotS) + 2;
  std::map<std::uint32_t, std::uint32_t> rails;
  for (const Unit& unit : request.layout->units())
    rail_.push_back(
        rails.emplace(unit.rail.value, static_cast<std::uint32_t>(rails.size())).first->second);
  rails_.assign(rails.size(), std::vector<double>(slots, 0));
  total_.assign(slots, 0);
}

RailCurves::Draws RailCurves::DrawsOf(std::uint32_t unit, const AxisPaths& path) {
  const UnitDrive& drive = request_.drives[unit];
  Draws draws;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    for (const Segment& segment : path[k].segments()) {
      const SegmentTime time = TimeOf(segment, drive.axis[k]);
      const double first_s = time.t0_s / (1 + options_.clock_error) - options_.start_skew_s;
      const double last_s = time.t1_s / (1 - options_.clock_error) + options_.start_skew_s;
      const double power_W =
          powers_.Of({AsSent(segment, drive.axis[k]), drive.mode, drive.v_bus_V}).total_W();
      draws.push_back({static_cast<std::size_t>(std::max(0.0, first_s / kSlotS)),
                       static_cast<std::size_t>(last_s / kSlotS), power_W, time.t1_s - time.t0_s});
    }
  return draws;
}

void RailCurves::Add(std::uint32_t unit, const Draws& draws, double sign) {
  std::vector<double>& rail = rails_[rail_[unit]];
  for (const Draw& draw : draws)
    for (std::size_t n = draw.first; n <= draw.last && n < rail.size(); ++n) {
      rail[n] += sign * draw.power_W;
      total_[n] += sign * draw.power_W;
    }
}

double RailCurves::Energy(const Draws& draws) {
  double energy_J = 0;
  for (const Draw& draw : draws) energy_J += draw.power_W * draw.lasts_s;
  return energy_J;
}

double RailCurves::AddedSquares(std::uint32_t unit, const Draws& draws, double free_W) {
  const std::vector<double>& rail = rails_[rail_[unit]];
  scratch_.assign(rail.size(), 0);
  std::size_t first = rail.size();
  std::size_t last = 0;
  for (const Draw& draw : draws) {
    first = std::min(first, draw.first);
    last = std::max(last, std::min(draw.last + 1, rail.size()));
    for (std::size_t n = draw.first; n <= draw.last && n < rail.size(); ++n)
      scratch_[n] += draw.power_W;
  }
  double added = 0;
  for (std::size_t n = first; n < last; ++n) {
    const double with = std::max(rail[n] + scratch_[n] - free_W, 0.0);
    const double without = std::max(rail[n] - free_W, 0.0);
    added += with * with - without * without;
  }
  return added;
}

double RailCurves::SumOfSquares(double free_W) const {
  double sum = 0;
  for (const std::vector<double>& rail : rails_)
    for (const double power_W : rail) {
      const double over = std::max(power_W - free_W, 0.0);
      sum += over * over;
    }
  return sum;
}

bool RailCurves::Exceeds(std::uint32_t unit, const Draws& draws, double limit_W) const {
  const std::vector<double>& rail = rails_[rail_[unit]];
  return std::any_of(draws.begin(), draws.end(), [&](const Draw& draw) {
    for (std::size_t n = draw.first; n <= draw.last && n < rail.size(); ++n)
      if (rail[n] > limit_W) return true;
    return false;
  });
}

bool RailCurves::KeepsLimits(std::uint32_t unit, const Draws& draws) {
  if (!options_.power.any()) return true;
  constexpr double kRoundingW = 1e-9;
  Add(unit, draws, 1);
  const std::vector<double>& rail = rails_[rail_[unit]];
  bool kept = true;
  for (const Draw& draw : draws)
    for (std::size_t n = draw.first; n <= draw.last && n < rail.size() && kept; ++n)
      kept = (options_.power.rail_W <= 0 || rail[n] <= options_.power.rail_W + kRoundingW) &&
             (options_.power.total_W <= 0 || total_[n] <= options_.power.total_W + kRoundingW);
  Add(unit, draws, -1);
  return kept;
}

double RailCurves::Peak() const {
  double peak_W = 0;
  for (const std::vector<double>& rail : rails_)
    peak_W = std::max(peak_W, *std::max_element(rail.begin(), rail.end()));
  return peak_W;
}

double RailCurves::HighestMean() const {
  double mean_W = 0;
  for (const std::vector<double>& rail : rails_)
    mean_W = std::max(
        mean_W, std::accumulate(rail.begin(), rail.end(), 0.0) / static_cast<double>(rail.size()));
  return mean_W;
}

}  // namespace focalfleet
