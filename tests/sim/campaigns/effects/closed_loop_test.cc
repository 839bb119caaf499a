// Closed loops are compared with units that are simulated: the camera sees a fibre, the coordinator
// turns the place into angles by the table, and the unit turns by what the command is beyond them.
#include "sim/campaigns/effects/closed_loop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/model/far_angles.h"
#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/planting/planted.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using focalfleet::test::TestSeed;

constexpr double kRadians = std::numbers::pi / 180;
constexpr std::size_t kMoves = 40;

CampaignUnit Unit(std::uint32_t id) {
  CampaignUnit unit{.id = id, .base_x_mm = 12.0 * id, .base_y_mm = -7};
  unit.arm_mm[kTheta] = 3, unit.arm_mm[kPhi] = 3.2;
  unit.zero_deg[kTheta] = 30, unit.zero_deg[kPhi] = -10;
  unit.gear[kTheta] = unit.gear[kPhi] = 337;
  unit.min_deg[kTheta] = -190, unit.max_deg[kTheta] = 190;
  unit.min_deg[kPhi] = 0, unit.max_deg[kPhi] = 180;
  return unit;
}

// A place in the middle of the patrol area, where arms are neither stretched nor folded.
double Target(std::size_t axis, Rng* rng) {
  return axis == kTheta ? rng->Uniform(-170, 170) : rng->Uniform(45, 150);
}

void Add(const char* column, double value, Campaign* campaign) {
  campaign->covariates.push_back({column, std::vector<double>(campaign->rows(), value)});
}

// Three units. Each move begins up to two degrees from where the one before was to end. Now and
// then an axis is not moved, and all units are homed once.
Campaign ClosedCampaign(std::uint64_t seed) {
  Campaign campaign{.units = {Unit(1), Unit(2), Unit(3)}, .first_row = {0}};
  Rng rng = Rng::Stream(seed, "closed loop");
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    double last_deg[2] = {10, 90};
    for (std::size_t move = 0; move < kMoves; ++move) {
      campaign.move_id.push_back(static_cast<std::int64_t>(move) + 1);
      for (const std::size_t axis : {kTheta, kPhi}) {
        const double from = last_deg[axis] + rng.Uniform(-2, 2);
        last_deg[axis] = rng.Uniform() < 0.2 ? from : Target(axis, &rng);
        campaign.from_deg[axis].push_back(from);
        campaign.cmd_deg[axis].push_back(last_deg[axis]);
      }
      const PlacePoint at = PlaceOf(campaign.units[unit], last_deg[kTheta], last_deg[kPhi]);
      campaign.x_mm.push_back(at.x_mm), campaign.y_mm.push_back(at.y_mm);
    }
    campaign.first_row.push_back(campaign.rows());
  }
  Add("from_measured", 1, &campaign);
  Add("rehomed", 0, &campaign);
  for (std::size_t row = kMoves / 2; row < campaign.rows(); row += kMoves)
    campaign.covariates.back().values[row] = 1;
  EXPECT_TRUE(Validate(campaign));
  return campaign;
}

Template FormOf(const char* cause, EffectAxis axis, const CampaignFacts& facts) {
  const Templates forms = ListTemplates(*FindEffect(cause), facts);
  const auto form = std::ranges::find(forms, axis, &Template::axis);
  EXPECT_NE(form, forms.end()) << cause;
  return *form;
}

PoseErrors ErrorsOf(const UnitTrack& track, const Template& form,
                    const std::vector<double>& amplitude) {
  PoseErrors errors;
  errors.Reset(track.moves);
  AddErrors(track, form, amplitude, &errors);
  return errors;
}

// All errors are those of this axis' angle.
template <class Expected>
void ExpectAngleErrors(const PoseErrors& errors, std::size_t axis, Expected&& expected) {
  const auto channels = errors.channels();
  for (std::size_t i = 0; i < errors.x_mm.size(); ++i)
    for (std::size_t k = 0; k < channels.size(); ++k)
      ASSERT_NEAR((*channels[k])[i], k == axis ? expected(i) : 0, 1e-10)
          << "move " << i << ", channel " << k;
}

