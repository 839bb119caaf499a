// The orientation of a ball joint, and the place of a fixed sensor as the joint's rotor sees it.
// The rotor is turned by R = Rx(alpha) Ry(beta) Rz(gamma); a sensor in direction p of the stator
// stands in direction R^T p of the rotor. Each factor is undone by itself, so that the derivatives
// by the three angles cost only a few products.
//
// Frames: stator (X, Y, Z: sensors), rotor (x, y, z: magnets). They agree at alpha = beta = gamma =
// 0. Source: [HallOrientation2014] section "Results", its three rotations.
#pragma once

#include <cmath>
#include <numbers>

namespace focalfleet::sim {

inline constexpr double kRadPerDeg = std::numbers::pi / 180;

struct Vector3 {
  double x = 0;
  double y = 0;
  double z = 0;
};
inline Vector3 operator+(const Vector3& a, const Vector3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vector3 operator-(const Vector3& a, const Vector3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vector3 operator*(double s, const Vector3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline double Dot(const Vector3& a, const Vector3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector3 Cross(const Vector3& a, const Vector3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double Length(const Vector3& a) { return std::sqrt(Dot(a, a)); }
/// Pre: a is not zero.
inline Vector3 Unit(const Vector3& a) { return (1 / Length(a)) * a; }

struct Orientation {
  double alpha_rad = 0;
  double beta_rad = 0;
  double gamma_rad = 0;
};

/// Direction in the rotor's frame and its derivatives by the three angles.
struct Turned {
  Vector3 local;
  Vector3 by_alpha;
  Vector3 by_beta;
  Vector3 by_gamma;
};

class Rotation {
 public:
  explicit Rotation(const Orientation& orientation)
      : cos_alpha_(std::cos(orientation.alpha_rad)),
        sin_alpha_(std::sin(orientation.alpha_rad)),
        cos_beta_(std::cos(orientation.beta_rad)),
        sin_beta_(std::sin(orientation.beta_rad)),
        cos_gamma_(std::cos(orientation.gamma_rad)),
        sin_gamma_(std::sin(orientation.gamma_rad)) {}

  /// R^T p.
  [[nodiscard]] Vector3 ToRotor(const Vector3& p) const {
    return UndoGamma(UndoBeta(UndoAlpha(p)));
  }

  [[nodiscard]] Turned ToRotorWithSlopes(const Vector3& p) const {
    const Vector3 after_alpha = UndoAlpha(p);
    const Vector3 after_beta = UndoBeta(after_alpha);
    Turned turned;
    turned.local = UndoGamma(after_beta);
    turned.by_gamma = {turned.local.y, -turned.local.x, 0};
    turned.by_beta = UndoGamma({-after_beta.z, 0, after_beta.x});
    turned.by_alpha = UndoGamma(UndoBeta({0, after_alpha.z, -after_alpha.y}));
    return turned;
  }

 private:
  [[nodiscard]] Vector3 UndoAlpha(const Vector3& p) const {
    return {p.x, cos_alpha_ * p.y + sin_alpha_ * p.z, cos_alpha_ * p.z - sin_alpha_ * p.y};
  }
  [[nodiscard]] Vector3 UndoBeta(const Vector3& p) const {
    return {cos_beta_ * p.x - sin_beta_ * p.z, p.y, sin_beta_ * p.x + cos_beta_ * p.z};
  }
  [[nodiscard]] Vector3 UndoGamma(const Vector3& p) const {
    return {cos_gamma_ * p.x + sin_gamma_ * p.y, cos_gamma_ * p.y - sin_gamma_ * p.x, p.z};
  }

  double cos_alpha_, sin_alpha_, cos_beta_, sin_beta_, cos_gamma_, sin_gamma_;
};

}  // namespace focalfleet::sim
