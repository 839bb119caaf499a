#include "sim/hall/suspicion.h"

#include <algorithm>
#include <utility>

namespace focalfleet::sim {
namespace {

constexpr std::size_t kRowsTried = 12;
constexpr std::size_t kRowsForVerdict = 4;
constexpr double kVarianceLeft = 0.25;
// Share of the variance that the best leaves: within it a hypothesis cannot be distinguished.
constexpr double kNear = 2;
constexpr double kOthersMove_V = 0.1;
constexpr double kHarmless = 0.1;  // of the same: no orientation suffers from it
constexpr double kSuspicious = 9;  // of the usual noise's variance, where rows are few

struct Hypothesis {
  SensorFault fault = SensorFault::kBad;
  std::size_t one = 0;
  std::size_t two = 0;  // of kSwapped
  double variance_T2 = 0;
};

HallReading Under(const HallReading& reading, const Hypothesis& hypothesis) {
  HallReading changed = reading;
  if (hypothesis.fault == SensorFault::kBad) {
    changed.used &= ~(1u << hypothesis.one);
    return changed;
  }
  std::swap(changed.b_T[hypothesis.one], changed.b_T[hypothesis.two]);
  const std::uint32_t one = reading.used >> hypothesis.one & 1u;
  const std::uint32_t two = reading.used >> hypothesis.two & 1u;
  changed.used &= ~(1u << hypothesis.one | 1u << hypothesis.two);
  changed.used |= two << hypothesis.one | one << hypothesis.two;
  return changed;
}

// The mean square residual a degree of freedom over some rows.
template <class Change>
double VarianceLeft(const OrientationSolver& solver, const std::vector<HallReading>& readings,
                    const std::vector<std::size_t>& tried, Change change) {
  double squares = 0;
  int freedom = 0;
  for (const std::size_t row : tried) {
    const auto fits = solver.Solve(change(readings[row]));
    if (fits.empty()) {
      squares += 1e-2;  // nothing fits at all
      freedom += 1;
      continue;
    }
    squares += fits.front().squares_T2;
    freedom += fits.front().sensors - 3;
  }
  return freedom > 0 ? squares / freedom : 0;
}

std::vector<std::size_t> RowsToTry(const std::vector<HallReading>& readings) {
  std::vector<std::size_t> good;
  for (std::size_t r = 0; r < readings.size(); ++r)
    if (__builtin_popcount(readings[r].used) >= 6) good.push_back(r);
  std::vector<std::size_t> tried;
  const std::size_t count = std::min(kRowsTried, good.size());
  for (std::size_t k = 0; k < count; ++k) tried.push_back(good[k * good.size() / count]);
  return tried;
}

struct Line {
  double slope = 0;
  double offset = 0;
  double rms = 0;
  double spread = 0;  // of the fields that it should see
};
// The line of a sensor's readings over the readings that the other sensors predict.
Line AgainstTheOthers(const OrientationSolver& solver, const std::vector<HallReading>& readings,
                      const std::vector<std::size_t>& tried, std::size_t sensor) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
  std::vector<double> predicted(solver.rig().sensors.size());
  for (const std::size_t row : tried) {
    if ((readings[row].used >> sensor & 1u) == 0) continue;
    HallReading rest = readings[row];
    rest.used &= ~(1u << sensor);
    const auto fits = solver.Solve(rest);
    if (fits.empty()) continue;
    solver.Predict(fits.front().orientation, predicted);
    const double x = predicted[sensor], y = readings[row].b_T[sensor];
    n += 1, sx += x, sy += y, sxx += x * x, sxy += x * y, syy += y * y;
  }
  Line line;
  const double wide = n * sxx - sx * sx;
  if (n < 3 || wide <= 0) return line;
  line.slope = (n * sxy - sx * sy) / wide;
  line.offset = (sy - line.slope * sx) / n;
  line.spread = std::sqrt(wide) / n;
  line.rms = std::sqrt(std::max(0.0, syy / n - line.slope * sxy / n - line.offset * sy / n));
  return line;
}

SensorFault KindOf(const Line& line) {
  if (line.spread == 0) return SensorFault::kBad;
  if (line.rms > 0.2 * line.spread && std::abs(line.slope) > 0.15) return SensorFault::kBad;
  if (std::abs(line.slope) < 0.15) return SensorFault::kStuck;
  const double of_gain = std::abs(line.slope - 1) * line.spread;
  return of_gain > std::abs(line.offset) ? SensorFault::kGain : SensorFault::kOffset;
}

// Columns without readings, or with a single value while the others move.
std::vector<SensorVerdict> SilentOrStill(const std::vector<VoltageRow>& rows,
                                         std::vector<HallReading>* readings, std::size_t count) {
  std::vector<SensorVerdict> verdicts;
  std::vector<double> range_V(count, -1);
  for (std::size_t k = 0; k < count; ++k) {
    double low = 1e300, high = -1e300;
    for (const VoltageRow& row : rows)
      if (std::isfinite(row.voltages_V[k])) {
        low = std::min(low, row.voltages_V[k]);
        high = std::max(high, row.voltages_V[k]);
      }
    if (high >= low) range_V[k] = high - low;
  }
  std::vector<double> sorted = range_V;
  std::sort(sorted.begin(), sorted.end());
  const bool others_move = sorted[count / 2] > kOthersMove_V;
  for (std::size_t k = 0; k < count; ++k) {
    const bool missing = range_V[k] < 0;
    const bool still =
        !missing && rows.size() >= kRowsForVerdict && others_move && range_V[k] < kAlike_V;
    if (!missing && !still) continue;
    verdicts.push_back({missing ? SensorFault::kMissing : SensorFault::kStuck, {k}, {}, 0});
    for (HallReading& reading : *readings) reading.used &= ~(1u << k);
  }
  return verdicts;
}

std::vector<Hypothesis> Compare(const OrientationSolver& solver,
                                const std::vector<HallReading>& readings,
                                const std::vector<std::size_t>& tried) {
  const std::size_t count = solver.rig().sensors.size();
  std::uint32_t known = 0;
  for (const std::size_t row : tried) known |= readings[row].used;
  std::vector<Hypothesis> hypotheses;
  for (std::size_t one = 0; one < count; ++one) {
    if ((known >> one & 1u) == 0) continue;
    hypotheses.push_back({SensorFault::kBad, one, one, 0});
    for (std::size_t two = one + 1; two < count; ++two)
      if ((known >> two & 1u) != 0) hypotheses.push_back({SensorFault::kSwapped, one, two, 0});
  }
  for (Hypothesis& hypothesis : hypotheses)
    hypothesis.variance_T2 = VarianceLeft(solver, readings, tried, [&](const HallReading& reading) {
      return Under(reading, hypothesis);
    });
  std::sort(hypotheses.begin(), hypotheses.end(),
            [](const Hypothesis& a, const Hypothesis& b) { return a.variance_T2 < b.variance_T2; });
  return hypotheses;
}

}  // namespace

