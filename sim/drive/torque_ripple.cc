#include "sim/drive/torque_ripple.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

// Between points the impulse is taken as a line: the pieces are so short that rms is exact to 1e-3
// of itself.
constexpr double kPiece_s = 1e-7;

}  // namespace

void TorqueRipple::Hear(const DriveInterval& interval) {
  // Within an interval the torque is taken as the line that has its impulse and its moment.
  const double step_s = interval.step_s;
  const double mean_Nm = interval.impulse_Nms / step_s;
  const double slope =
      12 * (interval.moment_Nms2 - interval.impulse_Nms * step_s / 2) / (step_s * step_s * step_s);
  const int pieces = static_cast<int>(std::ceil(step_s / kPiece_s));
  const double piece_s = step_s / pieces;
  for (int k = 0; k < pieces; ++k) {
    const double off_s = (k + 0.5) * piece_s - step_s / 2;
    Add(piece_s, (mean_Nm + slope * off_s) * piece_s);
  }
}

void TorqueRipple::Add(double step_s, double impulse_Nms) {
  // The time is a sum of steps: instants count from the drive's start and would round.
  const Point& last = points_.back();
  points_.push_back({last.t_s + step_s, last.impulse_Nms + impulse_Nms});
  const Point& now = points_.back();
  const double from_s = now.t_s - window_s_;
  if (from_s < 0) return;
  // A window ends at an event; at its begin the impulse is a line between two events.
  while (points_[1].t_s <= from_s) points_.pop_front();
  const Point& a = points_[0];
  const Point& b = points_[1];
  const double share = (from_s - a.t_s) / (b.t_s - a.t_s);
  const double from_Nms = a.impulse_Nms + share * (b.impulse_Nms - a.impulse_Nms);
  const double mean_Nm = (now.impulse_Nms - from_Nms) / window_s_;
  const bool first = last_s_ == 0;
  lowest_Nm_ = first ? mean_Nm : std::min(lowest_Nm_, mean_Nm);
  highest_Nm_ = first ? mean_Nm : std::max(highest_Nm_, mean_Nm);
  if (first) {
    begin_s_ = now.t_s;
  } else {
    sum_Nms_ += step_s * (last_Nm_ + mean_Nm) / 2;
    squares_ += step_s * (last_Nm_ * last_Nm_ + last_Nm_ * mean_Nm + mean_Nm * mean_Nm) / 3;
  }
  last_Nm_ = mean_Nm;
  last_s_ = now.t_s;
}

TorqueRipple::Figures TorqueRipple::Judge() const {
  const Point& end = points_.back();
  const double time_s = last_s_ - begin_s_;
  FOCALFLEET_CHECK(time_s > 0);
  Figures figures;
  figures.mean_Nm = end.impulse_Nms / end.t_s;
  const double size_Nm = std::abs(figures.mean_Nm);
  const double middle_Nm = sum_Nms_ / time_s;
  figures.peak_to_peak = (highest_Nm_ - lowest_Nm_) / size_Nm;
  figures.rms = std::sqrt(std::max(0.0, squares_ / time_s - middle_Nm * middle_Nm)) / size_Nm;
  return figures;
}

}  // namespace focalfleet::sim
