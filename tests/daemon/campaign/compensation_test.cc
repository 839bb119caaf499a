#include "daemon/campaign/compensation.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "daemon/campaign/campaign_log.h"
#include "fleet/hex_layout.h"
#include "protocol/base/rng.h"
#include "sim/campaigns/planting/planted.h"
#include "sim/campaigns/effects/empirical.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using sim::kPhi;
using sim::kTheta;

Layout SmallLayout() {
  auto layout = Layout::Create(MakeHexLayout({.count = 7}), {});
  EXPECT_TRUE(layout);
  return std::move(*layout);
}

std::vector<sim::CampaignUnit> Described(const Layout& layout) {
  std::vector<sim::CampaignUnit> units;
  for (const Unit& unit : layout.units()) units.push_back(DescribeUnit(unit));
  return units;
}

sim::ModelTerm TermOf(std::string_view cause, sim::EffectAxis axis, sim::Memory memory,
                      std::size_t units, std::size_t columns, double shape, double size, Rng* rng) {
  sim::ModelTerm term;
  const sim::Effect* empirical = sim::FindEmpirical(cause);
  term.form = {.effect = empirical != nullptr ? empirical : sim::FindEffect(cause),
               .axis = axis,
               .columns = columns,
               .memory = memory,
               .shape = shape};
  term.sharing = sim::Sharing::kUnit;
  for (std::size_t u = 0; u < units; ++u) {
    term.group_of_unit.push_back(static_cast<std::uint32_t>(u));
    for (std::size_t c = 0; c < columns; ++c) term.amplitude.push_back(size * rng->Normal());
  }
  term.sigma.assign(term.amplitude.size(), 0);
  return term;
}

/// The model has gears with errors of the size of service, and arms and zeros of its own.
sim::CampaignModel GearsInService(const Layout& layout, Rng* rng) {
  sim::CampaignModel model;
  model.units = Described(layout);
  for (sim::CampaignUnit& unit : model.units)
    for (const std::size_t axis : {kTheta, kPhi}) {
      unit.arm_mm[axis] += 0.06 * rng->Normal();
      unit.zero_deg[axis] += 0.5 * rng->Normal();
    }
  const std::size_t n = model.units.size();
  model.terms = {
      TermOf("gear_scale", sim::EffectAxis::kTheta, sim::Memory::kChain, n, 1, 0, 3e-3, rng),
      TermOf("scale_asymmetry", sim::EffectAxis::kPhi, sim::Memory::kChain, n, 1, 0, 3e-4, rng),
      TermOf("ramp_travel", sim::EffectAxis::kTheta, sim::Memory::kChain, n, 1, 0, 0.01, rng),
      TermOf("backlash", sim::EffectAxis::kPhi, sim::Memory::kHold, n, 1, 1.5, 0.5, rng),
      TermOf("friction_windup", sim::EffectAxis::kTheta, sim::Memory::kHold, n, 1, 2, 0.1, rng),
      TermOf("eccentricity", sim::EffectAxis::kTheta, sim::Memory::kHold, n, 2, 0, 0.1, rng)};
  return model;
}

/// The moves of all units follow each other without a gap, one row a unit and move.
class Moves {
 public:
  Moves(const Layout& layout, Rng* rng) : units_(Described(layout)), rng_(*rng) {
    for (std::size_t u = 0; u < units_.size(); ++u) poses_.push_back({Drawn(u)});
  }
  void GoAnywhere() {
    for (std::size_t u = 0; u < units_.size(); ++u) poses_[u].push_back(Drawn(u));
  }
  void Go(std::size_t unit, const AxisAngles& to) {
    poses_[unit].push_back({to.theta_deg, to.phi_deg});
  }
  [[nodiscard]] AxisAngles Last(std::size_t unit) const {
    return {poses_[unit].back()[0], poses_[unit].back()[1]};
  }
  [[nodiscard]] sim::Campaign Campaign() const {
    sim::Campaign campaign{.name = "made"};
    campaign.units = units_;
    campaign.first_row = {0};
    for (const auto& way : poses_) {
      for (std::size_t move = 1; move < way.size(); ++move) {
        campaign.move_id.push_back(static_cast<std::int64_t>(move));
        for (const std::size_t axis : {kTheta, kPhi}) {
          campaign.from_deg[axis].push_back(way[move - 1][axis]);
          campaign.cmd_deg[axis].push_back(way[move][axis]);
        }
        campaign.x_mm.push_back(0);
        campaign.y_mm.push_back(0);
      }
      campaign.first_row.push_back(campaign.move_id.size());
    }
    return campaign;
  }