template <class Test>
void WithEveryAxis(const Test& test) {
  const std::uint64_t seed = TestSeed(41);
  FOCALFLEET_TRACE_SEED(seed);
  const Campaign campaign = ClosedCampaign(seed);
  const CampaignFacts facts = MakeFacts(campaign);
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (const EffectAxis axis : {EffectAxis::kTheta, EffectAxis::kPhi})
      test(facts, MakeTrack(facts, unit, campaign.units[unit]), axis);
}

TEST(ClosedLoop, AScaleErrsByAShareOfEachMoveAndNothingAddsUp) {
  WithEveryAxis([](const CampaignFacts& facts, const UnitTrack& track, EffectAxis axis) {
    const Template form = FormOf("gear_scale", axis, facts);
    ASSERT_EQ(form.memory, Memory::kChain);
    const std::size_t at = AxisIndex(form);
    ExpectAngleErrors(ErrorsOf(track, form, {-0.4}), at,
                      [&](std::size_t i) { return -0.4 * track.step_deg[at][i]; });
  });
}

TEST(ClosedLoop, RampTravelIsTheSameInEachMove) {
  WithEveryAxis([](const CampaignFacts& facts, const UnitTrack& track, EffectAxis axis) {
    const Template form = FormOf("ramp_travel", axis, facts);
    ASSERT_EQ(form.memory, Memory::kChain);
    const std::size_t at = AxisIndex(form);
    ExpectAngleErrors(ErrorsOf(track, form, {1.5}), at, [&](std::size_t i) {
      const double step = track.step_deg[at][i];
      return step == 0 ? 0 : std::copysign(1.5, step);
    });
  });
}

TEST(ClosedLoop, AnErrorOfTheAngleEntersLessTheOneThatTheMoveBeganWith) {
  WithEveryAxis([](const CampaignFacts& facts, const UnitTrack& track, EffectAxis axis) {
    const Template form = FormOf("eccentricity", axis, facts);
    const std::size_t at = AxisIndex(form);
    const auto error = [](double angle_deg) {
      return 0.2 * std::sin(angle_deg * kRadians) - 0.1 * std::cos(angle_deg * kRadians);
    };
    // A homing tells the coordinator nothing of the error that the stop's angle has.
    ExpectAngleErrors(ErrorsOf(track, form, {0.2, -0.1}), at, [&](std::size_t i) {
      const double before = track.restarts[i] != 0 ? 0 : error(track.from_deg[at][i]);
      return error(track.cmd_deg[at][i]) - before;
    });
  });
}

TEST(ClosedLoop, ABeginningHasTheConditionsOfTheExposureThatSawIt) {
  const std::uint64_t seed = TestSeed(42);
  FOCALFLEET_TRACE_SEED(seed);
  Campaign campaign = ClosedCampaign(seed);
  Add("temp_C", 0, &campaign);
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    campaign.covariates.back().values[row] = static_cast<double>(row);
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 1, campaign.units[1]);
  ASSERT_NE(track.beginnings, nullptr);
  const UnitTrack& along = track.beginnings->track;
  const std::span<const double> temperature = along.Column("temp_C");
  ASSERT_EQ(along.moves, 2 * track.moves);
  ASSERT_EQ(temperature.size(), 2 * track.moves);
  for (std::size_t i = 0; i < track.moves; ++i) {
    const std::size_t row = track.first_row + i;
    const std::size_t seen = track.restarts[i] != 0 ? row : row - 1;
    EXPECT_TRUE(along.IsBeginning(2 * i) && !along.IsBeginning(2 * i + 1)) << i;
    EXPECT_EQ(temperature[2 * i], static_cast<double>(seen)) << i;
    EXPECT_EQ(temperature[2 * i + 1], static_cast<double>(row)) << i;
    EXPECT_EQ(along.step_deg[kTheta][2 * i], 0) << i;
    EXPECT_EQ(along.cmd_deg[kTheta][2 * i], track.from_deg[kTheta][i]) << i;
  }
}

