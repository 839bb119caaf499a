// Where each arm is, and when, on a raster of the plate: the time of a plan is cut into steps of
// equal length, and each cell of the raster has one bit a step. A bit is set where another unit's
// fibre or elbow, or any point between them, would come too near to the arm whose raster it is, for
// some start skew and clock.
//
// The raster decides nothing: a cell is a quarter as wide as the distance that arms keep, and a
// motion that it calls clear is proven by its track (track.h). The raster answers within
// nanoseconds whether a pose meets anything at each step, where the exact test of all neighbours
// takes a thousand times as long.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fleet/plan/motions.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/track.h"

namespace focalfleet {

/// The steps into which the time of a plan is cut.
struct TimeSteps {
  std::int64_t ticks = 0;  // of 100 us, one step
  std::int32_t count = 0;
  [[nodiscard]] double step_s() const { return static_cast<double>(ticks) * kTickS; }
  /// Words of 64 bits that hold one bit a step, and one more for the time after the last.
  [[nodiscard]] std::size_t words() const { return static_cast<std::size_t>(count) / 64 + 1; }
};

/// At most so many words hold one bit a step.
inline constexpr std::size_t kStepWordsMost = 8;

/// Steps in which the quickest unit turns by 6 degrees, until `end_s`. Where that is too many steps
/// they are longer. Shape: `drives` (n).
TimeSteps StepsUntil(const Scene& scene, std::span<const UnitDrive> drives, double end_s);

/// A part of the raster of the plate. Cells are counted from the plate's origin.
struct RasterWindow {
  double cell_mm = 1;
  std::int32_t x0 = 0;
  std::int32_t y0 = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  [[nodiscard]] std::size_t cells() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

/// A unit's surroundings at every step, seen from its own patrol disc.
struct Surround {
  RasterWindow window;
  std::vector<std::uint64_t> bits;  // Shape: (cells, words)
};

class Occupancy {
 public:
  /// Lifetime: `motions` outlives this.
  Occupancy(const Motions& motions, const TimeSteps& steps);

  [[nodiscard]] const TimeSteps& steps() const { return steps_; }
  /// The unit has another motion, or none.
  void Forget(std::uint32_t unit) { drawn_[unit] = 0; }
  /// All neighbours of `unit` as they move now, and what stands. Neighbours that were forgotten are
  /// drawn anew.
  void Look(std::uint32_t unit, Surround* out);

 private:
  void Draw(std::uint32_t unit);
  void DrawArm(std::uint32_t unit, const SegmentFp& line, std::int32_t first, std::int32_t last);
  void FindStanding(std::uint32_t unit);

  const Motions& motions_;
  const Scene& scene_;
  TimeSteps steps_;
  double cell_mm_ = 1;
  std::vector<double> radius_mm_;  // by unit: nearer than this to its core is too near
  std::vector<RasterWindow> windows_;
  std::vector<std::uint8_t> drawn_;
  std::vector<std::vector<std::uint64_t>> bits_;     // by unit; empty: nowhere
  std::vector<std::vector<std::int32_t>> standing_;  // by unit: cells of its disc never free
};

}  // namespace focalfleet