 private:
  std::array<double, 2> Drawn(std::size_t unit) {
    const sim::CampaignUnit& u = units_[unit];
    return {rng_.Uniform(u.min_deg[0], u.max_deg[0]),
            rng_.Uniform(u.min_deg[1] + 20, u.max_deg[1] - 20)};
  }
  std::vector<sim::CampaignUnit> units_;
  std::vector<std::vector<std::array<double, 2>>> poses_;
  Rng& rng_;
};

ModelFile FileOf(const sim::CampaignModel& model, const sim::Campaign& campaign) {
  ModelFile file{.model = model};
  for (const sim::UnitLeft& left : LeftByCampaign(model, campaign)) file.left.emplace_back(left);
  return file;
}

// Distances of the fibres from their places by the model, and what they would be by counts alone.
struct Misses {
  double worst_um = 0;
  double uncompensated_um = 0;
};

Misses MissesOf(const sim::CampaignModel& model, const Layout& layout, const Moves& moves,
                const std::vector<PointFp>& wanted) {
  const sim::Campaign all = moves.Campaign();
  const sim::Places places = Predict(model, sim::MakeFacts(all), sim::OneAfterTheOther());
  Misses misses;
  for (std::uint32_t n = 0; n < layout.size(); ++n) {
    const std::size_t row = all.first_row[n + 1] - 1;
    const double x_mm = places.x_mm[row] - wanted[n].x_mm;
    const double y_mm = places.y_mm[row] - wanted[n].y_mm;
    misses.worst_um = std::max(misses.worst_um, 1e3 * std::hypot(x_mm, y_mm));
    const PointFp plain = FibreAt(layout.units()[n], moves.Last(n));
    misses.uncompensated_um =
        std::max(misses.uncompensated_um,
                 1e3 * std::hypot(plain.x_mm - wanted[n].x_mm, plain.y_mm - wanted[n].y_mm));
  }
  return misses;
}

// The oracle is the model's own prediction of the whole campaign with all moves since. The
// compensation has neither the campaign's moves nor a track of facts.
TEST(Compensation, LeadsFibresToTheirTargetsHoweverManyMovesItWas) {
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const Layout layout = SmallLayout();
  const sim::CampaignModel model = GearsInService(layout, &rng);
  Moves moves(layout, &rng);
  for (int k = 0; k < 9; ++k) moves.GoAnywhere();
  Compensation compensation(FileOf(model, moves.Campaign()), layout);
  ASSERT_EQ(compensation.units(), layout.size());
  EXPECT_TRUE(compensation.left_out().empty());
  double worst_um = 0, uncompensated_um = 0;
  for (int k = 0; k < 45; ++k) {  // more than the compensation keeps
    std::vector<PointFp> wanted;
    for (std::uint32_t n = 0; n < layout.size(); ++n) {
      const Unit& unit = layout.units()[n];
      const AxisAngles aim{rng.Uniform(unit.theta().min_deg + 20, unit.theta().max_deg - 20),
                           rng.Uniform(unit.phi().min_deg + 30, unit.phi().max_deg - 30)};
      wanted.push_back(FibreAt(unit, aim));
      const bool runs_up = k % 2 == 1;
      const std::array<double, kAxisCount> last =
          runs_up ? std::array<double, kAxisCount>{-2, -2} : std::array<double, kAxisCount>{};
      const auto count = compensation.CountFor(
          {n}, {.fibre_fp = wanted[n], .now = moves.Last(n), .guess = aim, .last_deg = last});
      ASSERT_TRUE(count);
      const AxisAngles past{count->theta_deg + 2, count->phi_deg + 2};
      moves.Go(n, runs_up ? past : moves.Last(n));
      moves.Go(n, *count);
      if (runs_up) compensation.Rests({n}, past);
      compensation.Rests({n}, *count);
    }
    const Misses misses = MissesOf(model, layout, moves, wanted);
    worst_um = std::max(worst_um, misses.worst_um);
    uncompensated_um = std::max(uncompensated_um, misses.uncompensated_um);
  }
  EXPECT_LT(worst_um, 0.5);
  EXPECT_GT(uncompensated_um, 50);  // or there was nothing to compensate
}

