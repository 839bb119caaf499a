// The field of a rotor's magnets, from magnetised pieces in air (iron-free, mu_r = 1: pieces add).
// Poles are tiles of a spherical shell, magnetised along the tile's middle direction or radially,
// in turn outwards and inwards. Each tile is a cloud of dipoles at the nodes of a Gauss-Legendre
// rule in radius, latitude and longitude. A sensor is never nearer to a tile than about a third of
// a tile's width. At that distance 10 nodes a direction agree with 24 to 2e-6 of the peak.
//
// The paper's 2D array is one shell, its 3D array two. The sensors at 59 mm stand between the inner
// and the outer shell, so part of the field comes from within and part from without.
//
// The paper gives no dimensions. The defaults are iron-free shells whose equatorial field falls off
// as its fitted surfaces do. Units: mm, T (remanence), radians.
#pragma once

#include <vector>

#include "sim/hall/rotation.h"

namespace focalfleet::sim {

struct MagnetShell {
  double inner_radius_mm = 34;
  double outer_radius_mm = 44;
  double half_height_rad = 20.09 * kRadPerDeg;  // of latitude
  int poles = 8;
  double pole_share = 0.9;  // of the pitch in longitude
  double remanence_T = 1.2;
  bool radial = true;             // else parallel to the tile's middle
  double first_pole_rad = 0;      // longitude of a pole that points outwards
  std::vector<double> strength;   // per pole, 1 where empty: magnets always differ
  std::vector<double> shift_rad;  // per pole in longitude, 0 where empty
};

/// The paper's arrays, as far as known: the fit of their field has the paper's widths.
std::vector<MagnetShell> OneShellArray();  // "2D"
std::vector<MagnetShell> TwoShellArray();  // "3D"

class MagnetArray {
 public:
  /// Nodes a direction and tile. Cost of a field: poles * nodes^3 dipoles a shell.
  explicit MagnetArray(const std::vector<MagnetShell>& shells, int nodes = 10);

  /// The flux density at a place outside the magnets. Frame: rotor. Units: mm in, T out.
  [[nodiscard]] Vector3 Field_T(const Vector3& place_mm) const;

  /// The radial part in a direction (unit vector). Units: mm in, T out.
  [[nodiscard]] double Radial_T(const Vector3& direction, double radius_mm) const {
    return Dot(Field_T(radius_mm * direction), direction);
  }

 private:
  struct Dipole {
    Vector3 place_mm;
    Vector3 moment_T_mm3;  // mu0 m / (4 pi)
  };
  std::vector<Dipole> dipoles_;
};

}  // namespace focalfleet::sim
