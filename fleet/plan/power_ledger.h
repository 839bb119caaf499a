// The power that each supply rail gives at every moment of a plan in the making, against what it
// may give. Time is cut into slots. A motor that may run at any moment of a slot, for any start
// skew and clock, is counted for all of it. A motion that fits here keeps the limits at every
// instant of the nominal rows and of all rows that the tolerance allows.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "fleet/drive_power.h"
#include "fleet/layout.h"
#include "fleet/plan/track.h"

namespace focalfleet {

struct PowerLimits {
  double rail_W = 0;   // of each rail; 0: none
  double total_W = 0;  // of all rails together; 0: none
  [[nodiscard]] bool any() const { return rail_W > 0 || total_W > 0; }
};

class PowerLedger {
 public:
  PowerLedger(const Layout& layout, std::span<const UnitDrive> drives, const MotorModel& motor,
              const PowerLimits& limits, const Tolerance& tolerance);

  /// Enters the motion of a unit where it keeps the limits. False: it does not, and nothing
  /// changes.
  bool Enter(std::uint32_t unit, const AxisPaths& path);
  /// Enters a motion that is under way already, whatever the limits say.
  void EnterAnyway(std::uint32_t unit, const AxisPaths& path) { Add(unit, path, 1); }
  void Remove(std::uint32_t unit, const AxisPaths& path);
  /// Units that are entered from now on may start this early or late.
  void WidenSkew(double start_skew_s) { tolerance_.start_skew_s = start_skew_s; }
  /// True: `path` would keep the limits if the unit left `instead_of`, which is entered.
  bool Fits(std::uint32_t unit, const AxisPaths& path, const AxisPaths& instead_of);

  /// Whether the rail of the unit has room for `power_W` more, whenever by its own clock within
  /// these times. Units: s.
  [[nodiscard]] bool HasRoom(std::uint32_t unit, double power_W, double from_s, double to_s) const;

  /// The soonest begin of a segment that shares no slot with one that ends at `end_s`. Units: s.
  [[nodiscard]] double BeginAfter(double end_s) const;

  /// Energy of the motion by nominal clocks. Units: J.
  double Energy(std::uint32_t unit, const AxisPaths& path);
  /// The power of one motor as it is driven: no limit below it lets it turn. Units: W.
  [[nodiscard]] double Motor_W(std::uint32_t unit, std::size_t axis) {
    const UnitDrive& drive = drives_[unit];
    return powers_.Of({drive.axis[axis], drive.mode, drive.v_bus_V}).total_W();
  }

 private:
  static constexpr double kSlotS = 0.05;
  void Add(std::uint32_t unit, const AxisPaths& path, double sign);
  [[nodiscard]] bool Kept(std::uint32_t unit, const AxisPaths& path) const;
  struct Slots {
    std::size_t first = 0;
    std::size_t last = 0;  // included
  };
  [[nodiscard]] Slots SlotsOf(const Segment& segment, const AxisDrive& drive) const;
  double Power(std::uint32_t unit, std::size_t axis, const Segment& segment);
  static std::int64_t Nanowatts(double power_W) {
    return static_cast<std::int64_t>(std::llround(power_W * 1e9));
  }

  std::span<const UnitDrive> drives_;
  DrivePowers powers_;
  PowerLimits limits_;
  Tolerance tolerance_;
  std::vector<std::uint32_t> rail_;               // by unit: index into rails_
  std::vector<std::vector<std::int64_t>> rails_;  // nanowatts by slot, so that sums are exact
  std::vector<std::int64_t> total_;
};

}  // namespace focalfleet