// The planner works on places. The way between two places is that of the count, and the count leads
// to the target.
TEST(Compensation, OffsetsMakeTheWayBetweenPlacesThatOfTheCount) {
  Rng rng(6);
  const Layout layout = SmallLayout();
  Moves moves(layout, &rng);
  const UnitDrive drive;
  const Pose stood{9000, 20000}, before{40, -30};
  for (std::uint32_t n = 0; n < layout.size(); ++n)
    moves.Go(n, AnglesOf(layout.units()[n], drive, stood));
  const Compensation compensation(FileOf(GearsInService(layout, &rng), moves.Campaign()), layout);
  for (std::uint32_t n = 0; n < layout.size(); ++n) {
    const Unit& unit = layout.units()[n];
    const Pose target{6000 * static_cast<std::int32_t>(n) - 20000, 24000};
    const Compensation::Stand stand{.unit = &unit,
                                    .drive = &drive,
                                    .place = {stood[0] + before[0], stood[1] + before[1]},
                                    .offset = before};
    const auto offset = compensation.OffsetFor({n}, stand, target);
    ASSERT_TRUE(offset);
    const AxisAngles reported =
        AnglesOf(unit, drive, {target[0] - (*offset)[0], target[1] - (*offset)[1]});
    const auto fibre_fp = compensation.FibreAfter({n}, reported);
    ASSERT_TRUE(fibre_fp);
    const PointFp wanted = FibreAt(unit, drive, target);
    // A vector is 4 mdeg, so at most half a vector of each axis is left.
    EXPECT_NEAR(fibre_fp->x_mm, wanted.x_mm, 1e-3);
    EXPECT_NEAR(fibre_fp->y_mm, wanted.y_mm, 1e-3);
    EXPECT_GT(std::abs((*offset)[0]) + std::abs((*offset)[1]),
              10);  // or there was nothing to compensate
  }
}

TEST(Compensation, AnEmpiricalRippleIsCompensatedLikeThatOfAGear) {
  Rng rng(4);
  const Layout layout = SmallLayout();
  Moves moves(layout, &rng);
  moves.GoAnywhere();
  sim::CampaignModel model;
  model.units = Described(layout);
  model.terms = {TermOf("empirical_ripple", sim::EffectAxis::kTheta, sim::Memory::kHold,
                        layout.size(), 2, 5, 0.1, &rng)};
  const Compensation compensation(FileOf(model, moves.Campaign()), layout);
  EXPECT_TRUE(compensation.left_out().empty());
  std::vector<PointFp> wanted;
  for (std::uint32_t n = 0; n < layout.size(); ++n) {
    const AxisAngles aim{30.0 * n - 80, 90};
    wanted.push_back(FibreAt(layout.units()[n], aim));
    const auto count =
        compensation.CountFor({n}, {.fibre_fp = wanted[n], .now = moves.Last(n), .guess = aim});
    ASSERT_TRUE(count);
    EXPECT_NE(count->theta_deg, aim.theta_deg);
    moves.Go(n, *count);
  }
  const Misses misses = MissesOf(model, layout, moves, wanted);
  EXPECT_LT(misses.worst_um, 0.5);
  EXPECT_GT(misses.uncompensated_um, 5);  // or there was nothing to compensate
}

TEST(Compensation, KnowsNothingOfUnitsThatWereNotMeasuredOrWereHomed) {
  Rng rng(3);
  const Layout layout = SmallLayout();
  Moves moves(layout, &rng);
  moves.GoAnywhere();
  ModelFile file = FileOf(GearsInService(layout, &rng), moves.Campaign());
  file.left[2].reset();
  Compensation compensation(file, layout);
  EXPECT_EQ(compensation.units(), layout.size() - 1);
  const Compensation::Wish wish{
      .fibre_fp = FibreAt(layout.units()[3], {10, 90}), .now = moves.Last(3), .guess = {10, 90}};
  EXPECT_FALSE(compensation.CountFor({2}, wish));
  EXPECT_TRUE(compensation.CountFor({3}, wish));
  compensation.Forget({3});
  EXPECT_FALSE(compensation.CountFor({3}, wish));
  EXPECT_FALSE(compensation.FibreAfter({3}, {10, 90}));
}

TEST(Compensation, SaysWhatItLeavesOut) {
  Rng rng(3);
  const Layout layout = SmallLayout();
  Moves moves(layout, &rng);
  moves.GoAnywhere();
  sim::CampaignModel model;
  model.units = Described(layout);
  for (const char* cause : {"gravity_sag", "camera_similarity", "gravity_sag", "eccentricity"})
    model.terms.push_back(
        TermOf(cause, sim::EffectAxis::kTheta, sim::Memory::kHold, 7, 2, 0, 0, &rng));
  model.terms.push_back(
      TermOf("empirical_curve", sim::EffectAxis::kNone, sim::Memory::kHold, 7, 5, 1, 0, &rng));
  const Compensation compensation(FileOf(model, moves.Campaign()), layout);
  EXPECT_THAT(compensation.left_out(),
              ::testing::ElementsAre("gravity_sag", "camera_similarity", "empirical_curve"));
}

