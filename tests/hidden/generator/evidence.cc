#include "tests/hidden/generator/evidence.h"

#include <cmath>

namespace focalfleet::hidden {

namespace {

Matrix2 Times(const Matrix2& a, const Matrix2& b) {
  return {a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2],
          a[2] * b[1] + a[3] * b[3]};
}
Matrix2 Transposed(const Matrix2& a) { return {a[0], a[2], a[1], a[3]}; }
Matrix2 Inverse(const Matrix2& a) {
  const double det = a[0] * a[3] - a[1] * a[2];
  return {a[3] / det, -a[1] / det, -a[2] / det, a[0] / det};
}
Place Times(const Matrix2& a, const Place& v) {
  return {a[0] * v.real() + a[1] * v.imag(), a[2] * v.real() + a[3] * v.imag()};
}
// The inverse of the lower Cholesky factor.
Matrix2 InverseFactor(const Matrix2& s) {
  const double l00 = std::sqrt(s[0]);
  const double l10 = s[2] / l00;
  const double l11 = std::sqrt(s[3] - l10 * l10);
  return {1 / l00, 0, -l10 / (l00 * l11), 1 / l11};
}

}  // namespace

std::array<std::vector<Place>, 6> StaticColumns(const Campaign& campaign, std::size_t unit) {
  std::array<std::vector<Place>, 6> columns;
  const Geometry& g = campaign.units[unit].believed;
  for (auto& column : columns) column.reserve(campaign.move_count());
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const ByAxis& q = campaign.At(m, unit).cmd_deg;
    const double first = (q[kTheta] + g.zero_deg[kTheta]) * kDegree;
    const double second = first + (q[kPhi] + g.zero_deg[kPhi]) * kDegree;
    const Place inner = std::polar(1.0, first);
    const Place outer = std::polar(1.0, second);
    const Place turn{0, kDegree};  // um per mdeg: mm * 1000 um/mm * rad/deg / 1000
    columns[0].emplace_back(1, 0);
    columns[1].emplace_back(0, 1);
    columns[2].push_back(inner);
    columns[3].push_back(outer);
    columns[4].push_back(turn * (g.arm_mm[kTheta] * inner + g.arm_mm[kPhi] * outer));
    columns[5].push_back(turn * (g.arm_mm[kPhi] * outer));
  }
  return columns;
}

UnitSpace::UnitSpace(const Campaign& campaign, const NoiseModel& noise, std::size_t unit,
                     std::span<const char> used)
    : static_um_(StaticColumns(campaign, unit)) {
  const double camera = noise.centroid_um[unit] * noise.centroid_um[unit];
  Matrix2 covariance{};
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    Step step;
    step.used = used[m] != 0;
    for (std::size_t a = 0; a < kAxes; ++a) {
      step.renewed[a] = row.Moved(a) || row.rehomed;
      if (!step.renewed[a]) continue;
      covariance[1] = covariance[2] = 0;
      covariance[3 * a] = noise.actuation_deg[a] * noise.actuation_deg[a];
    }
    const Place theta = 1000.0 * static_um_[4][m];
    const Place phi = 1000.0 * static_um_[5][m];
    step.jacobian = {theta.real(), phi.real(), theta.imag(), phi.imag()};
    if (step.used) {
      const Matrix2 seen = Times(covariance, Transposed(step.jacobian));
      Matrix2 s = Times(step.jacobian, seen);
      s[0] += camera;
      s[3] += camera;
      step.whitener = InverseFactor(s);
      step.gain = Times(seen, Inverse(s));
      const Matrix2 learnt = Times(step.gain, Times(step.jacobian, covariance));
      for (std::size_t i = 0; i < 4; ++i) covariance[i] -= learnt[i];
    }
    steps_.push_back(step);
  }
  for (std::size_t which = 0; which < 6; ++which) Extend(&basis_, Whiten(static_um_[which]));
}

Column UnitSpace::Whiten(std::span<const Place> um) const {
  Column out;
  out.reserve(2 * steps_.size());
  Place state;  // estimate of the scatter: theta, phi
  for (std::size_t m = 0; m < steps_.size(); ++m) {
    const Step& step = steps_[m];
    if (step.renewed[kTheta]) state.real(0);
    if (step.renewed[kPhi]) state.imag(0);
    if (!step.used) continue;
    const Place news = um[m] - Times(step.jacobian, state);
    const Place white = Times(step.whitener, news);
    out.push_back(white.real());
    out.push_back(white.imag());
    state += Times(step.gain, news);
  }
  return out;
}

Column UnitSpace::Project(std::span<const Place> um) const {
  Column column = Whiten(um);
  TakeOut(basis_, &column);
  return column;
}

Column UnitSpace::Static(std::size_t which) const { return Whiten(static_um_[which]); }

double Dot(const Column& a, const Column& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

void TakeOut(const std::vector<Column>& basis, Column* column) {
  for (int pass = 0; pass < 2; ++pass)  // twice is enough (Kahan)
    for (const Column& q : basis) {
      const double share = Dot(q, *column);
      for (std::size_t i = 0; i < column->size(); ++i) (*column)[i] -= share * q[i];
    }
}

void Extend(std::vector<Column>* basis, Column column) {
  const double before = Dot(column, column);
  TakeOut(*basis, &column);
  const double left = Dot(column, column);
  if (left <= 1e-10 * before || left <= 0) return;
  const double scale = 1 / std::sqrt(left);
  for (double& value : column) value *= scale;
  basis->push_back(std::move(column));
}

}  // namespace focalfleet::hidden
