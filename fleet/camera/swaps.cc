#include "fleet/camera/swaps.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "protocol/base/units.h"

namespace focalfleet {
namespace {

using Complex = std::complex<double>;

constexpr std::size_t kRingMax = 8;   // units of a ring, at most
constexpr double kCommandCellMm = 1;  // of the grid of commands

// The place of the reference arm with a command, zero angle of phi included.
PointFp AtReference(const Unit& reference, const AxisAngles& angles) {
  const double t = angles.theta_deg * kRadiansPerDegree;
  const double p = t + (angles.phi_deg + reference.phi().zero_deg) * kRadiansPerDegree;
  return {reference.theta().arm_mm * std::cos(t) + reference.phi().arm_mm * std::cos(p),
          reference.theta().arm_mm * std::sin(t) + reference.phi().arm_mm * std::sin(p)};
}

class Finder {
 public:
  explicit Finder(const SwapSearch& search)
      : search_(search), layout_(*search.request->layout), reference_(layout_.unit({0})) {}

  SwapFindings Run() {
    FindTraces();
    FindPairs();
    FindRings();
    return std::move(findings_);
  }

 private:
  [[nodiscard]] const UnitExpectation& Expectation(std::uint32_t unit) const {
    return search_.request->expectations[unit];
  }

  void FindTraces() {
    std::vector<PointFp> commands;
    for (const std::uint32_t unit : search_.units)
      commands.push_back(AtReference(reference_, *Expectation(unit).commanded));
    const SpotGrid by_command(commands, kCommandCellMm);
    for (const std::uint32_t unit : search_.units) {
      const Unit& arms = layout_.unit({unit});
      const double differs_mm =
          std::abs(arms.theta().arm_mm - reference_.theta().arm_mm) +
          std::abs(arms.phi().arm_mm - reference_.phi().arm_mm) +
          reference_.phi().arm_mm *
              std::abs(std::remainder(arms.phi().zero_deg - reference_.phi().zero_deg, 360)) *
              kRadiansPerDegree;
      const double gate_mm = GateMm(unit);
      const double reach_mm = arms.theta().arm_mm + arms.phi().arm_mm + gate_mm;
      search_.grid->ForNear(arms.base_fp, reach_mm, [&](std::uint32_t spot, double) {
        if (search_.is_free[spot] == 0) return;
        const PointFp at = search_.spots->at_fp[spot];
        const Complex turned = Complex(at.x_mm - arms.base_fp.x_mm, at.y_mm - arms.base_fp.y_mm) *
                               std::polar(1.0, -arms.theta().zero_deg * kRadiansPerDegree);
        by_command.ForNear({turned.real(), turned.imag()}, gate_mm + differs_mm,
                           [&](std::uint32_t row, double) {
                             TryTrace({unit, search_.units[row], spot});
                           });
      });
    }
    std::sort(findings_.traces.begin(), findings_.traces.end(),
              [](const SwapTrace& a, const SwapTrace& b) {
                if (a.unit != b.unit) return a.unit < b.unit;
                return a.other != b.other ? a.other < b.other : a.spot < b.spot;
              });
    begin_.assign(layout_.size() + 1, 0);
    for (const SwapTrace& trace : findings_.traces) ++begin_[trace.unit + 1];
    for (std::size_t k = 1; k < begin_.size(); ++k) begin_[k] += begin_[k - 1];
  }

  // The widest gate of any place of this unit.
  [[nodiscard]] double GateMm(std::uint32_t unit) const {
    const Unit& arms = layout_.unit({unit});
    const double reach_mm = arms.theta().arm_mm + arms.phi().arm_mm;
    const BlindError& blind = Expectation(unit).blind;
    const double sigma_mm = std::hypot(blind.theta_sigma_deg * kRadiansPerDegree * reach_mm,
                                       blind.phi_sigma_deg * kRadiansPerDegree * arms.phi().arm_mm,
                                       blind.place_sigma_mm) +
                            kMapSigmaMm;
    return std::sqrt(search_.options->gate_squared_sigmas) * sigma_mm;
  }

