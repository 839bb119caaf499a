#include "fleet/plan/candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <span>

namespace focalfleet {
namespace {

constexpr double kTickS = 1e-4;
/// Delays as shares of the time to spare, far from each other first: where one meets somebody, one
/// a little later does so, too.
constexpr std::array kDelays{0.0,   1.0,   0.5,    0.25,   0.75,   0.125, 0.375,
                             0.625, 0.875, 0.0625, 0.3125, 0.5625, 0.8125};

std::uint32_t TicksOf(double t_s) {
  return static_cast<std::uint32_t>(std::ceil(std::max(t_s, 0.0) / kTickS - 1e-6));
}

class Builder {
 public:
  explicit Builder(const CandidateQuestion& question) : q_(question) {
    for (std::size_t k = 0; k < kAxisCount; ++k)
      lasts_s_[k] = Seconds(k, std::abs(q_.to[k] - q_.from[k]));
  }

  void AppendStraight(std::vector<Candidate>* out) const;
  void AppendFolding(std::vector<Candidate>* out) const;

 private:
  [[nodiscard]] double Seconds(std::size_t axis, std::int32_t vectors) const {
    return vectors * SecondsPerVector(q_.drive->axis[axis]);
  }
  [[nodiscard]] std::span<const double> Delays() const {
    return std::span(kDelays).subspan(q_.round.first, q_.round.last - q_.round.first);
  }
  double Add(std::size_t axis, double begin_s, std::int32_t delta, Candidate* to) const {
    const double lasts_s = Seconds(axis, std::abs(delta));
    if (delta == 0) return begin_s;
    const std::uint32_t ticks = TicksOf(begin_s);
    to->path[axis].Append({ticks, delta, q_.drive->axis[axis].repeat});
    const double end_s = ticks * kTickS + lasts_s;
    to->end_s = std::max(to->end_s, end_s);
    return end_s;
  }
  [[nodiscard]] Candidate StraightAt(double theta_s, double phi_s) const {
    Candidate made;
    Add(0, theta_s, q_.to[0] - q_.from[0], &made);
    Add(1, phi_s, q_.to[1] - q_.from[1], &made);
    return made;
  }
  /// Folds to `fold` from `begin_s` on, opens again to end at `open_by_s` or as soon as it can.
  [[nodiscard]] Candidate FoldingAt(std::int32_t fold, double begin_s, double theta_s,
                                    double open_by_s) const {
    Candidate made;
    const double folded_s = Add(1, begin_s, fold - q_.from[1], &made);
    Add(0, theta_s, q_.to[0] - q_.from[0], &made);
    const double opens_s = open_by_s - Seconds(1, std::abs(q_.to[1] - fold));
    Add(1, std::max(folded_s + kTickS, opens_s), q_.to[1] - fold, &made);
    return made;
  }

  const CandidateQuestion& q_;
  std::array<double, kAxisCount> lasts_s_{};
};

void Builder::AppendStraight(std::vector<Candidate>* out) const {
  const double theta = lasts_s_[0];
  const double phi = lasts_s_[1];
  // Begin of theta and phi within the shape.
  std::array<std::array<double, 2>, 5> shapes{};
  std::size_t count = 0;
  shapes[count++] = {0, 0};
  if (theta > 0 && phi > 0) {
    if (theta > phi)
      shapes[count++] = {0, theta - phi};
    else
      shapes[count++] = {phi - theta, 0};
    shapes[count++] = {0, theta};
    shapes[count++] = {phi, 0};
    shapes[count++] = {phi / 2, 0};
  }
  for (const double delay : Delays()) {
    for (std::size_t s = 0; s < count; ++s) {
      const double lasts = std::max(shapes[s][0] + theta, shapes[s][1] + phi);
      const double spare = q_.within_s - lasts;
      if (spare <= 0 && delay > 0) continue;
      if (spare < 0 && s > 0) continue;
      const double begin = std::max(spare, 0.0) * delay;
      out->push_back(StraightAt(begin + shapes[s][0], begin + shapes[s][1]));
    }
  }
}

void Builder::AppendFolding(std::vector<Candidate>* out) const {
  const PhiSpan& cell = q_.scene->cell(q_.unit);
  const std::int32_t least = std::max(q_.from[1], q_.to[1]);
  const std::int32_t most = q_.scene->arm(q_.unit).range().high[1];
  std::array<std::int32_t, 3> folds{};
  std::size_t count = 0;
  const auto add = [&](std::int32_t fold) {
    if (fold > least && fold <= most && (count == 0 || folds[count - 1] != fold))
      folds[count++] = fold;
  };
  if (cell.low <= cell.high) {
    add(cell.low);
    add((least + cell.low) / 2);
    add((cell.low + std::min(cell.high, most)) / 2);
  } else {
    add((least + most) / 2);
    add(most);
  }
  const double theta = lasts_s_[0];
  for (const double delay : Delays()) {
    for (std::size_t f = 0; f < count; ++f) {
      const double in = Seconds(1, folds[f] - q_.from[1]);
      const double open = Seconds(1, folds[f] - q_.to[1]);
      // Theta begins with the folding, in its middle or after it; the arm opens as late as theta
      // ends, or after it.
      for (const double lead : {0.0, in / 2, in}) {
        for (const double after : {0.0, open / 2, open}) {
          const double lasts = std::max(lead + theta + after, in + open);
          const double spare = q_.within_s - lasts;
          if (spare <= 0 && delay > 0) continue;
          const double begin = std::max(spare, 0.0) * delay;
          out->push_back(FoldingAt(folds[f], begin, begin + lead, begin + lasts));
          if (theta == 0) break;
        }
        if (theta == 0) break;
      }
    }
  }
}

}  // namespace

void AppendCandidates(const CandidateQuestion& question, std::vector<Candidate>* candidates) {
  const Builder builder(question);
  if (question.round.folding)
    builder.AppendFolding(candidates);
  else
    builder.AppendStraight(candidates);
}

Candidate Straight(const UnitDrive& drive, const Pose& from, const Pose& to) {
  Candidate made;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    if (to[k] == from[k]) continue;
    made.path[k].Append({0, to[k] - from[k], drive.axis[k].repeat});
    made.end_s = std::max(made.end_s, std::abs(to[k] - from[k]) * SecondsPerVector(drive.axis[k]));
  }
  return made;
}

}  // namespace focalfleet
