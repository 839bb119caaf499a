#include "sim/hall/magnet_array.h"

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

struct Rule {
  std::vector<double> node;  // in -1..1
  std::vector<double> weight;
};

// The roots of the Legendre polynomial, by Newton's method from Tricomi's guess.
Rule GaussLegendre(int n) {
  Rule rule;
  for (int k = 0; k < n; ++k) {
    double x = std::cos(std::numbers::pi * (k + 0.75) / (n + 0.5));
    double slope = 1;
    for (int step = 0; step < 50; ++step) {
      double before = 1, value = x;
      for (int l = 2; l <= n; ++l) {
        const double next = ((2 * l - 1) * x * value - (l - 1) * before) / l;
        before = value;
        value = next;
      }
      slope = n * (x * value - before) / (x * x - 1);
      const double change = value / slope;
      x -= change;
      if (std::abs(change) < 1e-15) break;
    }
    rule.node.push_back(x);
    rule.weight.push_back(2 / ((1 - x * x) * slope * slope));
  }
  return rule;
}

Vector3 Direction(double latitude_rad, double longitude_rad) {
  return {std::cos(latitude_rad) * std::cos(longitude_rad),
          std::cos(latitude_rad) * std::sin(longitude_rad), std::sin(latitude_rad)};
}

}  // namespace

std::vector<MagnetShell> OneShellArray() { return {MagnetShell{}}; }

std::vector<MagnetShell> TwoShellArray() {
  return {MagnetShell{},
          MagnetShell{
              .inner_radius_mm = 85, .outer_radius_mm = 92.7, .half_height_rad = 11 * kRadPerDeg}};
}

MagnetArray::MagnetArray(const std::vector<MagnetShell>& shells, int nodes) {
  FOCALFLEET_CHECK(nodes > 0 && nodes < 100);
  const Rule rule = GaussLegendre(nodes);
  const auto at = [](const std::vector<double>& list, int pole, double otherwise) {
    const auto k = static_cast<std::size_t>(pole);
    return k < list.size() ? list[k] : otherwise;
  };
  for (const MagnetShell& shell : shells) {
    const double pitch_rad = 2 * std::numbers::pi / shell.poles;
    const double half_width_rad = shell.pole_share * pitch_rad / 2;
    const double half_depth_mm = (shell.outer_radius_mm - shell.inner_radius_mm) / 2;
    const double middle_mm = (shell.outer_radius_mm + shell.inner_radius_mm) / 2;
    for (int pole = 0; pole < shell.poles; ++pole) {
      const double centre_rad =
          shell.first_pole_rad + pole * pitch_rad + at(shell.shift_rad, pole, 0);
      const double sign = (pole % 2 == 0 ? 1 : -1) * at(shell.strength, pole, 1);
      for (std::size_t i = 0; i < rule.node.size(); ++i)
        for (std::size_t j = 0; j < rule.node.size(); ++j)
          for (std::size_t k = 0; k < rule.node.size(); ++k) {
            const double radius_mm = middle_mm + half_depth_mm * rule.node[i];
            const double latitude_rad = shell.half_height_rad * rule.node[j];
            const double longitude_rad = centre_rad + half_width_rad * rule.node[k];
            const double volume_mm3 = rule.weight[i] * rule.weight[j] * rule.weight[k] *
                                      half_depth_mm * shell.half_height_rad * half_width_rad *
                                      radius_mm * radius_mm * std::cos(latitude_rad);
            const Vector3 out = Direction(latitude_rad, longitude_rad);
            const Vector3 axis = shell.radial ? out : Direction(0, centre_rad);
            dipoles_.push_back({radius_mm * out, sign * shell.remanence_T * volume_mm3 /
                                                     (4 * std::numbers::pi) * axis});
          }
    }
  }
}

Vector3 MagnetArray::Field_T(const Vector3& place_mm) const {
  Vector3 sum;
  for (const Dipole& dipole : dipoles_) {
    const Vector3 way = place_mm - dipole.place_mm;
    const double inverse = 1 / Dot(way, way);
    const double cube = inverse * std::sqrt(inverse);
    sum = sum + cube * (3 * inverse * Dot(dipole.moment_T_mm3, way) * way - dipole.moment_T_mm3);
  }
  return sum;
}

}  // namespace focalfleet::sim