  void TryTrace(const SwapTrace& trace) {
    if (trace.unit == trace.other) return;
    const Unit& arms = layout_.unit({trace.unit});
    const UnitExpectation& own = Expectation(trace.unit);
    const AxisAngles& command = *Expectation(trace.other).commanded;
    const CovarianceFp covariance = CovarianceAt(arms, command, own.blind);
    const double sigma_mm =
        std::hypot(search_.options->centroid_sigma_mm, search_.spots->sigma_mm[trace.spot]);
    if (SquaredSigmas(FibreAt(arms, command), search_.spots->at_fp[trace.spot], covariance,
                      sigma_mm) <= search_.options->gate_squared_sigmas)
      findings_.traces.push_back(trace);
  }

  [[nodiscard]] std::span<const SwapTrace> TracesOf(std::uint32_t unit) const {
    return std::span(findings_.traces).subspan(begin_[unit], begin_[unit + 1] - begin_[unit]);
  }

  [[nodiscard]] bool HasOwnReason(const SwapTrace& trace) const {
    const auto first =
        std::lower_bound(search_.claims.begin(), search_.claims.end(), trace.unit,
                         [](const Claim& claim, std::uint32_t unit) { return claim.unit < unit; });
    for (auto claim = first; claim != search_.claims.end() && claim->unit == trace.unit; ++claim)
      if (claim->spot == trace.spot) return true;
    return false;
  }

  void FindPairs() {
    std::vector<SwapRing> pairs;
    for (const SwapTrace& there : findings_.traces) {
      if (there.other < there.unit) continue;
      for (const SwapTrace& back : TracesOf(there.other))
        if (back.other == there.unit && back.spot != there.spot)
          pairs.push_back({{there, back}, HasOwnReason(there) && HasOwnReason(back)});
    }
    std::unordered_map<std::uint32_t, int> of_unit;
    std::unordered_map<std::uint32_t, int> of_spot;
    for (const SwapRing& pair : pairs)
      for (const SwapTrace& trace : pair.members) {
        ++of_unit[trace.unit];
        ++of_spot[trace.spot];
      }
    for (SwapRing& pair : pairs) {
      for (const SwapTrace& trace : pair.members)
        pair.ambiguous = pair.ambiguous || of_unit[trace.unit] > 1 || of_spot[trace.spot] > 1;
      findings_.rings.push_back(std::move(pair));
    }
  }

  // Finds rings of three units and more, where each has one other whose command it can have carried
  // out.
  void FindRings() {
    std::vector<char> done(layout_.size(), 0);
    for (const SwapRing& ring : findings_.rings)
      for (const SwapTrace& trace : ring.members) done[trace.unit] = 1;
    for (const SwapTrace& first : findings_.traces) {
      SwapRing ring;
      std::uint32_t unit = first.unit;
      while (done[unit] == 0 && ring.members.size() < kRingMax) {
        const std::span<const SwapTrace> traces = TracesOf(unit);
        if (traces.size() != 1 || HasOwnReason(traces.front())) break;
        ring.members.push_back(traces.front());
        unit = traces.front().other;
        if (unit == first.unit) break;
      }
      if (ring.members.size() < 3 || unit != first.unit || !SpotsDiffer(ring)) continue;
      for (const SwapTrace& trace : ring.members) done[trace.unit] = 1;
      findings_.rings.push_back(std::move(ring));
    }
  }

  static bool SpotsDiffer(const SwapRing& ring) {
    std::vector<std::uint32_t> spots;
    for (const SwapTrace& trace : ring.members) spots.push_back(trace.spot);
    std::sort(spots.begin(), spots.end());
    return std::adjacent_find(spots.begin(), spots.end()) == spots.end();
  }

  static constexpr double kMapSigmaMm = 0.02;  // of the map, added to every gate

  const SwapSearch& search_;
  const Layout& layout_;
  const Unit& reference_;
  SwapFindings findings_;
  std::vector<std::size_t> begin_;  // first of each unit's traces
};

}  // namespace

SwapFindings FindSwaps(const SwapSearch& search) {
  if (search.units.empty()) return {};
  return Finder(search).Run();
}

}  // namespace focalfleet
