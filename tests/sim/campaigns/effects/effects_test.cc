#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/effects/thermal_mass.h"
#include "sim/campaigns/planting/planted.h"

namespace focalfleet::sim {
namespace {

Campaign Made() {
  auto campaign = PlantCampaign({.units = 19, .moves = 30, .seed = 4, .homing_share = 0.05});
  EXPECT_TRUE(campaign) << campaign.error().text;
  // Columns that the plain campaign does not have.
  for (const char* name : {"pixel_x", "pixel_y"}) {
    campaign->covariates.push_back({name, {}});
    for (std::size_t row = 0; row < campaign->rows(); ++row)
      campaign->covariates.back().values.push_back(0.37 * static_cast<double>(row));
  }
  return *campaign;
}

std::vector<double> All(const PoseErrors& errors) {
  std::vector<double> all;
  for (const auto* part : {&errors.angle_deg[0], &errors.angle_deg[1], &errors.arm_mm[0],
                           &errors.arm_mm[1], &errors.x_mm, &errors.y_mm})
    all.insert(all.end(), part->begin(), part->end());
  return all;
}

std::vector<double> Applied(const UnitTrack& track, const Template& form, double size) {
  PoseErrors errors;
  errors.Reset(track.moves);
  std::vector<double> amplitude(form.columns);
  for (std::size_t c = 0; c < form.columns; ++c) amplitude[c] = size * (1 + 0.3 * double(c));
  form.effect->apply(track, form, amplitude, &errors);
  return All(errors);
}

TEST(Effects, EveryEffectExplainsItselfOnce) {
  std::set<std::string_view> causes;
  for (const Effect& effect : EffectLibrary()) {
    EXPECT_TRUE(causes.insert(effect.cause).second) << effect.cause << " is there twice";
    EXPECT_GT(effect.prior_size, 0) << effect.cause;
    EXPECT_GT(effect.paragraph.size(), 60u) << effect.cause;
    EXPECT_EQ(FindEffect(effect.cause), &effect);
  }
}

TEST(Effects, EveryTemplateIsFiniteAndLinearInItsAmplitude) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  for (const Effect& effect : EffectLibrary()) {
    const Templates templates = ListTemplates(effect, facts);
    EXPECT_FALSE(templates.empty()) << effect.cause;
    for (const Template& form : templates)
      for (const std::size_t unit : {std::size_t{0}, std::size_t{11}}) {
        const UnitTrack track = MakeTrack(facts, unit, campaign.units[unit]);
        const auto up = Applied(track, form, 0.01), down = Applied(track, form, -0.01);
        const auto twice = Applied(track, form, 0.02);
        for (std::size_t i = 0; i < up.size(); ++i) {
          ASSERT_TRUE(std::isfinite(up[i])) << effect.cause << ", " << form.label;
          ASSERT_NEAR(up[i], -down[i], 1e-12 + 1e-9 * std::abs(up[i])) << effect.cause;
          ASSERT_NEAR(twice[i], 2 * up[i], 1e-12 + 1e-9 * std::abs(up[i])) << effect.cause;
        }
      }
  }
}

TEST(Effects, BacklashIsASideOfTheGapAndHomingForgetsIt) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  const Templates templates = ListTemplates(*FindEffect("backlash"), facts);
  const UnitTrack track = MakeTrack(facts, 3, campaign.units[3]);
  for (const Template& form : templates) {
    const auto errors = Applied(track, form, 0.2);
    const std::size_t at = AxisIndex(form) * track.moves;
    for (std::size_t i = 0; i < track.moves; ++i) {
      EXPECT_LE(std::abs(errors[at + i]), 0.1 + 1e-12);
      const double step = track.step_deg[AxisIndex(form)][i];
      if (std::abs(step) > std::max(form.shape, 1e-9)) {
        EXPECT_NEAR(errors[at + i], step > 0 ? -0.1 : 0.1, 1e-12) << "the gap is crossed";
      }
      if (track.restarts[i] != 0 && step == 0) {
        EXPECT_EQ(errors[at + i], 0);
      }
    }
  }
}

