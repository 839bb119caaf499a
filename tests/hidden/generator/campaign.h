// A campaign of the generator has the plate and the commands with their conditions, and no results
// yet. Rows are move by move with every unit in each, so that row = move * units + unit. A unit
// that is not moved is commanded to its present pose.
//
// The generator has physics of its own and shares no line with the simulation. Its purpose is to
// test the diagnosis, which must not be tested against its own assumptions.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace focalfleet::hidden {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kDegree = kPi / 180;  // rad

enum AxisIndex : std::size_t { kTheta = 0, kPhi = 1, kAxes = 2 };

/// Place on the plate. Units: mm. Frame: focal plane, seen from the sky side.
using Place = std::complex<double>;
using ByAxis = std::array<double, kAxes>;

struct Geometry {
  Place base_mm;
  ByAxis arm_mm{};
  ByAxis zero_deg{};
};

/// The place of the fibre with the axes at these angles: the kinematics that all of the project
/// shares.
Place FibreAt(const Geometry& geometry, const ByAxis& angle_deg);

struct Unit {
  int id = 0;
  Geometry believed;  // as in units.csv
  ByAxis gear{};      // motor revolutions per output revolution
  ByAxis min_deg{};
  ByAxis max_deg{};
  int rail = 0;
  int rail_slot = 0;
  int bus = 0;
  int bus_slot = 0;
};

struct Row {
  ByAxis from_deg{};
  ByAxis cmd_deg{};
  bool rehomed = false;
  bool exposed = true;  // false: a unidirectional approach without a picture
  double delay_s = 0;   // since this unit last stood still
  double temp_C = 0;    // true
  double v_bus_V = 0;
  int movers_on_rail = 0;
  int bus_slot = 0;
  ByAxis cycles{};
  [[nodiscard]] bool Moved(std::size_t axis) const { return cmd_deg[axis] != from_deg[axis]; }
};

/// Conditions that all units share in one move.
struct Exposure {
  double t_s = 0;
  double elevation_deg = 90;
  double drive_amplitude = 1;
  double air_C = 10;
  Place gradient_C_per_mm;  // of the plate's temperature
  double humidity = 50;     // relative, per cent
  double wind_m_s = 0;
  // Phase of a circulation pump: a covariate that no cause of the library names.
  double pump_deg = 0;
};

struct Campaign {
  std::string design;  // survey, diagnostic, arcs
  std::vector<Unit> units;
  std::vector<Exposure> exposures;
  std::vector<Row> rows;
  double v_nominal_V = 0;
  double temp_mean_C = 0;
  double v_mean_V = 0;
  double pitch_mm = 0;
  double plate_radius_mm = 0;
  double pixel_mm = 0;
  Place pixel_origin_mm;

  [[nodiscard]] std::size_t unit_count() const { return units.size(); }
  [[nodiscard]] std::size_t move_count() const { return exposures.size(); }
  [[nodiscard]] const Row& At(std::size_t move, std::size_t unit) const {
    return rows[move * units.size() + unit];
  }
  [[nodiscard]] Row& At(std::size_t move, std::size_t unit) {
    return rows[move * units.size() + unit];
  }
};

}  // namespace focalfleet::hidden
