// The focal plane by the units file: where each unit sits, how long its arms are, which supply and
// bus feed it. Frames: _fp is the focal plane in mm, seen from the sky side, angles
// counter-clockwise. A unit's moving part is its phi arm, the segment from elbow to fibre, with a
// half-width. Two units can only touch when their reaches overlap, so neighbours are found once, in
// a grid, in O(n).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct PointFp {
  double x_mm = 0;
  double y_mm = 0;
};

struct AxisGeometry {
  double arm_mm = 0;
  double zero_deg = 0;  // added to the axis' own angle in the kinematics
  double gear = 1;      // motor revolutions per output revolution
  double min_deg = 0;   // range of the axis' own angle
  double max_deg = 0;
};

/// No angle of a file, range or target is beyond 100 turns. Units: degrees.
inline constexpr double kAngleMaxDeg = 36'000;
/// The bus is not given: Create finds a place.
inline constexpr BusId kNoBus{UINT32_MAX};
/// The node is not given: Create takes the lowest that is free on the bus, in the order of the
/// units.
inline constexpr NodeId kNoNode{0};
/// The half-width that arms are given where none is stated, as a share of the distance to the
/// nearest neighbour.
inline constexpr double kHalfWidthShare = 0.08;
/// A coordinate on the plate beyond this is a mistake. Units: mm.
inline constexpr double kCoordinateMaxMm = 1e5;

struct Unit {
  UnitId id;
  PointFp base_fp;
  std::array<AxisGeometry, kAxisCount> axis;
  double arm_half_width_mm = 0;  // 0: Create takes 0.08 of the nearest neighbour's distance
  RailId rail;
  BusId bus = kNoBus;
  NodeId node = kNoNode;
  /// The number of Hall sensors at the joint of its fibre carrier, and the carrier's length to the
  /// fibre; 0: none. The unit then measures its tilt itself (docs/hall.md).
  std::uint8_t sensors = 0;
  double carrier_mm = 0;
  bool enabled = true;  // false: stands where it is, an obstacle
  // Places along the harness and grouping: kept for the user, nothing in here depends on them.
  std::optional<std::uint32_t> rail_slot;
  std::optional<std::uint32_t> bus_slot;
  std::optional<std::uint32_t> group;

  [[nodiscard]] const AxisGeometry& theta() const { return axis[Index(Axis::kTheta)]; }
  [[nodiscard]] const AxisGeometry& phi() const { return axis[Index(Axis::kPhi)]; }
  /// The farthest distance of any point of the arm, half-width included, from the base.
  [[nodiscard]] double reach_mm() const {
    return theta().arm_mm + phi().arm_mm + arm_half_width_mm;
  }
};

struct Obstacle {
  std::uint32_t id = 0;
  PointFp centre_fp;
  double radius_mm = 0;
};

/// A light at a known place of the plate, for the camera.
struct Fiducial {
  std::uint32_t id = 0;
  PointFp at_fp;
};

/// The fault of this unit by itself (a number that is not finite, an arm without length, an empty
/// range), or an empty text. Bus, node and neighbours are not checked.
std::string FaultOf(const Unit& unit);

class Layout {
 public:
  struct Options {
    double clearance_mm = 0;  // 0: 0.012 of the pitch
    std::vector<Obstacle> obstacles;
  };

  /// Checks the units (unique ids, finite numbers, positive arms, min < max, unique bus and node,
  /// limits) and finds pitch, half-widths and neighbours. Units without a bus are spread in order,
  /// 100 a bus, on buses above all that were given (from 0 where none was). Errors: kInvalid, names
  /// the unit. Cost: O(n) for an even plate.
  static Result<Layout> Create(std::vector<Unit> units, Options options);

  /// The layout of these units alone, with this one's clearance and obstacles. Errors: as Create.
  [[nodiscard]] Result<Layout> Part(std::span<const PositionerIndex> chosen) const;

  [[nodiscard]] std::span<const Unit> units() const { return units_; }
  [[nodiscard]] const Unit& unit(PositionerIndex i) const { return units_[i.value]; }
  [[nodiscard]] std::size_t size() const { return units_.size(); }
  [[nodiscard]] std::span<const Obstacle> obstacles() const { return obstacles_; }
  [[nodiscard]] std::optional<PositionerIndex> Find(UnitId id) const;
  [[nodiscard]] std::optional<PositionerIndex> Find(BusId bus, NodeId node) const;
  /// All buses, sorted, without duplicates.
  [[nodiscard]] std::span<const BusId> buses() const { return buses_; }
  /// Units whose reach overlaps this one's, clearance included; ascending.
  [[nodiscard]] std::span<const PositionerIndex> neighbours(PositionerIndex i) const;
  /// Median distance to the nearest neighbour; of a single unit, twice its reach.
  [[nodiscard]] double pitch_mm() const { return pitch_mm_; }
  [[nodiscard]] double clearance_mm() const { return clearance_mm_; }
  [[nodiscard]] double nearest_mm(PositionerIndex i) const { return nearest_mm_[i.value]; }

 private:
  Status MeasurePitch(double clearance_mm);
  Status FindNeighbours();

  std::vector<Unit> units_;
  std::vector<Obstacle> obstacles_;
  std::vector<BusId> buses_;
  std::vector<double> nearest_mm_;
  std::vector<std::uint32_t> neighbour_begin_;  // n + 1 offsets into neighbour_
  std::vector<PositionerIndex> neighbour_;
  std::unordered_map<UnitId, PositionerIndex> by_id_;
  std::unordered_map<std::uint64_t, PositionerIndex> by_address_;
  double pitch_mm_ = 0;
  double clearance_mm_ = 0;
};

}  // namespace focalfleet