TEST(Compensation, DoesNotGoFarForATargetOutOfReach) {
  Rng rng(3);
  const Layout layout = SmallLayout();
  Moves moves(layout, &rng);
  moves.GoAnywhere();
  sim::CampaignModel model;
  model.units = Described(layout);
  const Compensation compensation(FileOf(model, moves.Campaign()), layout);
  const Unit& unit = layout.units()[0];
  const double reach_mm = unit.theta().arm_mm + unit.phi().arm_mm;
  const auto count = compensation.CountFor(
      {0}, {.fibre_fp = {unit.base_fp.x_mm + reach_mm + 0.05, unit.base_fp.y_mm},
            .now = moves.Last(0),
            .guess = {-unit.theta().zero_deg, 2 - unit.phi().zero_deg}});
  ASSERT_TRUE(count);
  const PointFp fibre = FibreAt(unit, *count);
  EXPECT_NEAR(fibre.x_mm, unit.base_fp.x_mm + reach_mm, 0.03);
  EXPECT_NEAR(fibre.y_mm, unit.base_fp.y_mm, 1);
}

TEST(ModelFile, RefusesWhatNoUnitOfThisFleetCanBe) {
  const Layout layout = SmallLayout();
  const std::vector<sim::CampaignUnit> units = Described(layout);
  const auto error_of = [&](const std::string& text) {
    const auto read = ReadModelFile(text, "m.toml", units);
    return read ? std::string() : read.error().text;
  };
  const auto unit_text = [&](const std::string& base_x, const std::string& arm) {
    return "[[unit]]\nunit_id = 1\nbase_x_mm = " + base_x +
           "\nbase_y_mm = " + std::to_string(units[0].base_y_mm) + "\narm_theta_mm = " + arm +
           "\narm_phi_mm = " + std::to_string(units[0].arm_mm[1]) +
           "\ntheta_zero_deg = 0\nphi_zero_deg = 0\n";
  };
  const std::string x = std::to_string(units[0].base_x_mm),
                    arm = std::to_string(units[0].arm_mm[0]);
  EXPECT_EQ(error_of(unit_text(x, arm)), "");
  EXPECT_EQ(error_of(unit_text("1e4", arm)),
            "m.toml:1: unit 1 has its base more than 10 mm from where it is described");
  EXPECT_THAT(error_of(unit_text(x, "999")), ::testing::HasSubstr("m.toml:1: unit 1 has an arm"));
  EXPECT_THAT(error_of(unit_text(x, arm) + "left_theta_deg = 3\n"),
              ::testing::HasSubstr("left_phi_deg is missing"));
  const std::string effect =
      "[[effect]]\ncause = \"gear_scale\"\naxis = \"theta\"\nform = 0\nshape = 0\nmemory = 2\n"
      "columns = 1\nunits = [1]\n";
  EXPECT_EQ(error_of(effect + "amplitude = [0.003]\nsigma = [1e-4]\n"), "");
  EXPECT_THAT(error_of(effect + "amplitude = [7]\n"),
              ::testing::HasSubstr("none that gear_scale can have"));
  EXPECT_THAT(error_of(effect + "amplitude = [0.003]\nsigma = []\n"),
              ::testing::HasSubstr("not one an amplitude"));
  for (const auto& [from, to] :
       {std::pair("form = 0", "form = 7"), std::pair("columns = 1", "columns = 2"),
        std::pair("\"theta\"", "\"both\"")}) {
    std::string other = effect + "amplitude = [0.003, 0.003]\n";
    other.replace(other.find(from), std::string(from).size(), to);
    EXPECT_THAT(error_of(other), ::testing::HasSubstr("no such axis, form, memory and columns"))
        << to;
  }
  // Every model that a diagnosis of a small or a large fleet can write is read.
  for (const std::size_t fleet : {3u, 19u, 61u}) {
    const sim::Campaign campaign = sim::PlantCampaign({.units = fleet, .moves = 30}).value();
    const sim::CampaignFacts facts = sim::MakeFacts(campaign);
    for (const sim::Effect& one : sim::EffectLibrary())
      for (const sim::Template& form : sim::ListTemplates(one, facts)) {
        const auto [low, high] = sim::RangeOfAmplitude(one);
        const double size = std::clamp(one.prior_size, low, high);
        std::string text = fmt::format(
            "[[effect]]\ncause = \"{}\"\naxis = \"{}\"\nform = {}\nshape = {}\nmemory = {}\n"
            "columns = {}\nunits = [1]\namplitude = [{}",
            one.cause, sim::Name(form.axis), form.form, form.shape, static_cast<int>(form.memory),
            form.columns, size);
        for (std::size_t c = 1; c < form.columns; ++c) text += fmt::format(", {}", size);
        EXPECT_EQ(error_of(text + "]\n"), "") << text;
      }
  }
  EXPECT_THAT(error_of("[[effect"), ::testing::HasSubstr("m.toml:1"));
}

}  // namespace
}  // namespace focalfleet
