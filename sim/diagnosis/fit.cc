#include "sim/diagnosis/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/diagnosis/chances.h"

namespace focalfleet::sim {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
constexpr double kMicrons = 1e3;  // a millimetre
constexpr double kHuber = 3;      // whitened length from which a row counts less
constexpr double kMedianSquare = 2 * std::numbers::ln2;  // of a whitened 2-D normal residual
constexpr double kPlaceNoiseMin_um = 0.02;
// Wide priors keep what the moves do not show where units.csv has it. mm, mm, degrees.
constexpr double kPriorBase_mm = 2, kPriorArm_mm = 0.5, kPriorZero_deg = 180;

StaticVector PriorWeights() {
  StaticVector w;
  w << kPriorBase_mm, kPriorBase_mm, kPriorArm_mm, kPriorArm_mm, kPriorZero_deg, kPriorZero_deg;
  return w.array().square().inverse();
}

void AddStatic(const StaticVector& step, CampaignUnit* unit) {
  unit->base_x_mm += step[0];
  unit->base_y_mm += step[1];
  for (const std::size_t axis : {kTheta, kPhi}) {
    unit->arm_mm[axis] = std::max(unit->arm_mm[axis] + step[2 + static_cast<int>(axis)], 1e-3);
    unit->zero_deg[axis] += step[4 + static_cast<int>(axis)];
  }
}

StaticVector StaticDifference(const CampaignUnit& a, const CampaignUnit& b) {
  StaticVector d;
  d << a.base_x_mm - b.base_x_mm, a.base_y_mm - b.base_y_mm, a.arm_mm[0] - b.arm_mm[0],
      a.arm_mm[1] - b.arm_mm[1], a.zero_deg[0] - b.zero_deg[0], a.zero_deg[1] - b.zero_deg[1];
  return d;
}

// ---- the first look at one unit, where zeros may be anywhere

struct PlainRow {
  double theta_deg, phi_deg, x_mm, y_mm;
};

std::vector<PlainRow> PlainRows(const Fit& fit, std::size_t unit) {
  const Campaign& campaign = *fit.facts->campaign;
  std::vector<PlainRow> rows;
  for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
    if (fit.aside[row] == 0 && std::isfinite(campaign.x_mm[row]))
      rows.push_back({campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row],
                      campaign.x_mm[row], campaign.y_mm[row]});
  return rows;
}

// Median distance, which a minority of bad rows does not move.
double MedianMiss(const std::vector<PlainRow>& rows, const CampaignUnit& unit) {
  std::vector<double> misses;
  for (const PlainRow& row : rows) {
    const PlacePoint at = PlaceOf(unit, row.theta_deg, row.phi_deg);
    misses.push_back(std::hypot(row.x_mm - at.x_mm, row.y_mm - at.y_mm));
  }
  return misses.empty() ? 0 : Median(std::move(misses));
}

