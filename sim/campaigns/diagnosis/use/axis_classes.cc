#include "sim/campaigns/diagnosis/use/axis_classes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/far_angles.h"

namespace focalfleet::sim {
namespace {

// A move is long from here: the places are 0.5 mm apart on an arm of 3 mm, a hundred times what a
// camera is off by. Half and twice of it: the same classes on the robots of DESI.
constexpr double kLong_deg = 10;
// A long move stalls that turns less than this share of what it was asked, and less than kLong_deg.
constexpr double kStallShare = 0.1;
constexpr double kWrap_deg = 15;  // around a whole turn
// Scales within this of 1 are healthy. Robots of DESI in service have 0.97 to 1.02; those it gives
// another scale differ by more than 0.03 (its table of linear theta).
constexpr double kHealthyWithin = 0.03;
// Moves that stall now and then are in healthy robots' campaigns, too (up to an eighth of them).
constexpr double kSlipsShare = 0.2;
constexpr double kStuckShare = 0.9;
constexpr std::size_t kLongMovesMin = 5;  // long ones

struct SeenTurn {
  double asked_deg = 0, made_deg = 0, at_deg = 0;
};

/// Below this a turn is none.
double StallOf_deg(const SeenTurn& turn) {
  return std::min(kStallShare * std::abs(turn.asked_deg), kLong_deg);
}

// The share of what they were asked that moves of one direction made: the line through zero from
// which their turns are off by the least sum of distances. Long moves tell it best.
std::optional<double> ScaleOf(const std::vector<SeenTurn>& turns, double sign) {
  std::vector<std::pair<double, double>> shares;  // with the angles asked
  double all = 0;
  for (const SeenTurn& turn : turns)
    if (turn.asked_deg * sign >= kLong_deg && std::abs(turn.made_deg) >= StallOf_deg(turn))
      shares.emplace_back(turn.made_deg / turn.asked_deg, std::abs(turn.asked_deg)),
          all += std::abs(turn.asked_deg);
  if (shares.empty()) return std::nullopt;
  std::ranges::sort(shares);
  double below = 0;
  for (const auto& [share, asked_deg] : shares)
    if ((below += asked_deg) >= all / 2) return share;
  return shares.back().first;
}

AxisClass ClassOf(const AxisReport& axis, std::size_t long_moves) {
  if (long_moves < kLongMovesMin) return AxisClass::kUnknown;
  const auto share = [&](std::size_t of) {
    return static_cast<double>(of) / static_cast<double>(long_moves);
  };
  if (share(axis.stalls) >= kStuckShare) return AxisClass::kStuck;
  if (share(axis.wraps) > 0.5) return AxisClass::kWrapped;
  if (share(axis.stalls) >= kSlipsShare) return AxisClass::kSlipping;
  double sum = 0, directions = 0;
  for (const std::optional<double>& scale : {axis.scale_cw, axis.scale_ccw})
    if (scale) sum += *scale, directions += 1;
  if (directions == 0) return AxisClass::kSlipping;
  const bool opposite =
      axis.scale_cw && axis.scale_ccw && (*axis.scale_cw - 1) * (*axis.scale_ccw - 1) < 0 &&
      std::min(std::abs(*axis.scale_cw - 1), std::abs(*axis.scale_ccw - 1)) > kHealthyWithin;
  const bool off = std::abs(sum / std::max(directions, 1.0) - 1) > kHealthyWithin;
  return off || opposite ? AxisClass::kScale : AxisClass::kHealthy;
}

// The angles that an axis turned by in its moves, as far as the camera saw both ends.
class Turns {
 public:
  Turns(const Campaign& campaign, const CampaignUnit& geometry, std::size_t begin, std::size_t end)
      : campaign_(campaign), closed_(campaign.Find("from_measured")) {
    bool seen_before = false;
    double before_deg[2] = {0, 0};
    const std::span<const double> rehomed = campaign.Find("rehomed");
    for (std::size_t row = begin; row < end; ++row) {
      if (!rehomed.empty() && rehomed[row] > 0.5) seen_before = false;
      const bool closed = !closed_.empty() && closed_[row] > 0.5;
      if (!std::isfinite(campaign.x_mm[row])) {
        seen_before = false;
        continue;
      }
      const PlacePoint place =
          PlaceOf(geometry, campaign.cmd_deg[0][row], campaign.cmd_deg[1][row]);
      square_sum_ += std::pow(campaign.x_mm[row] - place.x_mm, 2) +
                     std::pow(campaign.y_mm[row] - place.y_mm, 2);
      ++rows_;
      const AnglesToPlace at = FindAngles(geometry, campaign.x_mm[row], campaign.y_mm[row],
                                          campaign.cmd_deg[0][row], campaign.cmd_deg[1][row]);
      if (!at.reached) {
        seen_before = false;
        continue;
      }
      const double at_deg[2] = {at.theta_deg, at.phi_deg};
      for (const std::size_t axis : {kTheta, kPhi})
        if (closed || seen_before)
          Add(row, end, axis, closed ? campaign.from_deg[axis][row] : before_deg[axis],
              at_deg[axis]);
      for (const std::size_t axis : {kTheta, kPhi}) before_deg[axis] = at_deg[axis];
      seen_before = true;
    }
  }
  [[nodiscard]] const std::vector<SeenTurn>& of(std::size_t axis) const { return turns_[axis]; }
  [[nodiscard]] double rms_um() const {
    return rows_ > 0 ? kUmPerMm * std::sqrt(square_sum_ / static_cast<double>(rows_))
                     : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  void Add(std::size_t row, std::size_t end, std::size_t axis, double from_deg, double at_deg) {
    const double asked = campaign_.cmd_deg[axis][row] - campaign_.from_deg[axis][row];
    if (asked == 0) return;
    // A place tells an angle but for whole turns. The camera's next word tells them, else the turn
    // is near what was asked.
    const bool seen_next = !closed_.empty() && row + 1 < end && closed_[row + 1] > 0.5;
    const double about = seen_next ? campaign_.from_deg[axis][row + 1] : from_deg + asked;
    double made = about + std::remainder(at_deg - about, 360.0) - from_deg;
    // A motor may turn less than it was asked, and hardly more.
    const double way = std::copysign(1.0, asked);
    if (!seen_next && made * way > asked * way + kWrap_deg && made * way - 360 > -kWrap_deg)
      made -= 360 * way;
    turns_[axis].push_back({asked, made, at_deg});
  }

  const Campaign& campaign_;
  std::span<const double> closed_;
  std::vector<SeenTurn> turns_[2];
  double square_sum_ = 0;
  std::size_t rows_ = 0;
};

/// Whole turns end at the place where they began, as an axis does that does not turn at all. Such a
/// move is no evidence of either.
bool MayBeNone(const SeenTurn& turn) {
  return std::abs(turn.made_deg) > 180 &&
         std::abs(std::remainder(turn.made_deg, 360.0)) < StallOf_deg(turn);
}

AxisReport ReportOf(std::vector<SeenTurn> turns) {
  AxisReport report;
  report.moves = turns.size();
  std::erase_if(turns, MayBeNone);
  std::size_t long_moves = 0;
  std::vector<double> places;
  for (SeenTurn& turn : turns) {
    const double beyond = turn.made_deg - turn.asked_deg;
    if (std::abs(std::abs(beyond) - 360) <= kWrap_deg && std::abs(turn.made_deg) >= kLong_deg) {
      ++report.wraps;
      turn.made_deg -= std::copysign(360.0, beyond);
    }
    places.push_back(turn.at_deg);
    if (std::abs(turn.asked_deg) < kLong_deg) continue;
    ++long_moves;
    if (std::abs(turn.made_deg) < StallOf_deg(turn)) ++report.stalls;
  }
  report.scale_cw = ScaleOf(turns, -1), report.scale_ccw = ScaleOf(turns, 1);
  report.is = ClassOf(report, long_moves);
  if (report.is == AxisClass::kStuck) report.stuck_at_deg = Median(std::move(places));
  return report;
}

}  // namespace

std::string_view Name(AxisClass axis_class) {
  switch (axis_class) {
    case AxisClass::kHealthy:
      return "healthy";
    case AxisClass::kScale:
      return "scale";
    case AxisClass::kSlipping:
      return "slipping";
    case AxisClass::kStuck:
      return "stuck";
    case AxisClass::kWrapped:
      return "wrapped";
    case AxisClass::kUnknown:
      break;
  }
  return "unknown";
}

std::vector<AxisReport> ClassifyAxes(const Campaign& campaign,
                                     const std::vector<CampaignUnit>& units) {
  std::vector<AxisReport> axes;
  for (std::size_t unit = 0; unit < units.size(); ++unit) {
    const Turns turns(campaign, units[unit], campaign.first_row[unit],
                      campaign.first_row[unit + 1]);
    for (const std::size_t axis : {kTheta, kPhi}) {
      AxisReport report = ReportOf(turns.of(axis));
      report.unit_id = units[unit].id, report.axis = axis, report.rms_um = turns.rms_um();
      axes.push_back(report);
    }
  }
  return axes;
}

std::map<std::string, std::size_t> CountByClass(const std::vector<AxisReport>& axes) {
  std::map<std::string, std::size_t> count;
  for (const AxisReport& axis : axes) ++count[std::string(Name(axis.is))];
  return count;
}

}  // namespace focalfleet::sim