TEST(Effects, AScaleErrorIsTheDistanceFromTheHoming) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  const Template form = ListTemplates(*FindEffect("gear_scale"), facts).front();
  ASSERT_EQ(form.memory, Memory::kChain);
  const UnitTrack track = MakeTrack(facts, 5, campaign.units[5]);
  const auto errors = Applied(track, form, 1e-3);
  double origin_deg = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i] != 0) origin_deg = track.from_deg[kTheta][i];
    EXPECT_NEAR(errors[i], 1e-3 * (track.cmd_deg[kTheta][i] - origin_deg), 1e-12);
  }
}

TEST(Effects, AToothThatTheAxisNeverReachesDoesNotShow) {
  Campaign campaign = Made();
  const auto shown = [&](double low_deg, double high_deg, EffectAxis axis, double place_deg) {
    std::vector<double>& angle = campaign.cmd_deg[AxisIndex({.axis = axis})];
    for (std::size_t row = 0; row < angle.size(); ++row)
      angle[row] = low_deg + (high_deg - low_deg) * static_cast<double>(row) /
                                 static_cast<double>(angle.size() - 1);
    return Shows(
        MakeFacts(campaign),
        {.effect = FindEffect("tooth_damage"), .axis = axis, .form = 1, .shape = place_deg});
  };
  EXPECT_TRUE(shown(2, 178, EffectAxis::kPhi, 170));
  EXPECT_FALSE(shown(2, 178, EffectAxis::kPhi, 190));
  EXPECT_FALSE(shown(2, 178, EffectAxis::kPhi, 359));
  EXPECT_TRUE(shown(-150, -20, EffectAxis::kTheta, 330));  // -30
  EXPECT_FALSE(shown(-150, -20, EffectAxis::kTheta, 345));
  EXPECT_TRUE(shown(-190, 190, EffectAxis::kTheta, 345));
}

TEST(Effects, AStartSkewBeginsAtAShareOfTheSlots) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  Template form = ListTemplates(*FindEffect("start_skew"), facts).front();
  for (const auto& [share, shows] :
       {std::pair(-0.01, false), {0.0, true}, {0.99, true}, {1.0, false}}) {
    form.shape = share;
    EXPECT_EQ(Shows(facts, form), shows) << share;
  }
}

// The missing way of a move that is cut while it brakes goes with the square of the time, as the
// speed falls evenly. Before the braking begins it is a straight line.
TEST(Effects, AMoveThatIsCutWhileItBrakesMissesLittle) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  const Templates forms = ListTemplates(*FindEffect("start_skew"), facts);
  const double slots = facts.Find("bus_slot")->high + 1;
  for (const double braking : {0.25, 0.5, 1.0}) {
    const auto form = std::ranges::find_if(forms, [&](const Template& one) {
      return one.axis == EffectAxis::kTheta && one.memory == Memory::kNow && one.shape == braking &&
             one.label.find("braking") != std::string::npos;
    });
    ASSERT_NE(form, forms.end());
    EXPECT_TRUE(Shows(facts, *form));
    for (const std::size_t unit : {2u, 5u}) {
      const UnitTrack track = MakeTrack(facts, unit, campaign.units[unit]);
      const auto errors = Applied(track, *form, 0.02);
      for (std::size_t i = 0; i < track.moves; ++i) {
        const double step = track.step_deg[kTheta][i];
        const double late = (track.Column("bus_slot")[i] + 1) / slots;
        // The integral of the speed, which rises from 0 at the end to 1 at `braking` before it.
        double missing = 0, last = 0;
        constexpr int kSteps = 2000;
        for (int k = 0; k < kSteps; ++k) {
          const double at = (k + 0.5) / kSteps, speed = std::min(at / braking, 1.0);
          if (at < late) missing += speed / kSteps;
          last += speed / kSteps;
        }
        const double expected = step == 0 ? 0 : -std::copysign(0.02, step) * missing / last;
        EXPECT_NEAR(errors[i], expected, 1e-4 * 0.02 + 1e-5) << braking << ' ' << i;
      }
    }
  }
}