// Levenberg-Marquardt with L1-like weights about the median miss.
CampaignUnit FitPlain(const std::vector<PlainRow>& rows, const CampaignUnit& table,
                      CampaignUnit unit, int rounds) {
  const StaticVector prior = PriorWeights();
  double damping = 1e-3;
  double miss_mm = std::max(MedianMiss(rows, unit), 1e-5);
  for (int round = 0; round < rounds; ++round) {
    StaticMatrix normal = StaticMatrix::Zero();
    StaticVector right = StaticVector::Zero();
    for (const PlainRow& row : rows) {
      const double a = (row.theta_deg + unit.zero_deg[0]) * kRadians;
      const double b = a + (row.phi_deg + unit.zero_deg[1]) * kRadians;
      const double ca = std::cos(a), sa = std::sin(a), cb = std::cos(b), sb = std::sin(b);
      const double ex = unit.arm_mm[0] * ca, ey = unit.arm_mm[0] * sa;
      const double rx = unit.arm_mm[1] * cb, ry = unit.arm_mm[1] * sb;
      Eigen::Matrix<double, 2, 6> j;
      j << 1, 0, ca, cb, -(ey + ry) * kRadians, -ry * kRadians, 0, 1, sa, sb, (ex + rx) * kRadians,
          rx * kRadians;
      const Eigen::Vector2d r(row.x_mm - unit.base_x_mm - ex - rx,
                              row.y_mm - unit.base_y_mm - ey - ry);
      const double w = 1 / std::max(1.0, r.norm() / (2 * miss_mm)) / (miss_mm * miss_mm);
      normal.noalias() += w * j.transpose() * j;
      right.noalias() += w * j.transpose() * r;
    }
    normal.diagonal() += prior;
    right -= prior.cwiseProduct(StaticDifference(unit, table));
    StaticMatrix damped = normal;
    damped.diagonal() *= 1 + damping;
    const StaticVector step = damped.ldlt().solve(right);
    CampaignUnit next = unit;
    AddStatic(step, &next);
    const double next_mm = std::max(MedianMiss(rows, next), 1e-5);
    if (next_mm <= miss_mm * (1 + 1e-9)) {
      const bool rests = next_mm > miss_mm * (1 - 1e-6);
      unit = next, miss_mm = next_mm, damping = std::max(damping / 5, 1e-9);
      if (rests && round > 3) break;
    } else {
      damping *= 10;
      if (damping > 1e8) break;
    }
  }
  return unit;
}

CampaignUnit FirstGeometry(const Fit& fit, std::size_t unit) {
  constexpr double kGood_mm = 0.1;
  constexpr int kStarts = 12;
  const CampaignUnit& table = fit.model.units[unit];
  const std::vector<PlainRow> rows = PlainRows(fit, unit);
  if (rows.size() < 4) return table;
  CampaignUnit best = FitPlain(rows, table, table, 40);
  double best_mm = MedianMiss(rows, best);
  if (best_mm < kGood_mm) return best;
  for (int a = 0; a < kStarts; ++a)
    for (int b = 0; b < kStarts; ++b) {
      CampaignUnit start = table;
      start.zero_deg[0] += 360.0 / kStarts * a;
      start.zero_deg[1] += 360.0 / kStarts * b;
      const CampaignUnit found = FitPlain(rows, table, start, 15);
      const double found_mm = MedianMiss(rows, found);
      if (found_mm < 0.98 * best_mm) best = found, best_mm = found_mm;
    }
  best = FitPlain(rows, table, best, 40);
  for (const std::size_t axis : {kTheta, kPhi})
    best.zero_deg[axis] =
        table.zero_deg[axis] + std::remainder(best.zero_deg[axis] - table.zero_deg[axis], 360.0);
  return best;
}

// ---- noise

struct NoiseRow {
  double x, y, ax, ay, bx, by;  // residual; d place / d theta, d phi; um, um per degree
};

// Symmetric inverse root of a 2 x 2 covariance: xx, xy, yy.
void InverseRoot(double a, double b, double c, double* out) {
  const double s = std::sqrt(std::max(a * c - b * b, 1e-30));
  const double t = std::sqrt(a + c + 2 * s);
  // root = (cov + s I) / t; its inverse by the adjugate.
  const double ra = (a + s) / t, rb = b / t, rc = (c + s) / t;
  const double d = ra * rc - rb * rb;
  out[0] = rc / d, out[1] = -rb / d, out[2] = ra / d;
}

double SquareLength(const NoiseRow& r, double v0, double v1, double v2, double* log_det) {
  const double a = v0 + v1 * r.ax * r.ax + v2 * r.bx * r.bx;
  const double b = v1 * r.ax * r.ay + v2 * r.bx * r.by;
  const double c = v0 + v1 * r.ay * r.ay + v2 * r.by * r.by;
  const double det = std::max(a * c - b * b, 1e-30);
  *log_det = std::log(det);
  return (c * r.x * r.x - 2 * b * r.x * r.y + a * r.y * r.y) / det;
}