// The campaign of a unit that stands otherwise than the table says. Its first move is homed.
Campaign Simulated(const CampaignUnit& table, const CampaignUnit& truth, std::uint64_t seed) {
  Campaign campaign{.units = {table}, .first_row = {0, kMoves}};
  Rng rng = Rng::Stream(seed, "simulated");
  double true_deg[2] = {10, 90};
  for (std::size_t move = 0; move < kMoves; ++move) {
    campaign.move_id.push_back(static_cast<std::int64_t>(move) + 1);
    const PlacePoint seen = PlaceOf(truth, true_deg[kTheta], true_deg[kPhi]);
    const AnglesToPlace by_table =
        FindAngles(table, seen.x_mm, seen.y_mm, true_deg[kTheta], true_deg[kPhi]);
    EXPECT_TRUE(by_table.reached);
    const double from_deg[2] = {move == 0 ? true_deg[kTheta] : by_table.theta_deg,
                                move == 0 ? true_deg[kPhi] : by_table.phi_deg};
    for (const std::size_t axis : {kTheta, kPhi}) {
      const double cmd = Target(axis, &rng);
      campaign.from_deg[axis].push_back(from_deg[axis]);
      campaign.cmd_deg[axis].push_back(cmd);
      true_deg[axis] += cmd - from_deg[axis];
    }
    const PlacePoint at = PlaceOf(truth, true_deg[kTheta], true_deg[kPhi]);
    campaign.x_mm.push_back(at.x_mm), campaign.y_mm.push_back(at.y_mm);
  }
  Add("from_measured", 1, &campaign);
  return campaign;
}

double FarthestOff_mm(const Campaign& campaign, const UnitTrack& track, const PoseErrors& errors) {
  double most = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const PlacePoint at =
        PlaceOf(*track.unit, track.cmd_deg[kTheta][i] + errors.angle_deg[kTheta][i],
                track.cmd_deg[kPhi][i] + errors.angle_deg[kPhi][i]);
    most =
        std::max(most, std::hypot(at.x_mm + errors.x_mm[i] - campaign.x_mm[track.first_row + i],
                                  at.y_mm + errors.y_mm[i] - campaign.y_mm[track.first_row + i]));
  }
  return most;
}

const Effect kShift{.cause = "shift",
                    .amplitude_unit = "mm",
                    .prior_size = 0.01,
                    .owner = Owner::kUnit,
                    .needs = {},
                    .paragraph = "",
                    .list = [](const CampaignFacts&, Templates*) {},
                    .apply =
                        [](const UnitTrack& track, const Template&,
                           std::span<const double> amplitude, PoseErrors* errors) {
                          for (std::size_t i = 0; i < track.moves; ++i)
                            errors->x_mm[i] += amplitude[0], errors->y_mm[i] += amplitude[1];
                        }};

// The coordinator takes the shift for a turn, and turns back by it. Both errors cancel but for the
// pose in which each acts, up to the square of the shift.
TEST(ClosedLoop, AConstantShiftIsTakenForATurnAndCancelsToFirstOrder) {
  const std::uint64_t seed = TestSeed(43);
  FOCALFLEET_TRACE_SEED(seed);
  const CampaignUnit table = Unit(4);
  for (const double size_mm : {0.02, 0.002})
    for (const double direction : {0.3, 1.9, 4.0}) {
      CampaignUnit truth = table;
      const double x_mm = size_mm * std::cos(direction), y_mm = size_mm * std::sin(direction);
      truth.base_x_mm += x_mm, truth.base_y_mm += y_mm;
      const Campaign campaign = Simulated(table, truth, seed);
      const CampaignFacts facts = MakeFacts(campaign);
      const UnitTrack track = MakeTrack(facts, 0, campaign.units[0]);
      const Template form{.effect = &kShift, .columns = 2};
      const PoseErrors errors = ErrorsOf(track, form, {x_mm, y_mm});
      const double second_order_mm = size_mm * size_mm / table.arm_mm[kTheta];
      EXPECT_LT(FarthestOff_mm(campaign, track, errors), 15 * second_order_mm)
          << size_mm << " mm, direction " << direction;
      EXPECT_EQ(errors.angle_deg[kTheta][0], 0) << "homed";
      for (std::size_t i = 0; i < track.moves; ++i) EXPECT_EQ(errors.x_mm[i], x_mm);
    }
}