// Grease that follows Andrade's law stiffens ever faster as it cools; its slope at the reference is
// that of the proportion.
TEST(Effects, GreaseStiffensFasterTheColderItIs) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 5, campaign.units[5]);
  const auto temperature = track.Column("temp_C");
  constexpr double kFrom_C = 12, kSize = 0.02;
  Template form{
      .effect = FindEffect("thermal_backlash"), .axis = EffectAxis::kTheta, .shape = kFrom_C};
  for (const auto& [kind, andrade_K] : {std::pair(0, 0.0), {1, 1750.0}, {2, 2750.0}}) {
    form.form = kind;
    const auto errors = Applied(track, form, kSize);
    std::size_t moved = 0;
    for (std::size_t i = 0; i < track.moves; ++i) {
      const double step = track.step_deg[kTheta][i], warmer = temperature[i] - kFrom_C;
      if (step == 0) continue;
      ++moved;
      const double own_K = temperature[i] + 273.15, from_K = kFrom_C + 273.15;
      const double stiff = std::exp(andrade_K * (1 / own_K - 1 / from_K));
      const double error = kind == 0 ? warmer : from_K * from_K / andrade_K * (1 - stiff);
      EXPECT_NEAR(errors[i], -std::copysign(kSize / 2, step) * error, 1e-12);
      if (kind != 0 && warmer < -0.1) {
        EXPECT_GT(-error, -warmer);
      }
    }
    EXPECT_GT(moved, 10u);
  }
}

TEST(Effects, GearsAreAsWarmAsTheUnitAroundThem) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 5, campaign.units[5]);
  constexpr double kTau_s = 200, kSize = 0.02;
  const auto late = Late(track.Column("temp_C"), track.Column("t_s"), kTau_s);
  const double usual_C = facts.Find("temp_C")->mean;
  const auto errors = Applied(track,
                              {.effect = FindEffect("thermal_backlash"),
                               .axis = EffectAxis::kTheta,
                               .form = 3,
                               .shape = kTau_s},
                              kSize);
  double most = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double step = track.step_deg[kTheta][i];
    if (step == 0) continue;
    EXPECT_NEAR(errors[i], -std::copysign(kSize / 2, step) * (late[i] - usual_C), 1e-12);
    most = std::max(most, std::abs(late[i] - track.Column("temp_C")[i]));
  }
  EXPECT_GT(most, 0.01) << "the unit is never later than the air";
}

// A rotor that holds a load x of its pull-out at nominal drive rests asin(x / drive) behind its
// field.
TEST(Effects, ALagIsTheArcsineOfTheLoadUpToThePullOut) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 5, campaign.units[5]);
  const auto drive = track.Column("drive_amplitude"), volts = track.Column("v_bus_V");
  const double usual_V = facts.Find("v_bus_V")->mean;
  Template form{.effect = FindEffect("load_angle_lag"), .axis = EffectAxis::kTheta, .shape = 0.9};
  for (const bool by_supply : {false, true}) {
    form.form = by_supply ? 3 : 2;
    const auto errors = Applied(track, form, 0.1);
    std::size_t moved = 0;
    for (std::size_t i = 0; i < track.moves; ++i) {
      const double step = track.step_deg[kTheta][i];
      if (step == 0) continue;
      ++moved;
      const double level = drive[i] * (by_supply ? volts[i] / usual_V : 1);
      EXPECT_NEAR(
          errors[i],
          -std::copysign(0.1 * std::asin(std::min(0.9 / level, 1.0)) / std::asin(0.9), step),
          1e-12);
    }
    EXPECT_GT(moved, 10u);
  }
  for (const auto& [load, shows] : {std::pair(0.5, true), {0.99, true}, {1.0, false}}) {
    form.shape = load;
    EXPECT_EQ(Shows(facts, form), shows) << load;
  }
}

