// Questions to the replanner as tests draw them.
#pragma once

#include "tests/fleet/plan/under_way.h"

namespace focalfleet::test {

inline constexpr double kLateSkewS = 0.040;
inline constexpr std::uint64_t kSeeds = 8;
inline constexpr int kDraws = 60;

/// A drawn question. A unit, moving or not, is stopped with those that follow it. Perhaps a
/// neighbour has failed, of which only an interval is known.
struct Draw {
  std::uint32_t unit = 0;
  std::optional<std::uint32_t> failed;
  ReplanQuestion question;
  std::vector<Deviation> deviations;
};

inline std::optional<Draw> DrawQuestion(UnderWay* fleet, Rng* rng, int corner) {
  fleet->Reset();
  fleet->DrawClocks(rng, corner);
  Draw draw;
  draw.unit = static_cast<std::uint32_t>(rng->Below(fleet->size()));
  const double t_s = rng->Uniform(0, fleet->plan().makespan_s);
  const auto stop = [&](std::uint32_t i) {
    if (!fleet->Moves(i, t_s)) return false;
    fleet->Stop(i, t_s);
    fleet->StopFollowers(i, [&](double) { return rng->Uniform(t_s, t_s + 1); });
    return true;
  };
  stop(draw.unit);
  const auto near = fleet->fleet().layout.neighbours({draw.unit});
  const std::uint32_t other = near[rng->Below(near.size())].value;
  if (rng->Below(3) == 0 && fleet->StopOf(other) == kNever && stop(other)) draw.failed = other;
  fleet->Settle();
  draw.deviations = fleet->Deviations();
  if (draw.failed) {
    const Pose stands = fleet->EndPose(*draw.failed);
    for (Deviation& deviation : draw.deviations)
      if (deviation.unit.value == *draw.failed)
        for (std::size_t k = 0; k < kAxisCount; ++k) {
          const auto slack = [&] { return static_cast<std::int32_t>(rng->Below(400)); };
          deviation.stands[k] = {Witness::kInterval, stands[k] - slack(), stands[k] + slack()};
        }
  }
  const auto target = DrawTarget(*fleet, draw.unit, Rng::Stream(rng->Bits(), "target"));
  if (!target) return std::nullopt;
  Pose from = fleet->EndPose(draw.unit);
  if (fleet->StopOf(draw.unit) == kNever) from = fleet->PoseAt(draw.unit, t_s + 1);
  draw.question = {.unit = {draw.unit},
                   .from = from,
                   .to = *target,
                   .now_s = t_s + 1.1,
                   .start_s = t_s + 1.1 + rng->Uniform(0.2, 3),
                   .start_skew_s = kLateSkewS};
  return draw;
}

inline void ExpectEndsAt(const LateMove& late, const ReplanQuestion& question) {
  EXPECT_EQ(late.move.unit, question.unit);
  EXPECT_EQ(late.move.from, question.from);
  EXPECT_EQ(late.move.to, question.to);
  Pose at = question.from;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    for (const Segment& segment : late.move.path[k].segments()) at[k] += segment.delta;
  EXPECT_EQ(at, question.to);
  EXPECT_GE(late.start_s, question.start_s - 1e-9);
  EXPECT_LT(late.start_s, question.start_s + 1e-3);
}

}  // namespace focalfleet::test
