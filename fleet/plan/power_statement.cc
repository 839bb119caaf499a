#include "fleet/plan/power_statement.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fleet/drive_power.h"
#include "fleet/estimate.h"

namespace focalfleet {
namespace {

struct Change {
  std::uint32_t rail = 0;
  double t_s = 0;
  std::int64_t power_nW = 0;
};

/// Sums over ascending changes.
struct Curve {
  double peak_W = 0;
  double energy_J = 0;
  double square_W2s = 0;
};

Curve CurveOf(std::span<const Change> changes) {
  Curve curve;
  std::int64_t now_nW = 0;
  for (std::size_t k = 0; k < changes.size(); ++k) {
    now_nW += changes[k].power_nW;
    if (k + 1 == changes.size() || changes[k + 1].t_s == changes[k].t_s) continue;
    const double now_W = static_cast<double>(now_nW) * 1e-9;
    const double lasts_s = changes[k + 1].t_s - changes[k].t_s;
    curve.peak_W = std::max(curve.peak_W, now_W);
    curve.energy_J += now_W * lasts_s;
    curve.square_W2s += now_W * now_W * lasts_s;
  }
  return curve;
}

double Flatness(const Curve& curve, double makespan_s) {
  if (curve.square_W2s <= 0 || makespan_s <= 0) return 1;
  return curve.energy_J * curve.energy_J / (makespan_s * curve.square_W2s);
}

/// The curves of each rail and, last, of all rails together.
std::vector<std::pair<RailId, Curve>> CurvesOf(std::vector<Change> changes) {
  std::vector<std::pair<RailId, Curve>> curves;
  std::sort(changes.begin(), changes.end(), [](const Change& a, const Change& b) {
    return a.rail != b.rail ? a.rail < b.rail : a.t_s < b.t_s;
  });
  for (std::size_t begin = 0, end = 0; begin < changes.size(); begin = end) {
    while (end < changes.size() && changes[end].rail == changes[begin].rail) ++end;
    curves.emplace_back(RailId{changes[begin].rail},
                        CurveOf(std::span(changes).subspan(begin, end - begin)));
  }
  std::sort(changes.begin(), changes.end(),
            [](const Change& a, const Change& b) { return a.t_s < b.t_s; });
  curves.emplace_back(RailId{}, CurveOf(changes));
  return curves;
}

}  // namespace

PowerStatement StatePower(const Plan& plan, const Layout& layout, std::span<const UnitDrive> drives,
                          const PlanOptions& options) {
  DrivePowers powers(options.motor);
  std::vector<Change> nominal;
  std::vector<Change> widest;
  for (const UnitPlan& move : plan.moves) {
    const UnitDrive& drive = drives[move.unit.value];
    const std::uint32_t rail = layout.unit(move.unit).rail.value;
    for (std::size_t k = 0; k < kAxisCount; ++k)
      for (const Segment& segment : move.path[k].segments()) {
        const SegmentTime time = TimeOf(segment, drive.axis[k]);
        const double power_W =
            powers.Of({AsSent(segment, drive.axis[k]), move.mode, drive.v_bus_V}).total_W();
        const std::int64_t power_nW = std::llround(power_W * 1e9);
        nominal.push_back({rail, time.t0_s, power_nW});
        nominal.push_back({rail, time.t1_s, -power_nW});
        const double error = options.clock_error;
        widest.push_back({rail, time.t0_s / (1 + error) - options.start_skew_s, power_nW});
        widest.push_back({rail, time.t1_s / (1 - error) + options.start_skew_s, -power_nW});
      }
  }
  const auto of = CurvesOf(std::move(nominal));
  const auto most = CurvesOf(std::move(widest));
  PowerStatement statement;
  for (std::size_t k = 0; k + 1 < of.size(); ++k)
    statement.rails.push_back({of[k].first, of[k].second.energy_J, of[k].second.peak_W,
                               most[k].second.peak_W, Flatness(of[k].second, plan.makespan_s)});
  statement.energy_J = of.back().second.energy_J;
  statement.peak_W = of.back().second.peak_W;
  statement.peak_most_W = most.back().second.peak_W;
  statement.flatness = Flatness(of.back().second, plan.makespan_s);
  return statement;
}

}  // namespace focalfleet
