#include "fleet/plan/candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <span>

#include "protocol/base/instants.h"

namespace focalfleet {
namespace {

/// Delays as shares of the time to spare, far from each other first: where one delay meets a
/// neighbour, a slightly longer one does, too.
constexpr std::array kDelays{0.0,   1.0,   0.5,    0.25,   0.75,   0.125, 0.375,
                             0.625, 0.875, 0.0625, 0.3125, 0.5625, 0.8125};

std::uint32_t TicksNotBefore(double t_s) {
  return static_cast<std::uint32_t>(std::ceil(std::max(t_s, 0.0) / kTickS - 1e-6));
}

class Builder {
 public:
  explicit Builder(const CandidateQuestion& question) : q_(question) {
    for (std::size_t k = 0; k < kAxisCount; ++k)
      lasts_s_[k] = Seconds(k, std::abs(q_.to[k] - q_.from[k]));
    FindFolds();
  }

  void AppendStraight(std::vector<Candidate>* out) const;
  void AppendFolding(std::vector<Candidate>* out) const;
  void AppendSliding(std::vector<Candidate>* out) const;
  void AppendAlong(const Way& way, std::vector<Candidate>* out) const;
  void AppendVia(const Way& in, const Way& out, std::vector<Candidate>* made) const;

 private:
  /// Values of phi to fold back to, beyond those of start and target; at most three.
  [[nodiscard]] std::span<const std::int32_t> Folds() const { return {folds_.data(), fold_count_}; }
  void FindFolds();
  [[nodiscard]] double Seconds(std::size_t axis, std::int32_t vectors) const {
    return vectors * SecondsPerVector(q_.drive->axis[axis]);
  }
  [[nodiscard]] std::span<const double> Delays() const {
    return std::span(kDelays).subspan(q_.round.first, q_.round.last - q_.round.first);
  }
  double Add(std::size_t axis, double begin_s, std::int32_t delta, Candidate* to) const {
    const double lasts_s = Seconds(axis, std::abs(delta));
    if (delta == 0) return begin_s;
    const std::uint32_t ticks = TicksNotBefore(begin_s);
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
  /// The arm folds to `fold` from `begin_s` on, and opens again to end at `open_by_s` or as soon as
  /// it can.
  [[nodiscard]] Candidate FoldingAt(std::int32_t fold, double begin_s, double theta_s,
                                    double open_by_s) const {
    Candidate made;
    const double folded_s = Add(1, begin_s, fold - q_.from[1], &made);
    Add(0, theta_s, q_.to[0] - q_.from[0], &made);
    const double opens_s = open_by_s - Seconds(1, std::abs(q_.to[1] - fold));
    Add(1, std::max(folded_s + kTickS, opens_s), q_.to[1] - fold, &made);
    return made;
  }

  /// Leg after leg; before the leg to way[n] the unit waits for waits_s[n] (absent: not at all).
  /// The way never ends where that takes more segments than a move holds. Pre: at least two
  /// corners.
  [[nodiscard]] Candidate Along(const Way& way, std::span<const double> waits_s) const;

  const CandidateQuestion& q_;
  std::array<double, kAxisCount> lasts_s_{};
  std::array<std::int32_t, 3> folds_{};
  std::size_t fold_count_ = 0;
};

void Builder::AppendStraight(std::vector<Candidate>* out) const {
  const double theta = lasts_s_[0];
  const double phi = lasts_s_[1];
  // Begins of theta and phi within the shape.
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

void Builder::FindFolds() {
  const PhiSpan& cell = q_.scene->cell(q_.unit);
  const std::int32_t least = std::max(q_.from[1], q_.to[1]);
  const std::int32_t most = q_.scene->arm(q_.unit).range().high[1];
  const auto add = [&](std::int32_t fold) {
    if (fold > least && fold <= most && (fold_count_ == 0 || folds_[fold_count_ - 1] != fold))
      folds_[fold_count_++] = fold;
  };
  if (cell.low <= cell.high) {
    add(cell.low);
    add((least + cell.low) / 2);
    add((cell.low + std::min(cell.high, most)) / 2);
  } else {
    add((least + most) / 2);
    add(most);
  }
}

void Builder::AppendFolding(std::vector<Candidate>* out) const {
  const double theta = lasts_s_[0];
  for (const double delay : Delays()) {
    for (const std::int32_t fold : Folds()) {
      const double in = Seconds(1, fold - q_.from[1]);
      const double open = Seconds(1, fold - q_.to[1]);
      // Theta begins with the folding, in its middle or after it; the arm opens as late as theta
      // ends, or after it.
      for (const double lead : {0.0, in / 2, in}) {
        for (const double after : {0.0, open / 2, open}) {
          const double lasts = std::max(lead + theta + after, in + open);
          const double spare = q_.within_s - lasts;
          if (spare <= 0 && delay > 0) continue;
          const double begin = std::max(spare, 0.0) * delay;
          out->push_back(FoldingAt(fold, begin, begin + lead, begin + lasts));
          if (theta == 0) break;
        }
        if (theta == 0) break;
      }
    }
  }
}

/// Slides out of the start, goes over to the target and slides in; either slide may be absent.
void Builder::AppendSliding(std::vector<Candidate>* out) const {
  const ArmGeometry& arm = q_.scene->arm(q_.unit);
  const double per_phi = arm.step_rad(Axis::kPhi) / arm.step_rad(Axis::kTheta);
  const auto slid = [&](std::int32_t by_phi, int way) {
    return static_cast<std::int32_t>(std::lround(by_phi * per_phi)) * way;
  };
  for (const double delay : Delays()) {
    for (const std::int32_t fold : Folds()) {
      for (const int way_out : {-1, 0, 1}) {
        for (const int way_in : {-1, 0, 1}) {
          if (way_out == 0 && way_in == 0) continue;
          const std::int32_t out_theta = q_.from[0] + slid(fold - q_.from[1], way_out);
          const std::int32_t in_theta = q_.to[0] + slid(fold - q_.to[1], way_in);
          const auto in_range = [&](std::int32_t theta) {
            return arm.range().low[0] <= theta && theta <= arm.range().high[0];
          };
          if (!in_range(out_theta) || !in_range(in_theta)) continue;
          const double out_s =
              std::max(Seconds(1, fold - q_.from[1]), Seconds(0, std::abs(out_theta - q_.from[0])));
          const double over_s = Seconds(0, std::abs(in_theta - out_theta));
          const double in_s =
              std::max(Seconds(1, fold - q_.to[1]), Seconds(0, std::abs(in_theta - q_.to[0])));
          const double lasts = out_s + over_s + in_s + 3 * kTickS;
          const double spare = std::max(0.0, q_.within_s - lasts);
          // The time to spare is spent at the start, folded before or after crossing, or at the
          // end.
          constexpr std::array<std::array<double, 3>, 4> kWaits{
              {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}, {0, 0.5, 0.5}}};
          for (const auto& waits : kWaits) {
            const double wait = spare * (1 - delay);
            Candidate made;
            double at = wait * waits[0];
            Add(1, at, fold - q_.from[1], &made);
            Add(0, at, out_theta - q_.from[0], &made);
            at += out_s + kTickS + wait * waits[1];
            Add(0, at, in_theta - out_theta, &made);
            at += over_s + kTickS + wait * waits[2];
            Add(1, at, q_.to[1] - fold, &made);
            Add(0, at, q_.to[0] - in_theta, &made);
            out->push_back(made);
            if (spare == 0) break;
          }
        }
      }
    }
  }
}

Candidate Builder::Along(const Way& way, std::span<const double> waits_s) const {
  Candidate made;
  double at = 0;
  for (std::size_t n = 1; n < way.size(); ++n) {
    const Pose& from = way[n - 1].pose;
    const Pose& to = way[n].pose;
    std::optional<InStep> in_step;
    if (way[n].out_of_step < 1) in_step = KeepInStep(from, to, *q_.drive);
    if (n < waits_s.size()) at += waits_s[n];
    const std::uint32_t ticks = TicksNotBefore(at);
    double end_s = ticks * kTickS;
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      if (to[k] == from[k]) continue;
      if (made.path[k].full()) return {{}, std::numeric_limits<double>::infinity()};
      AxisDrive drive = q_.drive->axis[k];
      if (in_step) drive.repeat = in_step->repeat[k];
      made.path[k].Append({ticks, to[k] - from[k], drive.repeat});
      end_s = std::max(end_s, ticks * kTickS + std::abs(to[k] - from[k]) * SecondsPerVector(drive));
    }
    at = end_s + kTickS;
  }
  made.end_s = at;
  return made;
}

void Builder::AppendAlong(const Way& way, std::vector<Candidate>* out) const {
  if (way.size() < 2) return;
  const double spare = std::max(0.0, q_.within_s - Along(way, {}).end_s);
  for (const double delay : kDelays) {
    out->push_back(Along(way, std::array{0.0, spare * delay}));
    if (spare == 0) break;
  }
}

void Builder::AppendVia(const Way& in, const Way& out, std::vector<Candidate>* made) const {
  if (in.empty() || out.empty()) return;
  Way way = in;
  const std::size_t turn = way.size();
  // Within the cell the axes need not keep in step.
  if (out.back().pose != in.back().pose) way.push_back({out.back().pose});
  const std::size_t opens = way.size();
  for (std::size_t n = out.size(); n-- > 1;) way.push_back({out[n - 1].pose, out[n].out_of_step});
  if (way.size() < 2) return;
  const double spare = std::max(0.0, q_.within_s - Along(way, {}).end_s);
  std::vector<double> waits_s;
  for (const auto& [before_turn, before_open] :
       {std::pair{0.0, 1.0}, std::pair{1.0, 0.0}, std::pair{0.0, 0.0}, std::pair{0.5, 0.5},
        std::pair{0.0, 0.5}, std::pair{0.5, 0.0}}) {
    waits_s.assign(way.size() + 1, 0);
    waits_s[turn] += spare * before_turn;
    waits_s[opens] += spare * before_open;
    made->push_back(Along(way, waits_s));
    if (spare == 0) break;
  }
}

}  // namespace

void AppendCandidates(const CandidateQuestion& question, std::vector<Candidate>* candidates) {
  const Builder builder(question);
  switch (question.round.shape) {
    case Shape::kStraight:
      return builder.AppendStraight(candidates);
    case Shape::kFolding:
      return builder.AppendFolding(candidates);
    case Shape::kSliding:
      return builder.AppendSliding(candidates);
  }
}

void AppendAlong(const CandidateQuestion& question, const Way& way,
                 std::vector<Candidate>* candidates) {
  Builder(question).AppendAlong(way, candidates);
}

void AppendVia(const CandidateQuestion& question, const Way& in, const Way& out,
               std::vector<Candidate>* candidates) {
  Builder(question).AppendVia(in, out, candidates);
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

Candidate Delayed(const UnitDrive& drive, const Candidate& straight,
                  const std::array<double, kAxisCount>& begin_s) {
  Candidate later;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    for (Segment segment : straight.path[k].segments()) {
      segment.start_ticks += TicksNotBefore(begin_s[k]);
      const AxisDrive as_sent{drive.axis[k].counter1, segment.repeat, drive.axis[k].subdivision};
      later.path[k].Append(segment);
      later.end_s =
          std::max(later.end_s, segment.start_ticks * kTickS +
                                    std::abs(segment.delta) * SecondsPerVector(as_sent) + kTickS);
    }
  }
  return later;
}

}  // namespace focalfleet
