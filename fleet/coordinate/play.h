// The side of a gear's play is tracked here, from the way that its axis went.
//
// The driven part stands anywhere within the play of the last stage, and is taken along from one
// end of it. An axis that went down by more than the play is pushed at one end, and small ways
// further down arrive in full. A way up is swallowed until the play is used up. How wide the play
// of a unit is, is not known, only how wide it is at most (1.4 to 1.6 degrees in service). Ways are
// given in units of that most. Where the axis was not watched, both ends are followed. The side is
// known when both agree, and then it is right for every play that is narrower, too.
#pragma once

#include <algorithm>
#include <cstdint>

namespace focalfleet {

class AxisPlay {
 public:
  /// The axis may stand anywhere in its play.
  void Forget() { *this = {}; }
  /// Units: the widest play; upwards is positive.
  void Go(double ways) {
    low_ = std::clamp(low_ + ways, 0.0, 1.0);
    high_ = std::clamp(high_ + ways, 0.0, 1.0);
  }
  /// The direction in which it was pushed last through all of its play: -1 or 1; 0: not known.
  [[nodiscard]] std::int8_t side() const {
    if (high_ <= 0) return -1;
    return low_ >= 1 ? std::int8_t{1} : std::int8_t{0};
  }
  /// The side after one more way, straight.
  [[nodiscard]] std::int8_t SideAfter(double ways) const {
    AxisPlay then = *this;
    then.Go(ways);
    return then.side();
  }

 private:
  double low_ = 0;   // where it stands in the play, by the least
  double high_ = 1;  // and by the most
};

}  // namespace focalfleet
