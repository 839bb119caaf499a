#include "fleet/plan/power_ledger.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "fleet/estimate.h"

namespace focalfleet {

PowerLedger::PowerLedger(const Layout& layout, std::span<const UnitDrive> drives,
                         const MotorModel& motor, const PowerLimits& limits,
                         const Tolerance& tolerance)
    : drives_(drives), powers_(motor), limits_(limits), tolerance_(tolerance) {
  std::map<std::uint32_t, std::uint32_t> index;
  for (const Unit& unit : layout.units()) {
    const auto [it, fresh] =
        index.emplace(unit.rail.value, static_cast<std::uint32_t>(index.size()));
    rail_.push_back(it->second);
  }
  rails_.resize(index.size());
}

double PowerLedger::Power(std::uint32_t unit, std::size_t axis, const Segment& segment) {
  const UnitDrive& drive = drives_[unit];
  return powers_.Of({AsSent(segment, drive.axis[axis]), drive.mode, drive.v_bus_V}).total_W();
}

PowerLedger::Slots PowerLedger::SlotsOf(const Segment& segment, const AxisDrive& drive) const {
  const SegmentTime time = TimeOf(segment, drive);
  const double error = tolerance_.clock_error;
  const double first_s = time.t0_s / (1 + error) - tolerance_.start_skew_s;
  const double last_s = time.t1_s / (1 - error) + tolerance_.start_skew_s;
  return {static_cast<std::size_t>(std::max(0.0, std::floor(first_s / kSlotS))),
          static_cast<std::size_t>(std::floor(last_s / kSlotS))};
}

void PowerLedger::Add(std::uint32_t unit, const AxisPaths& path, double sign) {
  std::vector<std::int64_t>& rail = rails_[rail_[unit]];
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    for (const Segment& segment : path[k].segments()) {
      const std::int64_t power = Nanowatts(sign * Power(unit, k, segment));
      const Slots slots = SlotsOf(segment, drives_[unit].axis[k]);
      if (rail.size() <= slots.last) rail.resize(slots.last + 1, 0);
      if (total_.size() <= slots.last) total_.resize(slots.last + 1, 0);
      for (std::size_t n = slots.first; n <= slots.last; ++n) {
        rail[n] += power;
        total_[n] += power;
      }
    }
  }
}

bool PowerLedger::Kept(std::uint32_t unit, const AxisPaths& path) const {
  const std::vector<std::int64_t>& rail = rails_[rail_[unit]];
  const std::int64_t rail_most = Nanowatts(limits_.rail_W);
  const std::int64_t total_most = Nanowatts(limits_.total_W);
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    for (const Segment& segment : path[k].segments()) {
      const Slots slots = SlotsOf(segment, drives_[unit].axis[k]);
      for (std::size_t n = slots.first; n <= slots.last; ++n) {
        if (rail_most > 0 && rail[n] > rail_most) return false;
        if (total_most > 0 && total_[n] > total_most) return false;
      }
    }
  }
  return true;
}

bool PowerLedger::Enter(std::uint32_t unit, const AxisPaths& path) {
  Add(unit, path, 1);
  if (Kept(unit, path)) return true;
  Add(unit, path, -1);
  return false;
}

void PowerLedger::Remove(std::uint32_t unit, const AxisPaths& path) { Add(unit, path, -1); }

bool PowerLedger::Fits(std::uint32_t unit, const AxisPaths& path, const AxisPaths& instead_of) {
  Add(unit, instead_of, -1);
  Add(unit, path, 1);
  const bool fits = Kept(unit, path);
  Add(unit, path, -1);
  Add(unit, instead_of, 1);
  return fits;
}

bool PowerLedger::HasRoom(std::uint32_t unit, double power_W, double from_s, double to_s) const {
  const double error = tolerance_.clock_error;
  const double first_s = std::max(0.0, from_s / (1 + error) - tolerance_.start_skew_s);
  const double last_s = to_s / (1 - error) + tolerance_.start_skew_s;
  const auto last = static_cast<std::size_t>(last_s / kSlotS);
  const auto over = [&](const std::vector<std::int64_t>& sums, double most_W) {
    if (most_W <= 0) return false;
    for (auto n = static_cast<std::size_t>(first_s / kSlotS); n <= last; ++n)
      if ((n < sums.size() ? sums[n] : 0) + Nanowatts(power_W) > Nanowatts(most_W)) return true;
    return false;
  };
  return !over(rails_[rail_[unit]], limits_.rail_W) && !over(total_, limits_.total_W);
}

double PowerLedger::BeginAfter(double end_s) const {
  const double last_s = end_s / (1 - tolerance_.clock_error) + tolerance_.start_skew_s;
  return (last_s + kSlotS + tolerance_.start_skew_s) * (1 + tolerance_.clock_error);
}

double PowerLedger::Energy(std::uint32_t unit, const AxisPaths& path) {
  double energy_J = 0;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    for (const Segment& segment : path[k].segments()) {
      const SegmentTime time = TimeOf(segment, drives_[unit].axis[k]);
      energy_J += Power(unit, k, segment) * (time.t1_s - time.t0_s);
    }
  }
  return energy_J;
}

}  // namespace focalfleet
