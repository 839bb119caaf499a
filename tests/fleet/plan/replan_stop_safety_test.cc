// Late moves and early ends: the pairs that stay clear when units are stopped, and how these units
// go on.
#include <gtest/gtest.h>

#include <cstdio>
#include <set>

#include "fleet/plan/replan.h"
#include "tests/fleet/plan/replan_question.h"

namespace focalfleet {
namespace {

using test::Begun;
using test::DrawQuestion;
using test::ExpectEndsAt;
using test::kDraws;
using test::kLateSkewS;
using test::kSeeds;
using test::Pair;
using test::TestSeed;
using test::UnclearPairs;
using test::UnderWay;

// The late unit or one of its neighbours ends early. With their followers stopped in time all pairs
// are clear, but those that were named.
TEST(Replan, KeepsStopSafety) {
  int draws = 0;
  int unnoticed = 0;
  int matters = 0;
  for (std::uint64_t k = 0; k < kSeeds; ++k) {
    const std::uint64_t seed = TestSeed(720 + k);
    FOCALFLEET_TRACE_SEED(seed);
    auto fleet = Begun(331, seed);
    ASSERT_TRUE(fleet);
    Rng rng = Rng::Stream(seed, "replan");
    for (int n = 0; n < kDraws; ++n) {
      const auto draw = DrawQuestion(&*fleet, &rng, n % 8 < 4 ? 0 : 1 + n % 3);
      if (!draw || draw->failed) continue;
      const auto late = fleet->running().Replan(draw->question, draw->deviations);
      if (!late) continue;
      fleet->Go(*late, {});
      std::vector<std::uint32_t> candidates{draw->unit, draw->unit};
      for (const PositionerIndex j : fleet->fleet().layout.neighbours({draw->unit}))
        if (fleet->Moves(j.value, draw->question.now_s)) candidates.push_back(j.value);
      for (const std::uint32_t ends : candidates) {
        UnderWay then = *fleet;
        const double sign = rng.Below(2) == 0 ? 1 : -1;
        then.SetLateClock(draw->unit, {sign * kLateSkewS, 1 - sign * 0.005});
        const double until_s = ends == draw->unit ? late->end_s : then.EndOf(ends);
        const double t_s = rng.Uniform(draw->question.now_s, until_s);
        ends == draw->unit ? then.StopLate(ends, t_s) : then.Stop(ends, t_s);
        const std::set<std::uint32_t> concerned{draw->unit, ends};
        matters += then.Unclear(concerned, draw->question.now_s).pairs.empty() ? 0 : 1;
        const bool latest = rng.Below(2) == 0;
        then.StopFollowers(ends,
                           [&](double) { return latest ? t_s + 1 : rng.Uniform(t_s, t_s + 1); });
        ++draws;
        const UnclearPairs unclear = then.Unclear(concerned, draw->question.now_s);
        for (const Pair& pair : unclear.pairs) {
          const bool named = then.IsUnnoticed(pair);
          unnoticed += named ? 1 : 0;
          EXPECT_TRUE(named) << "late unit index " << draw->unit << ", " << ends << " ends at "
                             << t_s << " s:\n"
                             << unclear.text;
        }
      }
    }
  }
  std::printf("%d early ends, %d of them matter; %d unclear pairs, named as unnoticed\n", draws,
              matters, unnoticed);
  EXPECT_GT(matters, 20) << "the stops made no difference, the test proves nothing";
}

/// Replans one unit after the other. Each sees the late moves of those before it, and where the
/// units stand that come after it or found no way.
std::vector<Result<LateMove>> ReplanOneByOne(const RunningPlan& running,
                                             std::span<const ReplanQuestion> questions,
                                             std::span<const Deviation> deviations) {
  std::vector<Deviation> all(deviations.begin(), deviations.end());
  for (const ReplanQuestion& question : questions) {
    std::erase_if(all, [&](const Deviation& d) { return d.unit == question.unit; });
    all.push_back({question.unit, Exactly(Witness::kReported, question.from), std::nullopt});
  }
  std::vector<Result<LateMove>> answers(questions.size(),
                                        Fail(ErrorCode::kRefused, "was not looked at"));
  // A unit may end where another still stands: it is planned again once another has left.
  for (bool left = true; left;) {
    left = false;
    for (std::size_t n = 0; n < questions.size(); ++n) {
      if (answers[n]) continue;
      answers[n] = running.Replan(questions[n], all);
      if (!answers[n]) continue;
      left = true;
      const auto mine = std::find_if(all.begin(), all.end(), [&](const Deviation& deviation) {
        return deviation.unit == questions[n].unit;
      });
      mine->goes = *answers[n];
    }
  }
  return answers;
}

// A unit and all that were stopped because of it go on to their targets, each around those before
// it.
TEST(Replan, SeveralGoOnOneAfterTheOther) {
  int asked = 0;
  int served = 0;
  for (std::uint64_t k = 0; k < kSeeds; ++k) {
    const std::uint64_t seed = TestSeed(740 + k);
    FOCALFLEET_TRACE_SEED(seed);
    auto fleet = Begun(331, seed);
    ASSERT_TRUE(fleet);
    Rng rng = Rng::Stream(seed, "several");
    for (int n = 0; n < 10; ++n) {
      fleet->Reset();
      fleet->DrawClocks(&rng, n % 4);
      const double t_s = rng.Uniform(0, 0.7) * fleet->plan().makespan_s;
      for (int m = 0; m < 6; ++m) {
        const auto i = static_cast<std::uint32_t>(rng.Below(fleet->size()));
        if (!fleet->Moves(i, t_s)) continue;
        fleet->Stop(i, t_s);
        fleet->StopFollowers(i, [&](double) { return t_s + 0.5; });
      }
      fleet->Settle();
      const std::vector<Deviation> deviations = fleet->Deviations();
      std::vector<ReplanQuestion> questions;
      for (const Deviation& deviation : deviations)
        questions.push_back({.unit = deviation.unit,
                             .from = PlaceOf(deviation.stands),
                             .to = fleet->PlannedEnd(deviation.unit.value),
                             .now_s = t_s + 0.6,
                             .start_s = t_s + 2,
                             .start_skew_s = kLateSkewS});
      const auto answers = ReplanOneByOne(fleet->running(), questions, deviations);
      ASSERT_EQ(answers.size(), questions.size());
      std::set<std::uint32_t> gone;
      for (std::size_t q = 0; q < answers.size(); ++q) {
        ++asked;
        if (!answers[q]) continue;
        ++served;
        ExpectEndsAt(*answers[q], questions[q]);
        const double sign = rng.Below(2) == 0 ? 1 : -1;
        fleet->Go(*answers[q], {sign * kLateSkewS, 1 - sign * 0.005});
        gone.insert(questions[q].unit.value);
      }
      const UnclearPairs unclear = fleet->Unclear(gone, t_s + 0.6);
      EXPECT_TRUE(unclear.pairs.empty()) << unclear.text;
    }
  }
  std::printf("%d stopped units, %d go on within the configuration\n", asked, served);
  EXPECT_GE(served, asked * 9 / 10);
  EXPECT_GT(asked, 200);
}

}  // namespace
}  // namespace focalfleet
