#include "sim/campaigns/diagnosis/model/whiten.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/diagnosis/model/rest_filter.h"
#include "sim/campaigns/effects/closed_loop.h"

namespace focalfleet::sim {
namespace {

constexpr double kHuber = 3;  // whitened length from which a row counts less
constexpr double kFar = 5;    // length from which the weight falls on and on

// Huber's weight, and beyond kFar less and less: a row far away has no bearing on the rest.
double WeightOf(double square) {
  if (square <= kHuber * kHuber) return 1;
  return square <= kFar * kFar ? kHuber / std::sqrt(square) : kHuber * kFar / square;
}

// The used rows and the effect of an axis' turn at each.
WhiteUnit Begin(const Fit& fit, std::size_t unit, bool anew) {
  WhiteUnit white;
  white.track = TrackOf(fit.model, *fit.facts, unit);
  const UnitTrack& track = white.track;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const std::size_t row = track.first_row + i;
    const bool used =
        anew ? fit.aside[row] == 0 && std::isfinite(fit.x_um[row]) : fit.weight[row] > 0;
    if (!used) continue;
    white.moves.push_back(i);
    const double per = kRadiansPerDegree * kUmPerMm;
    white.turn_um.insert(white.turn_um.end(),
                         {-(track.elbow_y_mm[i] + track.reach_y_mm[i]) * per,
                          (track.elbow_x_mm[i] + track.reach_x_mm[i]) * per,
                          -track.reach_y_mm[i] * per, track.reach_x_mm[i] * per});
  }
  return white;
}

// Computes the gains of all rows, and the whitened residuals. Weights are the fit's, or are made
// here.
void RunFilter(const Fit& fit, std::size_t unit, std::vector<double>* made, WhiteUnit* white) {
  const UnitTrack& track = white->track;
  RestFilter filter(fit.noise, fit.noise.unit_factor[unit]);
  white->y.resize(static_cast<Eigen::Index>(2 * white->moves.size()));
  white->filter.reserve(white->moves.size());
  std::size_t next = 0;
  for (std::size_t k = 0; k < white->moves.size(); ++k) {
    const std::size_t i = white->moves[k], row = track.first_row + i;
    for (; next <= i; ++next)
      filter.Move(track.restarts[next] != 0, track.step_deg[0][next] != 0,
                  track.step_deg[1][next] != 0);
    const double exposure = fit.noise.exposure_factor.empty()
                                ? 1
                                : fit.noise.exposure_factor[fit.facts->exposures.of_row[row]];
    filter.See(&white->turn_um[4 * k], exposure);
    double square = filter.SquareLength(fit.x_um[row], fit.y_um[row]);
    double weight = fit.weight[row];
    if (made != nullptr) {
      weight = WeightOf(square);
      made->push_back(weight);
    }
    white->filter.push_back(filter.Take(weight));
    const auto at = static_cast<Eigen::Index>(2 * k);
    filter.Whiten(white->filter.back(), &white->turn_um[4 * k], fit.x_um[row], fit.y_um[row],
                  &white->y[at]);
  }
}

}  // namespace

void ApplyFilter(std::span<const RowFilter> filter, std::span<const double> turn_um,
                 double* xy_um) {
  double theta = 0, phi = 0, x = 0, y = 0;  // rest errors, estimated from the rows so far
  for (std::size_t k = 0; k < filter.size(); ++k) {
    const RowFilter& f = filter[k];
    const double* t = &turn_um[4 * k];
    theta *= f.keep[0], phi *= f.keep[1], x *= f.keep[2], y *= f.keep[2];
    double* xy = xy_um + 2 * k;
    const double dx = xy[0] - t[0] * theta - t[2] * phi - x;
    const double dy = xy[1] - t[1] * theta - t[3] * phi - y;
    theta += f.gain[0] * dx + f.gain[1] * dy;
    phi += f.gain[2] * dx + f.gain[3] * dy;
    x += f.gain[4] * dx + f.gain[5] * dy;
    y += f.gain[6] * dx + f.gain[7] * dy;
    xy[0] = f.w[0] * dx + f.w[1] * dy;
    xy[1] = f.w[1] * dx + f.w[2] * dy;
  }
}

void WhiteUnit::Apply(double* xy_um) const { ApplyFilter(filter, turn_um, xy_um); }

