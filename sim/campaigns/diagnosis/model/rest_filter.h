// The Kalman filter of a unit's rest errors (whiten.h), one row at a time.
#pragma once

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/model/whiten.h"

namespace focalfleet::sim {

/// Call Move for each move of the track. For each row that is used, then call See, SquareLength,
/// Take, Whiten.
class RestFilter {
 public:
  /// `factor` multiplies all of the unit's noise.
  RestFilter(const Noise& noise, double factor)
      : carry_{noise.carry[0], noise.carry[1], noise.carry[2]},
        least2_(noise.least_um * noise.least_um) {
    const double f2 = factor * factor;
    place2_ = f2 * noise.place_um * noise.place_um;
    for (int a = 0; a < 2; ++a) {
      angle2_[a] = f2 * noise.angle_deg[a] * noise.angle_deg[a];
      rest2_[a] = f2 * noise.rest_deg[a] * noise.rest_deg[a];
    }
    rest2_[2] = rest2_[3] = f2 * noise.rest_um * noise.rest_um;
    Begin();
  }

  void Move(bool restarts, bool theta_moves, bool phi_moves) {
    if (restarts) return Begin();
    const bool moves[] = {theta_moves, phi_moves, theta_moves || phi_moves};
    for (std::size_t part = 0; part < 3; ++part) {
      if (!moves[part]) continue;
      keep_[part] *= carry_[part];
      for (std::size_t a = 0; a < kRestErrors; ++a) {
        if (PartOf(a) != part) continue;
        for (std::size_t b = 0; b < kRestErrors; ++b) p_[a][b] *= carry_[part], p_[b][a] = p_[a][b];
        p_[a][a] = p_[a][a] * carry_[part] + rest2_[a];
      }
    }
  }

  /// Predicts the row's covariance before its place is known. t: d place / d theta, d phi; um per
  /// degree.
  void See(const double* t, double exposure_factor) {
    for (std::size_t a = 0; a < kRestErrors; ++a) {
      e_[a] *= keep_[PartOf(a)];
      h_[a][0] = p_[a][0] * t[0] + p_[a][1] * t[2] + p_[a][2];
      h_[a][1] = p_[a][0] * t[1] + p_[a][1] * t[3] + p_[a][3];
    }
    const double v = std::max(place2_ * exposure_factor * exposure_factor, least2_);
    s_[0] = v + t[0] * h_[0][0] + t[2] * h_[1][0] + h_[2][0] + angle2_[0] * t[0] * t[0] +
            angle2_[1] * t[2] * t[2];
    s_[1] = t[0] * h_[0][1] + t[2] * h_[1][1] + h_[2][1] + angle2_[0] * t[0] * t[1] +
            angle2_[1] * t[2] * t[3];
    s_[2] = v + t[1] * h_[0][1] + t[3] * h_[1][1] + h_[3][1] + angle2_[0] * t[1] * t[1] +
            angle2_[1] * t[3] * t[3];
    det_ = std::max(s_[0] * s_[2] - s_[1] * s_[1], 1e-30);
    t_ = t;
  }

  /// The squared length of the residual, in sigmas.
  [[nodiscard]] double SquareLength(double x_um, double y_um) const {
    const double x = x_um - t_[0] * e_[0] - t_[2] * e_[1] - e_[2];
    const double y = y_um - t_[1] * e_[0] - t_[3] * e_[1] - e_[3];
    return (s_[2] * x * x - 2 * s_[1] * x * y + s_[0] * y * y) / det_;
  }
  [[nodiscard]] double determinant() const { return det_; }

  /// Updates the filter with the row at this weight.
  RowFilter Take(double weight) {
    RowFilter out{};
    std::copy_n(keep_, 3, out.keep);
    std::fill_n(keep_, 3, 1.0);
    // Symmetric inverse root of s: root = (s + d I) / t, inverted by the adjugate.
    const double d = std::sqrt(det_), t = std::sqrt(s_[0] + s_[2] + 2 * d);
    const double scale = std::sqrt(weight) / (t * d);
    out.w[0] = (s_[2] + d) * scale, out.w[1] = -s_[1] * scale, out.w[2] = (s_[0] + d) * scale;
    // gain = weight P H' / s, with P H' = h.
    for (std::size_t a = 0; a < kRestErrors; ++a) {
      out.gain[2 * a] = weight * (h_[a][0] * s_[2] - h_[a][1] * s_[1]) / det_;
      out.gain[2 * a + 1] = weight * (h_[a][1] * s_[0] - h_[a][0] * s_[1]) / det_;
    }
    for (std::size_t a = 0; a < kRestErrors; ++a) {
      for (std::size_t b = 0; b < a; ++b)
        p_[a][b] = p_[b][a] =
            p_[a][b] - (out.gain[2 * a] * h_[b][0] + out.gain[2 * a + 1] * h_[b][1]);
      p_[a][a] =
          std::max(p_[a][a] - (out.gain[2 * a] * h_[a][0] + out.gain[2 * a + 1] * h_[a][1]), 0.0);
    }
    return out;
  }

  /// Writes the row's two whitened numbers, and improves the estimate of the rest errors.
  void Whiten(const RowFilter& row, const double* t, double x_um, double y_um, double* out) {
    const double x = x_um - t[0] * e_[0] - t[2] * e_[1] - e_[2];
    const double y = y_um - t[1] * e_[0] - t[3] * e_[1] - e_[3];
    for (std::size_t a = 0; a < kRestErrors; ++a)
      e_[a] += row.gain[2 * a] * x + row.gain[2 * a + 1] * y;
    out[0] = row.w[0] * x + row.w[1] * y;
    out[1] = row.w[1] * x + row.w[2] * y;
  }

 private:
  /// The part (theta, phi, place) that a rest error belongs to.
  static constexpr std::size_t PartOf(std::size_t rest_error) {
    return std::min<std::size_t>(rest_error, 2);
  }
  void Begin() {
    for (std::size_t a = 0; a < kRestErrors; ++a)
      for (std::size_t b = 0; b < kRestErrors; ++b) p_[a][b] = a == b ? rest2_[a] : 0;
    std::fill_n(keep_, 3, 0.0);
  }

  double carry_[3];
  double least2_;
  double place2_ = 0;
  double angle2_[2] = {0, 0};
  double rest2_[kRestErrors] = {0, 0, 0, 0};
  double p_[kRestErrors][kRestErrors] = {};  // covariance of the rest errors
  double h_[kRestErrors][2] = {};            // their covariance with the row's place
  double keep_[3] = {1, 1, 1};
  double e_[kRestErrors] = {0, 0, 0, 0};
  double s_[3] = {1, 0, 1};
  double det_ = 1;
  const double* t_ = nullptr;
};

}  // namespace focalfleet::sim
