// The power that each supply rail gives over the time of a plan, as a curve over slots of 50 ms. A
// motor counts in all slots in which it may run for any start skew and clock, as in power_ledger.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fleet/drive_power.h"
#include "fleet/layout.h"
#include "fleet/plan/planner.h"

namespace focalfleet {

class RailCurves {
 public:
  /// A motor that is on for some slots.
  struct Draw {
    std::size_t first = 0;
    std::size_t last = 0;  // included
    double power_W = 0;
    double lasts_s = 0;  // by nominal clocks
  };
  using Draws = std::vector<Draw>;

  /// Empty curves up to `within_s` by the units' own clocks. Lifetime: both outlive this.
  RailCurves(const PlanRequest& request, const PlanOptions& options, double within_s);

  [[nodiscard]] Draws DrawsOf(std::uint32_t unit, const AxisPaths& path);
  /// Adds what the unit draws to its rail and the total; a `sign` of -1 takes it away.
  void Add(std::uint32_t unit, const Draws& draws, double sign);
  /// Units: J.
  [[nodiscard]] static double Energy(const Draws& draws);

  /// The amount that the unit adds to SumOfSquares if it draws so. Pre: its own draws are not in
  /// the curves.
  [[nodiscard]] double AddedSquares(std::uint32_t unit, const Draws& draws, double free_W);
  /// Over all rails and slots, of the power that exceeds `free_W`. Units: W^2.
  [[nodiscard]] double SumOfSquares(double free_W) const;
  /// The rail of the unit is above `limit_W` in a slot in which the unit draws.
  [[nodiscard]] bool Exceeds(std::uint32_t unit, const Draws& draws, double limit_W) const;
  /// The limits of the options hold if the unit draws so. Pre: as AddedSquares.
  [[nodiscard]] bool KeepsLimits(std::uint32_t unit, const Draws& draws);
  /// The highest power of any rail, and the highest mean of any rail. Units: W.
  [[nodiscard]] double Peak() const;
  [[nodiscard]] double HighestMean() const;

 private:
  const PlanRequest& request_;
  const PlanOptions& options_;
  DrivePowers powers_;
  std::vector<std::uint32_t> rail_;         // by unit
  std::vector<std::vector<double>> rails_;  // W by slot
  std::vector<double> total_;               // W by slot
  std::vector<double> scratch_;
};

}  // namespace focalfleet