// Student's t of 5 degrees of freedom in two dimensions: outliers cost a logarithm.
double NoiseCost(const std::vector<NoiseRow>& rows, const double* v) {
  constexpr double kFreedom = 5;
  double cost = 0;
  for (const NoiseRow& row : rows) {
    double log_det = 0;
    const double d2 = SquareLength(row, v[0], v[1], v[2], &log_det);
    cost += log_det / 2 + (kFreedom + 2) / 2 * std::log1p(d2 / kFreedom);
  }
  return cost;
}

std::vector<NoiseRow> NoiseRows(const Fit& fit, std::size_t rows_max) {
  const Campaign& campaign = *fit.facts->campaign;
  const std::size_t stride = std::max<std::size_t>(1, campaign.rows() / rows_max);
  std::vector<NoiseRow> rows;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const CampaignUnit& u = fit.model.units[unit];
    const double per = kRadians * kMicrons / fit.noise.unit_factor[unit];
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      if (row % stride != 0 || fit.aside[row] != 0 || !std::isfinite(campaign.x_mm[row])) continue;
      const double a = (campaign.cmd_deg[0][row] + u.zero_deg[0]) * kRadians;
      const double b = a + (campaign.cmd_deg[1][row] + u.zero_deg[1]) * kRadians;
      const double ex = u.arm_mm[0] * std::cos(a), ey = u.arm_mm[0] * std::sin(a);
      const double rx = u.arm_mm[1] * std::cos(b), ry = u.arm_mm[1] * std::sin(b);
      const double f = fit.noise.unit_factor[unit];
      rows.push_back({fit.x_um[row] / f, fit.y_um[row] / f, -(ey + ry) * per * f,
                      (ex + rx) * per * f, -ry * per * f, rx * per * f});
    }
  }
  return rows;
}

// Coordinate search in the logarithms of the three variances.
void FitNoise(const std::vector<NoiseRow>& rows, bool with_angle, double* v) {
  double cost = NoiseCost(rows, v);
  for (double factor = 8; factor > 1.03; factor = std::sqrt(factor))
    for (int k = 0; k < (with_angle ? 3 : 1); ++k)
      for (const double f : {factor, 1 / factor}) {
        double next[3] = {v[0], v[1], v[2]};
        next[k] *= f;
        const double next_cost = NoiseCost(rows, next);
        if (next_cost < cost) cost = next_cost, v[0] = next[0], v[1] = next[1], v[2] = next[2];
      }
}

std::size_t OwnColumns(const Fit& fit, std::size_t unit) {
  std::size_t columns = kStaticColumns;
  for (const ModelTerm& term : fit.model.terms)
    if (term.sharing == Sharing::kUnit && term.group_of_unit[unit] != kNoGroup)
      columns += term.form.columns;
  return columns;
}

}  // namespace

void UpdateResiduals(Fit* fit) {
  const Campaign& campaign = *fit->facts->campaign;
  const Places places = Predict(fit->model, *fit->facts, fit->parallel);
  fit->x_um.resize(campaign.rows());
  fit->y_um.resize(campaign.rows());
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    fit->x_um[row] = (campaign.x_mm[row] - places.x_mm[row]) * kMicrons;
    fit->y_um[row] = (campaign.y_mm[row] - places.y_mm[row]) * kMicrons;
  }
}