// A move that is hardly one leaves the fibre where the camera saw it, whatever shifts it.
TEST(ClosedLoop, AConstantShiftDoesNothingInAMoveOfNoLength) {
  const CampaignUnit table = Unit(5);
  CampaignUnit truth = table;
  truth.base_x_mm += 0.02, truth.base_y_mm -= 0.01;
  Campaign campaign = Simulated(table, truth, 1);
  for (const std::size_t axis : {kTheta, kPhi}) campaign.cmd_deg[axis] = campaign.from_deg[axis];
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 0, campaign.units[0]);
  const Template form{.effect = &kShift, .columns = 2};
  const PoseErrors errors = ErrorsOf(track, form, {0.02, -0.01});
  for (std::size_t i = 1; i < track.moves; ++i) {
    const double theta = errors.angle_deg[kTheta][i] * kRadians;
    const double phi = errors.angle_deg[kPhi][i] * kRadians;
    const double ex = track.elbow_x_mm[i], ey = track.elbow_y_mm[i];
    const double rx = track.reach_x_mm[i], ry = track.reach_y_mm[i];
    EXPECT_NEAR(errors.x_mm[i] - (ey + ry) * theta - ry * phi, 0, 1e-7) << i;
    EXPECT_NEAR(errors.y_mm[i] + (ex + rx) * theta + rx * phi, 0, 1e-7) << i;
  }
}

TEST(ClosedLoop, AGeometryThatIsNotTheTablesMisleadsAsTheMoveBegins) {
  const std::uint64_t seed = TestSeed(44);
  FOCALFLEET_TRACE_SEED(seed);
  const CampaignUnit table = Unit(6);
  CampaignUnit truth = table;
  truth.base_x_mm += 0.05, truth.base_y_mm -= 0.04;
  truth.arm_mm[kTheta] += 0.03, truth.arm_mm[kPhi] -= 0.02;
  truth.zero_deg[kTheta] += 0.7, truth.zero_deg[kPhi] -= 0.4;
  const Campaign campaign = Simulated(table, truth, seed);
  const CampaignFacts facts = MakeFacts(campaign);
  const UnitTrack track = MakeTrack(facts, 0, truth);
  ASSERT_NE(track.beginnings, nullptr);
  PoseErrors errors;
  errors.Reset(track.moves);
  EXPECT_GT(FarthestOff_mm(campaign, track, errors), 1e-2) << "the geometry misleads nobody";
  for (const std::size_t axis : {kTheta, kPhi})
    errors.angle_deg[axis] = track.beginnings->begin_error_deg[axis];
  EXPECT_LT(FarthestOff_mm(campaign, track, errors), 1e-4);
}

