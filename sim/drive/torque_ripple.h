// Torque without its carrier: the running mean over one carrier period. Means over the carrier
// periods themselves would be samples of it at one place in each, and miss its peaks: with six
// vectors a turn 203.8 % from peak to peak where the running mean has 204.2 %.
#pragma once

#include <deque>

#include "sim/drive/drive.h"

namespace focalfleet::sim {

class TorqueRipple {
 public:
  /// Ripple is over the mean's size.
  struct Figures {
    double mean_Nm = 0;
    double peak_to_peak = 0;
    double rms = 0;
  };

  explicit TorqueRipple(double window_s) : window_s_(window_s) {}

  /// Intervals follow each other without a gap. Keeps those of one window.
  void Hear(const DriveInterval& interval);
  /// Pre: more than a window was heard.
  [[nodiscard]] Figures Judge() const;

 private:
  struct Point {
    double t_s = 0;  // since the first interval's begin
    double impulse_Nms = 0;
  };
  void Add(double step_s, double impulse_Nms);

  double window_s_;
  std::deque<Point> points_ = {{}};
  // Of the running mean, from the first whole window on.
  double begin_s_ = 0;
  double last_Nm_ = 0;
  double last_s_ = 0;
  double lowest_Nm_ = 0;
  double highest_Nm_ = 0;
  double sum_Nms_ = 0;
  double squares_ = 0;
};

}  // namespace focalfleet::sim