void UpdateNoise(Fit* fit) {
  const Campaign& campaign = *fit->facts->campaign;
  Noise& noise = fit->noise;
  if (noise.unit_factor.empty()) noise.unit_factor.assign(campaign.units.size(), 1);
  constexpr std::size_t kRowsMax = 8000;
  const std::vector<NoiseRow> rows = NoiseRows(*fit, kRowsMax);
  if (rows.empty()) return;
  std::vector<double> squares;
  for (const NoiseRow& row : rows) squares.push_back(row.x * row.x + row.y * row.y);
  const double typical =
      std::max(Median(squares) / kMedianSquare, kPlaceNoiseMin_um * kPlaceNoiseMin_um);
  double v[3] = {typical, 0, 0};
  double lever[2] = {0, 0};
  for (const NoiseRow& row : rows) {
    lever[0] = std::max(lever[0], std::hypot(row.ax, row.ay));
    lever[1] = std::max(lever[1], std::hypot(row.bx, row.by));
  }
  const bool with_angle = fit->with_angle_noise && rows.size() >= 200;
  if (with_angle)
    for (int k = 0; k < 2; ++k) v[k + 1] = 0.1 * typical / std::max(lever[k] * lever[k], 1e-12);
  FitNoise(rows, with_angle, v);
  noise.place_um = std::max(std::sqrt(v[0]), kPlaceNoiseMin_um);
  noise.angle_deg[0] = std::sqrt(v[1]);
  noise.angle_deg[1] = std::sqrt(v[2]);
  // Factors: the median of the whitened squares, of the fleet and, drawn to it, of each unit.
  std::vector<double> fleet;
  std::vector<double> own(campaign.units.size());
  std::vector<double> count(campaign.units.size());
  noise.unit_factor.assign(campaign.units.size(), 1);
  const std::vector<UnitChunk> chunks = ChunksOf(campaign.units.size());
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      const WhiteUnit white = Whiten(*fit, unit);
      std::vector<double> lengths;
      for (std::size_t i = 0; i < white.moves.size(); ++i) {
        const auto k = static_cast<Eigen::Index>(2 * i);
        lengths.push_back(white.y.segment<2>(k).squaredNorm() /
                          fit->weight[white.track.first_row + white.moves[i]]);
      }
      const double n = static_cast<double>(2 * lengths.size());
      const double left = n - static_cast<double>(OwnColumns(*fit, unit));
      count[unit] = static_cast<double>(lengths.size());
      own[unit] = left < 4 ? -1 : Median(lengths) / kMedianSquare * n / left;
    }
  });
  for (const double factor : own)
    if (factor >= 0) fleet.push_back(factor);
  constexpr double kShrink = 10;
  const double usual = fleet.empty() ? 1 : Median(fleet);
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const double n = own[unit] < 0 ? 0 : count[unit];
    const double square = (n * std::max(own[unit], 0.0) + kShrink * usual) / (n + kShrink);
    noise.unit_factor[unit] = std::sqrt(std::max(square, 1e-6));
  }
}

void UpdateWeights(Fit* fit) {
  const Campaign& campaign = *fit->facts->campaign;
  fit->weight.assign(campaign.rows(), 0);
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    if (fit->aside[row] == 0 && std::isfinite(campaign.x_mm[row])) fit->weight[row] = 1;
  const std::vector<UnitChunk> chunks = ChunksOf(campaign.units.size());
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      const WhiteUnit white = Whiten(*fit, unit);
      for (std::size_t i = 0; i < white.moves.size(); ++i) {
        const auto k = static_cast<Eigen::Index>(2 * i);
        const double length = std::hypot(white.y[k], white.y[k + 1]);
        if (length > kHuber) fit->weight[white.track.first_row + white.moves[i]] = kHuber / length;
      }
    }
  });
}

Fit StartFit(const CampaignFacts& facts, CampaignModel model, std::vector<char> aside,
             ParallelFor parallel) {
  Fit fit;
  fit.facts = &facts;
  fit.model = std::move(model);
  fit.aside = std::move(aside);
  fit.parallel = std::move(parallel);
  fit.noise.unit_factor.assign(fit.model.units.size(), 1);
  std::vector<CampaignUnit> first = fit.model.units;
  const std::vector<UnitChunk> chunks = ChunksOf(first.size());
  fit.parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit)
      first[unit] = FirstGeometry(fit, unit);
  });
  fit.model.units = std::move(first);
  fit.weight.assign(facts.campaign->rows(), 1);
  for (std::size_t row = 0; row < fit.weight.size(); ++row)
    if (fit.aside[row] != 0 || !std::isfinite(facts.campaign->x_mm[row])) fit.weight[row] = 0;
  UpdateResiduals(&fit);
  SettleFit(&fit, 3);
  return fit;
}