TEST(ClosedLoop, AnOpenLoopHasTheErrorsOfTheEffectItself) {
  auto campaign = PlantCampaign({.units = 7, .moves = 30, .seed = 4, .homing_share = 0.05});
  ASSERT_TRUE(campaign) << campaign.error().text;
  std::erase_if(campaign->covariates,
                [](const Covariate& column) { return column.name == "from_measured"; });
  for (const bool has_column : {false, true}) {
    if (has_column) Add("from_measured", 0, &*campaign);
    const CampaignFacts facts = MakeFacts(*campaign);
    EXPECT_TRUE(facts.closed.empty());
    const UnitTrack track = MakeTrack(facts, 3, campaign->units[3]);
    EXPECT_EQ(track.beginnings, nullptr);
    for (const Effect& effect : EffectLibrary()) {
      if (!std::ranges::all_of(effect.needs, [&](auto name) { return facts.Has(name); })) continue;
      for (const Template& form : ListTemplates(effect, facts)) {
        const std::vector<double> amplitude(form.columns, effect.prior_size);
        PoseErrors plain;
        plain.Reset(track.moves);
        effect.apply(track, form, amplitude, &plain);
        const PoseErrors errors = ErrorsOf(track, form, amplitude);
        for (std::size_t k = 0; k < plain.channels().size(); ++k)
          ASSERT_EQ(*errors.channels()[k], *plain.channels()[k]) << effect.cause << form.label;
      }
    }
  }
}

struct Pose {
  double elbow_x_mm, elbow_y_mm, reach_x_mm, reach_y_mm;
};
Pose PoseAt(double theta_deg, double bend_deg) {
  const double theta = theta_deg * kRadians, both = (theta_deg + bend_deg) * kRadians;
  return {3 * std::cos(theta), 3 * std::sin(theta), 3.2 * std::cos(both), 3.2 * std::sin(both)};
}
// The shift of the fibre by small turns.
PlacePoint ShiftBy(const Pose& p, double theta_deg, double phi_deg) {
  const double theta = theta_deg * kRadians, phi = phi_deg * kRadians;
  return {-(p.elbow_y_mm + p.reach_y_mm) * theta - p.reach_y_mm * phi,
          (p.elbow_x_mm + p.reach_x_mm) * theta + p.reach_x_mm * phi};
}
std::array<double, 2> AnglesOf(const Pose& p, const PlacePoint& shift) {
  return AnglesOfShift(p.elbow_x_mm, p.elbow_y_mm, p.reach_x_mm, p.reach_y_mm, shift.x_mm,
                       shift.y_mm);
}

TEST(AnglesOfShift, AreTheTurnsThatMakeTheShift) {
  const std::uint64_t seed = TestSeed(45);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng = Rng::Stream(seed, "turns");
  for (int k = 0; k < 2000; ++k) {
    const double bend = rng.Uniform(15, 165);
    const Pose pose = PoseAt(rng.Uniform(-180, 180), bend);
    const double theta = rng.Uniform(-1, 1), phi = rng.Uniform(-1, 1);
    const auto found = AnglesOf(pose, ShiftBy(pose, theta, phi));
    ASSERT_NEAR(found[kTheta], theta, 1e-6) << "bend " << bend;
    ASSERT_NEAR(found[kPhi], phi, 1e-6) << "bend " << bend;
  }
}

// No turn moves a stretched arm along itself. Across it a turn of a degree stays one.
TEST(AnglesOfShift, OfAStretchedOrFoldedArmAreFinite) {
  for (const double bend : {0.0, 0.01, 1.0, -1.0, 179.0, 180.0}) {
    const Pose pose = PoseAt(25, bend);
    const double length = std::hypot(pose.elbow_x_mm, pose.elbow_y_mm);
    const PlacePoint along{0.01 * pose.elbow_x_mm / length, 0.01 * pose.elbow_y_mm / length};
    for (const double turn : AnglesOf(pose, along)) {
      EXPECT_TRUE(std::isfinite(turn)) << bend;
      EXPECT_LT(std::abs(turn), 10) << bend;
    }
    const PlacePoint across = ShiftBy(pose, 0, 1);
    const auto found = AnglesOf(pose, across);
    const PlacePoint made = ShiftBy(pose, found[kTheta], found[kPhi]);
    EXPECT_NEAR(std::hypot(made.x_mm - across.x_mm, made.y_mm - across.y_mm), 0, 2e-3) << bend;
  }
}

}  // namespace
}  // namespace focalfleet::sim