std::vector<SensorVerdict> SuspectSensors(const OrientationSolver& solver,
                                          const std::vector<VoltageRow>& rows,
                                          std::vector<HallReading>* readings,
                                          double usual_noise_T) {
  const std::size_t count = solver.rig().sensors.size();
  std::vector<SensorVerdict> verdicts = SilentOrStill(rows, readings, count);
  for (int round = 0; round < 2; ++round) {
    const std::vector<std::size_t> tried = RowsToTry(*readings);
    if (tried.empty()) break;
    const double before_T2 =
        VarianceLeft(solver, *readings, tried, [](const HallReading& reading) { return reading; });
    const double usual_T2 = usual_noise_T * usual_noise_T;
    const bool few = tried.size() < kRowsForVerdict;
    if (before_T2 < (few ? kSuspicious : kHarmless) * usual_T2) break;
    const std::vector<Hypothesis> hypotheses = Compare(solver, *readings, tried);
    if (hypotheses.empty()) break;
    const Hypothesis& best = hypotheses.front();
    const double left = best.variance_T2 / before_T2;
    if (left > kVarianceLeft || (few && best.variance_T2 > kSuspicious * usual_T2)) break;
    SensorVerdict verdict{best.fault, {best.one}, {}, left};
    const auto near = [&](const Hypothesis& other) {
      return other.fault == best.fault &&
             other.variance_T2 < kNear * best.variance_T2 + 1e-3 * usual_T2;
    };
    if (best.fault == SensorFault::kSwapped) {
      verdict.sensors.push_back(best.two);
      for (std::size_t k = 1; k < hypotheses.size(); ++k)
        if (near(hypotheses[k]))
          verdict.or_else.insert(verdict.or_else.end(), {hypotheses[k].one, hypotheses[k].two});
    } else {
      if (!few) verdict.fault = KindOf(AgainstTheOthers(solver, *readings, tried, best.one));
      for (std::size_t k = 1; k < hypotheses.size(); ++k)
        if (near(hypotheses[k])) verdict.or_else.push_back(hypotheses[k].one);
    }
    // Several hypotheses cannot be distinguished, so no sensor is left out. Among swaps one is as
    // good as the other, and the orientation is one of two.
    if (verdict.or_else.empty() || best.fault == SensorFault::kSwapped)
      for (HallReading& reading : *readings) reading = Under(reading, best);
    verdicts.push_back(verdict);
    if (!verdict.or_else.empty()) break;
  }
  return verdicts;
}

}  // namespace focalfleet::sim