// While no axis moves nothing turns the rotor, whatever the drive level is by then.
TEST(Effects, ARotorStaysWhereItCameToRest) {
  Campaign campaign = Made();
  const auto drive = std::ranges::find(campaign.covariates, "drive_amplitude", &Covariate::name);
  const std::size_t row = campaign.first_row[5] + 7;
  campaign.cmd_deg[kTheta][row] = campaign.cmd_deg[kTheta][row - 1];
  drive->values[row - 1] = 0.6, drive->values[row] = 1.5;
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 5, campaign.units[5]);
  ASSERT_EQ(track.step_deg[kTheta][7], 0);
  const Template form{.effect = FindEffect("cogging"),
                      .axis = EffectAxis::kTheta,
                      .columns = 2,
                      .form = 1,
                      .shape = 2};
  const auto errors = Applied(track, form, 0.01);
  EXPECT_NE(errors[6], 0);
  EXPECT_EQ(errors[7], errors[6]);
}

TEST(Effects, ARelaxationThatIsOverBeforeTheExposuresDoesNotShow) {
  Campaign campaign = Made();
  const auto column = std::ranges::find(campaign.covariates, "delay_s", &Covariate::name);
  ASSERT_NE(column, campaign.covariates.end());
  const auto shown = [&](double delay_s, double now_and_then_s, double constant_s) {
    for (std::size_t row = 0; row < campaign.rows(); ++row)
      column->values[row] = row % 10 == 0 ? now_and_then_s : delay_s;
    return Shows(
        MakeFacts(campaign),
        {.effect = FindEffect("relaxation"), .axis = EffectAxis::kPhi, .shape = constant_s});
  };
  EXPECT_FALSE(shown(1, 1, 0.3));
  EXPECT_TRUE(shown(1, 1, 1));
  EXPECT_TRUE(shown(1, 0.1, 0.3));  // an early exposure sees it
  EXPECT_FALSE(shown(1, 0.5, 0.2));
}

// A rotor that holds a load x of its pull-out rests asin(x) behind the field. With a share of the
// voltage gone it rests asin(x / (1 - share)) behind. Forms: three shares of the feed, each at
// three depths; the same shares at any drive come after them.
TEST(Effects, ADroopUnderLoadIsTheDifferenceOfArcsines) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  std::size_t loaded = 0, bent = 0;
  for (const Template& form : ListTemplates(*FindEffect("supply_droop"), facts)) {
    if (form.form < 4 || form.form > 12 || form.axis != EffectAxis::kTheta) continue;
    ++loaded;
    const int feed = (form.form - 4) / 3, deep = (form.form - 4) % 3;
    const double of_feed = feed == 0 ? 0 : feed == 1 ? 0.5 : 1;
    const double depth = deep == 0 ? 0.05 : deep == 1 ? 0.3 : 0.55;
    const UnitTrack track = MakeTrack(facts, 5, campaign.units[5]);
    const auto motors = track.Column(kRailMotors), shared = track.Column(kSharedMotors);
    const auto drive = track.Column("drive_amplitude");
    const double most = facts.Find(kRailMotors)->high, furthest = facts.Find(kSharedMotors)->high;
    const auto errors = Applied(track, form, depth);
    for (std::size_t i = 0; i < track.moves; ++i) {
      const double step = track.step_deg[kTheta][i], x = form.shape / drive[i];
      const double droop = of_feed * motors[i] / most + (1 - of_feed) * shared[i] / furthest;
      const double left = 1 - depth * droop;
      if (step == 0 || x / left > 0.98) continue;
      const double lag = std::asin(x / left) - std::asin(x);
      EXPECT_NEAR(errors[i], step > 0 ? -lag : lag, 1e-12) << form.label;
      const double straight = depth * droop * x / std::sqrt(1 - x * x);
      if (std::abs(straight - lag) > 0.06 * lag) ++bent;
    }
  }
  EXPECT_EQ(loaded, 27u);
  EXPECT_GT(bent, 100u);  // otherwise one depth would do
}

