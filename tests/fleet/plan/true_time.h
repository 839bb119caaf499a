// Plans in true time for tests: every unit runs by a clock of its own, and rows end where a unit is
// stopped.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "fleet/layout.h"
#include "fleet/plan/planner.h"
#include "protocol/base/rng.h"
#include "tests/support/plan_checker.h"

namespace focalfleet::test {

inline constexpr double kNever = std::numeric_limits<double>::infinity();

struct Clock {
  double skew_s = 0;
  double rate = 1;  // own seconds per true second
  [[nodiscard]] double Own(double true_s) const { return (true_s - skew_s) * rate; }
  [[nodiscard]] double True(double own_s) const { return own_s / rate + skew_s; }
};

/// A clock within the tolerance that the plan allows for; half of them are at its corners.
inline Clock DrawClock(Rng* rng, const PlanOptions& options) {
  const auto draw = [&](double most) {
    const double u = rng->Uniform(-1, 1);
    return rng->Uniform() < 0.5 ? std::copysign(most, u) : most * u;
  };
  const double skew_s = draw(options.start_skew_s);
  return {skew_s, 1 + draw(options.clock_error)};
}

using Pair = std::pair<std::uint32_t, std::uint32_t>;  // indices of units, lower first

/// Appends the rest of the rows of one motion between `since_s` and `stop_s`, in true time after
/// `since_s`. `unit` then stands where the rows have brought it by `since_s`. The motion began
/// `offset_s` after the start signal of the configuration.
inline void LayRows(std::span<const CheckedRow> motion, const Clock& clock, double offset_s,
                    double since_s, double stop_s, CheckedUnit* unit,
                    std::vector<CheckedRow>* rows) {
  for (const CheckedRow& row : motion) {
    const double t0 = offset_s + clock.True(row.t0_s);
    const double t1 = offset_s + clock.True(row.t1_s);
    const double begin = std::max(t0, since_s);
    const double end = std::min(t1, stop_s);
    const auto at = [&](double t) {
      if (t <= t0) return row.from_deg;
      if (t >= t1) return row.to_deg;
      return row.from_deg + (row.to_deg - row.from_deg) * (t - t0) / (t1 - t0);
    };
    if (t0 < since_s) unit->axis[row.axis].start_deg = at(std::min(since_s, end));
    if (end <= begin) continue;
    rows->push_back({row.unit, row.axis, begin - since_s, end - since_s, at(begin), at(end)});
  }
}

struct UnclearPairs {
  std::set<Pair> pairs;
  std::string text;  // the checker's words
};

/// The pairs that the checker found not clear. Any other fault is a failure of the test.
inline UnclearPairs PairsIn(const CheckReport& report, const Layout& layout) {
  UnclearPairs unclear;
  for (const std::string& fault : report.faults) {
    if (!fault.starts_with("units ")) {
      ADD_FAILURE() << fault;
      continue;
    }
    const auto index = [&](std::size_t at) {
      return layout.Find(UnitId{static_cast<std::uint32_t>(std::stoul(fault.substr(at)))})->value;
    };
    unclear.pairs.insert(std::minmax(index(6), index(fault.find(" and ") + 5)));
    unclear.text += fault + "\n";
  }
  return unclear;
}

}  // namespace focalfleet::test
