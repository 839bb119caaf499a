// The Kalman filter of the two rest errors of a unit (whiten.h), one row at a time.
#pragma once

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/whiten.h"

namespace focalfleet::sim {

/// Call Move for each move of the track. For each row that is used, then call See, SquareLength,
/// Take, Whiten.
class RestFilter {
 public:
  /// `factor` multiplies all of the unit's noise.
  RestFilter(const Noise& noise, double factor)
      : carry_{noise.carry[0], noise.carry[1]}, least2_(noise.least_um * noise.least_um) {
    const double f2 = factor * factor;
    place2_ = f2 * noise.place_um * noise.place_um;
    for (int a = 0; a < 2; ++a) {
      angle2_[a] = f2 * noise.angle_deg[a] * noise.angle_deg[a];
      rest2_[a] = f2 * noise.rest_deg[a] * noise.rest_deg[a];
      p_[2 * a] = rest2_[a];
    }
  }

  void Move(bool restarts, bool theta_moves, bool phi_moves) {
    if (restarts) {
      p_[0] = rest2_[0], p_[1] = 0, p_[2] = rest2_[1];
      keep_[0] = keep_[1] = 0;
      return;
    }
    if (theta_moves) {
      p_[0] = carry_[0] * carry_[0] * p_[0] + rest2_[0];
      p_[1] *= carry_[0], keep_[0] *= carry_[0];
    }
    if (phi_moves) {
      p_[2] = carry_[1] * carry_[1] * p_[2] + rest2_[1];
      p_[1] *= carry_[1], keep_[1] *= carry_[1];
    }
  }

  /// Predicts the row's covariance before its place is known. t: d place / d theta, d phi; um per
  /// degree.
  void See(const double* t, double exposure_factor) {
    e_[0] *= keep_[0], e_[1] *= keep_[1];
    const double a = p_[0] + angle2_[0], c = p_[2] + angle2_[1], b = p_[1];
    const double v = std::max(place2_ * exposure_factor * exposure_factor, least2_);
    s_[0] = v + a * t[0] * t[0] + 2 * b * t[0] * t[2] + c * t[2] * t[2];
    s_[1] = a * t[0] * t[1] + b * (t[0] * t[3] + t[1] * t[2]) + c * t[2] * t[3];
    s_[2] = v + a * t[1] * t[1] + 2 * b * t[1] * t[3] + c * t[3] * t[3];
    det_ = std::max(s_[0] * s_[2] - s_[1] * s_[1], 1e-30);
    t_ = t;
  }

  /// The squared length of the residual, in sigmas.
  [[nodiscard]] double SquareLength(double x_um, double y_um) const {
    const double x = x_um - t_[0] * e_[0] - t_[2] * e_[1];
    const double y = y_um - t_[1] * e_[0] - t_[3] * e_[1];
    return (s_[2] * x * x - 2 * s_[1] * x * y + s_[0] * y * y) / det_;
  }
  [[nodiscard]] double determinant() const { return det_; }

  /// Updates the filter with the row at this weight.
  RowFilter Take(double weight) {
    RowFilter out{};
    out.keep[0] = keep_[0], out.keep[1] = keep_[1];
    keep_[0] = keep_[1] = 1;
    // Symmetric inverse root of s: root = (s + d I) / t, inverted by the adjugate.
    const double d = std::sqrt(det_), t = std::sqrt(s_[0] + s_[2] + 2 * d);
    const double scale = std::sqrt(weight) / (t * d);
    out.w[0] = (s_[2] + d) * scale, out.w[1] = -s_[1] * scale, out.w[2] = (s_[0] + d) * scale;
    // gain = weight P H' / s, with P H' = h.
    const double h[4] = {p_[0] * t_[0] + p_[1] * t_[2], p_[0] * t_[1] + p_[1] * t_[3],
                         p_[1] * t_[0] + p_[2] * t_[2], p_[1] * t_[1] + p_[2] * t_[3]};
    for (int a = 0; a < 2; ++a) {
      out.gain[2 * a] = weight * (h[2 * a] * s_[2] - h[2 * a + 1] * s_[1]) / det_;
      out.gain[2 * a + 1] = weight * (h[2 * a + 1] * s_[0] - h[2 * a] * s_[1]) / det_;
    }
    p_[0] = std::max(p_[0] - out.gain[0] * h[0] - out.gain[1] * h[1], 0.0);
    p_[1] -= out.gain[0] * h[2] + out.gain[1] * h[3];
    p_[2] = std::max(p_[2] - out.gain[2] * h[2] - out.gain[3] * h[3], 0.0);
    return out;
  }

  /// Writes the row's two whitened numbers, and improves the estimate of the rest errors.
  void Whiten(const RowFilter& row, const double* t, double x_um, double y_um, double* out) {
    const double x = x_um - t[0] * e_[0] - t[2] * e_[1];
    const double y = y_um - t[1] * e_[0] - t[3] * e_[1];
    e_[0] += row.gain[0] * x + row.gain[1] * y;
    e_[1] += row.gain[2] * x + row.gain[3] * y;
    out[0] = row.w[0] * x + row.w[1] * y;
    out[1] = row.w[1] * x + row.w[2] * y;
  }

 private:
  double carry_[2];
  double least2_;
  double place2_ = 0;
  double angle2_[2] = {0, 0};
  double rest2_[2] = {0, 0};
  double p_[3] = {0, 0, 0};  // of the rest errors: theta, both, phi
  double keep_[2] = {1, 1};
  double e_[2] = {0, 0};
  double s_[3] = {1, 0, 1};
  double det_ = 1;
  const double* t_ = nullptr;
};

}  // namespace focalfleet::sim