// Only the load counts where the lag does not depend on the drive.
TEST(Effects, ADroopAtAnyDriveIsTheShareOfTheLoad) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  std::size_t undriven = 0;
  for (const Template& form : ListTemplates(*FindEffect("supply_droop"), facts)) {
    if (form.form < 13 || form.form > 15 || form.axis != EffectAxis::kTheta) continue;
    const double of_feed = 0.5 * static_cast<double>(undriven++);
    const UnitTrack track = MakeTrack(facts, 5, campaign.units[5]);
    const auto motors = track.Column(kRailMotors), shared = track.Column(kSharedMotors);
    const double most = facts.Find(kRailMotors)->high, furthest = facts.Find(kSharedMotors)->high;
    const auto errors = Applied(track, form, 0.02);
    for (std::size_t i = 0; i < track.moves; ++i) {
      const double step = track.step_deg[kTheta][i];
      if (step == 0) continue;
      const double droop = of_feed * motors[i] / most + (1 - of_feed) * shared[i] / furthest;
      EXPECT_NEAR(errors[i], (step > 0 ? -0.02 : 0.02) * droop, 1e-12) << form.label;
    }
  }
  EXPECT_EQ(undriven, 3u);
}

// Where a part of the moving units takes the drive away, the rotor stays at the pull-out, and more
// of them do no more.
TEST(Effects, ADroopToThePullOutGoesNoFurther) {
  const Campaign campaign = Made();
  const CampaignFacts facts = MakeFacts(campaign);
  std::size_t forms = 0, at_pull_out = 0, before = 0;
  for (const Template& form : ListTemplates(*FindEffect("supply_droop"), facts)) {
    if (form.form < 16 || form.axis != EffectAxis::kTheta) continue;
    ++forms;
    const UnitTrack track = MakeTrack(facts, 5, campaign.units[5]);
    const auto drive = track.Column("drive_amplitude");
    const auto errors = Applied(track, form, 2.5);
    for (std::size_t i = 0; i < track.moves; ++i) {
      if (track.step_deg[kTheta][i] == 0) continue;
      const double most = std::asin(0.985) - std::asin(std::min(form.shape / drive[i], 0.985));
      EXPECT_LE(std::abs(errors[i]), most + 1e-12) << form.label;
      ++(std::abs(errors[i]) > most - 1e-12 ? at_pull_out : before);
    }
  }
  EXPECT_EQ(forms, 9u);
  EXPECT_GT(at_pull_out, 50u);
  EXPECT_GT(before, 20u);
}

TEST(Effects, AnAmplitudeIsWhatPhysicsAllows) {
  const Template play{.effect = FindEffect("backlash"), .axis = EffectAxis::kTheta, .shape = 2};
  EXPECT_TRUE(CanBe(play, 2, 0));
  EXPECT_TRUE(CanBe(play, -1, 0));
  EXPECT_FALSE(CanBe(play, 0.05, 0)) << "a gap of two degrees loses more than that";
  EXPECT_TRUE(CanBe(play, 0.05, 1)) << "but who knows its amplitude so badly?";
  Template narrow = play;
  narrow.shape = 0;
  EXPECT_TRUE(CanBe(narrow, 0.05, 0));
  const Template rounding{.effect = FindEffect("command_quantisation"), .shape = 0.5};
  EXPECT_TRUE(CanBe(rounding, 1, 0));
  EXPECT_FALSE(CanBe(rounding, 0.1, 0));
  EXPECT_FALSE(CanBe(rounding, -1, 0.1));
  const Template stop{.effect = FindEffect("hard_stop"), .axis = EffectAxis::kPhi, .shape = 4};
  EXPECT_TRUE(CanBe(stop, 1, 0));
  EXPECT_FALSE(CanBe(stop, -0.005, 0)) << "a stop never pulls";
}

TEST(Effects, AMissingColumnLeavesNoTemplates) {
  Campaign campaign = Made();
  std::erase_if(campaign.covariates, [](const Covariate& c) { return c.name == "temp_C"; });
  const CampaignFacts facts = MakeFacts(campaign);
  const Effect& effect = *FindEffect("thermal_backlash");
  EXPECT_EQ(MissingCovariate(effect, facts), "temp_C");
  EXPECT_TRUE(ListTemplates(effect, facts).empty());
}

}  // namespace
}  // namespace focalfleet::sim
