// A positioner as its maker describes it: its place, the lengths of its arms, its address. The
// simulation has this type of its own and shares nothing with the coordinator's layout, so that a
// mistake in one shows in the other.
#pragma once

#include <array>
#include <optional>

#include "protocol/base/ids.h"
#include "protocol/wire/messages.h"

namespace focalfleet::sim {

struct AxisDescription {
  double arm_mm = 0;
  double zero_deg = 0;  // added to the axis' own angle in the kinematics
  double gear = 1;      // motor revolutions per output revolution
  double min_deg = 0;   // range of the axis' own angle
  double max_deg = 0;
  /// The angle at first; none: folded (FirstPoseDeg in spread.h). Snapped to a whole vector.
  std::optional<double> angle_deg;
};

struct UnitDescription {
  UnitId id;
  BusId bus;
  NodeId node;
  SerialNumber serial;  // 0: derived from the id
  double base_x_mm = 0;
  double base_y_mm = 0;
  std::array<AxisDescription, kAxisCount> axis;
  std::uint8_t sensors = 0;     // Hall sensors at its joint (unit/joint_sensors.h)
  double fibre_carrier_mm = 0;  // from the joint's centre to the fibre, where it has such sensors
  bool enabled = true;          // false: only its default pose differs; it answers like any other
  /// The seconds of its clock a true second, less 1; none: drawn (WorldConfig::clock_error_max).
  std::optional<double> clock_error = {};
};

/// The content of FLASH when a unit leaves the factory, both axes alike.
struct FactoryDrive {
  std::int32_t counter1 = 500;
  std::int32_t repeat = 108;
  std::int32_t subdivision = 96;
  WaveMode mode = WaveMode::kAsymmetric;
  std::int32_t host_timeout_ms = 5000;
  double v_bus_V = 1.8;
};

}  // namespace focalfleet::sim