namespace {

bool IsClosed(const UnitTrack& track, std::size_t move) {
  return track.beginnings != nullptr && track.restarts[move] == 0 &&
         track.facts->closed[track.first_row + move] != 0;
}

// The angles by which a move began off where the coordinator believed, per mm or degree of one
// number of the geometry, degrees.
std::array<double, 2> TurnAtBeginning(const UnitTrack& track, std::size_t move,
                                      Eigen::Index number) {
  const UnitTrack& poses = track.beginnings->track;
  const std::size_t b = 2 * move;
  const double ex = poses.elbow_x_mm[b], ey = poses.elbow_y_mm[b];
  const double rx = poses.reach_x_mm[b], ry = poses.reach_y_mm[b];
  const double arm[2] = {track.unit->arm_mm[0], track.unit->arm_mm[1]};
  if (number >= 4) return {number == 4 ? 1.0 : 0.0, number == 5 ? 1.0 : 0.0};
  const double shift[4][2] = {
      {1, 0}, {0, 1}, {ex / arm[0], ey / arm[0]}, {rx / arm[1], ry / arm[1]}};
  return AnglesOfShift(ex, ey, rx, ry, shift[number][0], shift[number][1]);
}

}  // namespace

Eigen::Matrix<double, 2, kExposureParameters> ImageDisplacements(const WhiteUnit& white,
                                                                 std::size_t k, double radius_mm) {
  const double x = white.track.fibre_x_mm[white.moves[k]] / radius_mm;
  const double y = white.track.fibre_y_mm[white.moves[k]] / radius_mm;
  Eigen::Matrix<double, 2, kExposureParameters> image;
  image << 1, 0, -y, x, 0, 1, x, y;
  return image;
}

Eigen::MatrixXd GeometryDisplacements(const WhiteUnit& white) {
  const UnitTrack& track = white.track;
  Eigen::MatrixXd out(static_cast<Eigen::Index>(2 * white.moves.size()), kStaticColumns);
  const double arm[2] = {track.unit->arm_mm[0], track.unit->arm_mm[1]};
  for (std::size_t k = 0; k < white.moves.size(); ++k) {
    const std::size_t i = white.moves[k];
    const double* t = &white.turn_um[4 * k];
    const double columns[6][2] = {
        {kUmPerMm, 0},
        {0, kUmPerMm},
        {kUmPerMm * track.elbow_x_mm[i] / arm[0], kUmPerMm * track.elbow_y_mm[i] / arm[0]},
        {kUmPerMm * track.reach_x_mm[i] / arm[1], kUmPerMm * track.reach_y_mm[i] / arm[1]},
        {t[0], t[1]},
        {t[2], t[3]}};
    const auto at = static_cast<Eigen::Index>(2 * k);
    for (Eigen::Index c = 0; c < 6; ++c) out(at, c) = columns[c][0], out(at + 1, c) = columns[c][1];
    // The coordinator counts on from where the loop was closed last.
    std::size_t begun = i;
    while (begun > 0 && track.beginnings != nullptr && track.restarts[begun] == 0 &&
           !IsClosed(track, begun))
      --begun;
    if (!IsClosed(track, begun)) continue;
    for (Eigen::Index c = 0; c < 6; ++c) {
      const auto turn = TurnAtBeginning(track, begun, c);
      for (Eigen::Index xy = 0; xy < 2; ++xy)
        out(at + xy, c) -= t[xy] * turn[0] + t[2 + xy] * turn[1];
    }
  }
  return out;
}

WhiteUnit Whiten(const Fit& fit, std::size_t unit) {
  WhiteUnit white = Begin(fit, unit, false);
  RunFilter(fit, unit, nullptr, &white);
  white.geometry = GeometryDisplacements(white);
  for (Eigen::Index c = 0; c < white.geometry.cols(); ++c)
    white.Apply(white.geometry.col(c).data());
  return white;
}

WhiteUnit WhitenAnew(const Fit& fit, std::size_t unit, std::vector<double>* weights) {
  weights->clear();
  WhiteUnit white = Begin(fit, unit, true);
  RunFilter(fit, unit, weights, &white);
  return white;
}

void Displacement(const WhiteUnit& white, const PoseErrors& errors, double* out) {
  const UnitTrack& track = white.track;
  const double per_arm[2] = {kUmPerMm / track.unit->arm_mm[0], kUmPerMm / track.unit->arm_mm[1]};
  for (std::size_t k = 0; k < white.moves.size(); ++k) {
    const std::size_t i = white.moves[k];
    const double* t = &white.turn_um[4 * k];
    const double a = errors.angle_deg[0][i], b = errors.angle_deg[1][i];
    const double m = errors.arm_mm[0][i] * per_arm[0], n = errors.arm_mm[1][i] * per_arm[1];
    out[2 * k] = kUmPerMm * errors.x_mm[i] + t[0] * a + t[2] * b + m * track.elbow_x_mm[i] +
                 n * track.reach_x_mm[i];
    out[2 * k + 1] = kUmPerMm * errors.y_mm[i] + t[1] * a + t[3] * b + m * track.elbow_y_mm[i] +
                     n * track.reach_y_mm[i];
  }
}

void WhiteDisplacement(const WhiteUnit& white, const PoseErrors& errors, double* out) {
  Displacement(white, errors, out);
  white.Apply(out);
}

}  // namespace focalfleet::sim
