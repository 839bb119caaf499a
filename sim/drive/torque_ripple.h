// The torque without its carrier is the running mean over one carrier period. Means over the
// carrier periods themselves would be samples of it at one place in each, and miss its peaks. With
// six vectors a turn they give 203.8 % from peak to peak where the running mean has 204.2 %.
#pragma once

#include <deque>

#include "sim/drive/drive.h"

namespace focalfleet::sim {

class TorqueRipple {
 public:
  /// Ripple is relative to the size of the mean.
  struct Figures {
    double mean_Nm = 0;
    double peak_to_peak = 0;
    double rms = 0;
  };

  explicit TorqueRipple(double window_s) : window_s_(window_s) {}

  /// Intervals follow each other without a gap; those of one window are kept.
  void Hear(const DriveInterval& interval);
  /// Pre: the intervals that came cover more than a window.
  [[nodiscard]] Figures Judge() const;

 private:
  struct Point {
    double t_s = 0;  // since the first interval's begin
    double impulse_Nms = 0;
  };
  void Add(double step_s, double impulse_Nms);

  double window_s_;
  std::deque<Point> points_ = {{}};
  // The figures cover the running mean, from the first whole window on.
  double begin_s_ = 0;
  double last_Nm_ = 0;
  double last_s_ = 0;
  double lowest_Nm_ = 0;
  double highest_Nm_ = 0;
  double sum_Nms_ = 0;
  double squares_ = 0;
};

}  // namespace focalfleet::sim
