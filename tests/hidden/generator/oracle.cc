// The oracle has the planted effects, but not the noise. The oracle takes the true contribution
// away, fits the static geometry to four fifths of the moves, and is judged on the rest.
#include <algorithm>
#include <cmath>

#include "tests/hidden/generator/judge_effects.h"

namespace focalfleet::hidden {

namespace {

using Normal6 = std::array<double, 36>;
using Vector6 = std::array<double, 6>;

// Gauss' method with pivots; a direction that the moves do not show keeps the believed value.
Vector6 Solve(Normal6 a, Vector6 b) {
  for (std::size_t i = 0; i < 6; ++i) a[7 * i] += 1e-9 * (1 + a[7 * i]);
  for (std::size_t k = 0; k < 6; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < 6; ++i)
      if (std::abs(a[6 * i + k]) > std::abs(a[6 * pivot + k])) pivot = i;
    for (std::size_t j = 0; j < 6; ++j) std::swap(a[6 * k + j], a[6 * pivot + j]);
    std::swap(b[k], b[pivot]);
    for (std::size_t i = k + 1; i < 6; ++i) {
      const double f = a[6 * i + k] / a[7 * k];
      for (std::size_t j = k; j < 6; ++j) a[6 * i + j] -= f * a[6 * k + j];
      b[i] -= f * b[k];
    }
  }
  Vector6 x{};
  for (std::size_t i = 6; i-- > 0;) {
    double sum = b[i];
    for (std::size_t j = i + 1; j < 6; ++j) sum -= a[6 * i + j] * x[j];
    x[i] = sum / a[7 * i];
  }
  return x;
}

struct UnitRows {
  std::vector<ByAxis> angle_deg;
  std::vector<Place> place_mm;
  std::vector<std::size_t> fold;
};

void Refine(const UnitRows& rows, std::size_t held_out, Geometry* g) {
  Normal6 normal{};
  Vector6 right{};
  for (std::size_t i = 0; i < rows.place_mm.size(); ++i) {
    if (rows.fold[i] == held_out) continue;
    const double first = (rows.angle_deg[i][kTheta] + g->zero_deg[kTheta]) * kDegree;
    const double second = first + (rows.angle_deg[i][kPhi] + g->zero_deg[kPhi]) * kDegree;
    const Place inner = std::polar(1.0, first);
    const Place outer = std::polar(1.0, second);
    const Place turn{0, 1};  // of a milliradian: um
    const std::array<Place, 6> column = {
        Place(1, 0),
        Place(0, 1),
        inner,
        outer,
        turn * (g->arm_mm[kTheta] * inner + g->arm_mm[kPhi] * outer),
        turn * (g->arm_mm[kPhi] * outer)};
    const Place residual_um = 1000.0 * (rows.place_mm[i] - FibreAt(*g, rows.angle_deg[i]));
    for (std::size_t a = 0; a < 6; ++a) {
      right[a] += (std::conj(column[a]) * residual_um).real();
      for (std::size_t b = 0; b < 6; ++b)
        normal[6 * a + b] += (std::conj(column[a]) * column[b]).real();
    }
  }
  const Vector6 x = Solve(normal, right);
  g->base_mm += Place(x[0], x[1]) / 1000.0;
  for (std::size_t a = 0; a < kAxes; ++a) {
    g->arm_mm[a] += x[2 + a] / 1000;
    g->zero_deg[a] += x[4 + a] / 1000 / kDegree;
  }
}

// Held-out 2-D residuals of one unit, um.
void HoldOut(const UnitRows& rows, const Geometry& believed, std::vector<double>* residual_um) {
  for (std::size_t fold = 0; fold < 5; ++fold) {
    Geometry g = believed;
    for (int pass = 0; pass < 3; ++pass) Refine(rows, fold, &g);
    for (std::size_t i = 0; i < rows.place_mm.size(); ++i)
      if (rows.fold[i] == fold)
        residual_um->push_back(1000 * std::abs(rows.place_mm[i] - FibreAt(g, rows.angle_deg[i])));
  }
}

double Rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

OracleGain AskOracle(const Campaign& campaign, const Measurement& measured,
                     const std::vector<std::vector<Place>>& contribution_um) {
  std::vector<double> before;
  std::vector<double> after;
  const std::size_t units = campaign.unit_count();
  const std::size_t block = std::max<std::size_t>(1, campaign.move_count() / 25);
  for (std::size_t u = 0; u < units; ++u) {
    UnitRows rows;
    UnitRows freed;
    for (std::size_t m = 0; m < campaign.move_count(); ++m) {
      const std::size_t r = m * units + u;
      if (measured.seen[r] == 0 || measured.bad[r] != 0) continue;
      rows.angle_deg.push_back(campaign.rows[r].cmd_deg);
      rows.place_mm.push_back(measured.place_mm[r]);
      rows.fold.push_back(m / block % 5);
      freed.place_mm.push_back(measured.place_mm[r]);
      if (!contribution_um[u].empty()) freed.place_mm.back() -= contribution_um[u][m] / 1000.0;
    }
    if (rows.place_mm.size() < 12) continue;
    freed.angle_deg = rows.angle_deg;
    freed.fold = rows.fold;
    HoldOut(rows, campaign.units[u].believed, &before);
    HoldOut(freed, campaign.units[u].believed, &after);
  }
  return {Rms(before), Rms(after), Median(before), Median(after), before.size()};
}

}  // namespace focalfleet::hidden