WhiteUnit Whiten(const Fit& fit, std::size_t unit) {
  WhiteUnit white;
  white.track = MakeTrack(*fit.facts, unit, fit.model.units[unit]);
  const UnitTrack& track = white.track;
  for (std::size_t i = 0; i < track.moves; ++i)
    if (fit.weight[track.first_row + i] > 0) white.moves.push_back(i);
  const auto n = static_cast<Eigen::Index>(2 * white.moves.size());
  white.y.resize(n);
  white.geometry.resize(n, kStaticColumns);
  const Noise& noise = fit.noise;
  const double factor = noise.unit_factor[unit];
  const double v0 = noise.place_um * noise.place_um;
  const double v1 = noise.angle_deg[0] * noise.angle_deg[0];
  const double v2 = noise.angle_deg[1] * noise.angle_deg[1];
  for (std::size_t k = 0; k < white.moves.size(); ++k) {
    const std::size_t i = white.moves[k], row = track.first_row + i;
    const double per = kRadians * kMicrons;
    const double ax = -(track.elbow_y_mm[i] + track.reach_y_mm[i]) * per;
    const double ay = (track.elbow_x_mm[i] + track.reach_x_mm[i]) * per;
    const double bx = -track.reach_y_mm[i] * per, by = track.reach_x_mm[i] * per;
    white.turn_um.insert(white.turn_um.end(), {ax, ay, bx, by});
    double w[3];
    InverseRoot(v0 + v1 * ax * ax + v2 * bx * bx, v1 * ax * ay + v2 * bx * by,
                v0 + v1 * ay * ay + v2 * by * by, w);
    const double scale = std::sqrt(fit.weight[row]) / factor;
    for (double& value : w) value *= scale;
    white.whiten.insert(white.whiten.end(), w, w + 3);
    const auto at = static_cast<Eigen::Index>(2 * k);
    const auto put = [&](double x, double y, double* first, double* second) {
      *first = w[0] * x + w[1] * y;
      *second = w[1] * x + w[2] * y;
    };
    put(fit.x_um[row], fit.y_um[row], &white.y[at], &white.y[at + 1]);
    const double arm[2] = {track.unit->arm_mm[0], track.unit->arm_mm[1]};
    const double columns[6][2] = {
        {kMicrons, 0},
        {0, kMicrons},
        {kMicrons * track.elbow_x_mm[i] / arm[0], kMicrons * track.elbow_y_mm[i] / arm[0]},
        {kMicrons * track.reach_x_mm[i] / arm[1], kMicrons * track.reach_y_mm[i] / arm[1]},
        {ax, ay},
        {bx, by}};
    for (Eigen::Index c = 0; c < 6; ++c)
      put(columns[c][0], columns[c][1], &white.geometry(at, c), &white.geometry(at + 1, c));
  }
  return white;
}

void WhiteDisplacement(const WhiteUnit& white, const PoseErrors& errors, double* out) {
  const UnitTrack& track = white.track;
  const double per_arm[2] = {kMicrons / track.unit->arm_mm[0], kMicrons / track.unit->arm_mm[1]};
  for (std::size_t k = 0; k < white.moves.size(); ++k) {
    const std::size_t i = white.moves[k];
    const double* t = &white.turn_um[4 * k];
    const double* w = &white.whiten[3 * k];
    const double a = errors.angle_deg[0][i], b = errors.angle_deg[1][i];
    const double m = errors.arm_mm[0][i] * per_arm[0], n = errors.arm_mm[1][i] * per_arm[1];
    const double x = kMicrons * errors.x_mm[i] + t[0] * a + t[2] * b + m * track.elbow_x_mm[i] +
                     n * track.reach_x_mm[i];
    const double y = kMicrons * errors.y_mm[i] + t[1] * a + t[3] * b + m * track.elbow_y_mm[i] +
                     n * track.reach_y_mm[i];
    out[2 * k] = w[0] * x + w[1] * y;
    out[2 * k + 1] = w[1] * x + w[2] * y;
  }
}

}  // namespace focalfleet::sim
