#include "daemon/verbs/model_upkeep.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "daemon/store/store.h"
#include "fleet/hex_layout.h"
#include "tests/daemon/verbs/model_text.h"
#include "tests/daemon/verbs/small_fleet.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ModelText;
using test::SmallFleet;

class ModelUpkeepTest : public ::testing::Test {
 protected:
  ModelUpkeepTest() : store_(Store::Open(scratch_ / "fleet.db").value()) {}

  /// The store has one model, loaded at this time.
  void StoreModel(WallTime at) {
    ModelRegistry registry(&fleet_.layout());
    const auto row = registry.Load(ModelText(fleet_.layout(), "night"), "night.toml");
    ASSERT_TRUE(row) << row.error().text;
    ASSERT_TRUE(store_->Commit(std::vector<Row>{*row}, at));
  }
  std::unique_ptr<StoreReader> Reader() { return StoreReader::Open(scratch_ / "fleet.db").value(); }

  const test::ScratchFolder scratch_;
  SmallFleet fleet_;
  std::unique_ptr<Store> store_;
  ModelRegistry models_{&fleet_.layout()};
};

TEST_F(ModelUpkeepTest, WithoutAModelInTheStoreNoneIsInForce) {
  ASSERT_TRUE(RestoreModel(Reader().get(), &models_));
  EXPECT_EQ(models_.compensation(), nullptr);
  EXPECT_TRUE(models_.changes_known());
}

TEST_F(ModelUpkeepTest, TheLastModelIsRestoredForUnitsWhoseCountDidNotBeginAnew) {
  StoreModel({5});
  ASSERT_TRUE(store_->Commit(std::vector<Row>{BindingRow{{2}, {7002}}}, {4}));
  VectorRow set{{7002},           Exactly(Witness::kReported, Pose{1, 1}), {}, {96, 96}, {1},
                Origin::kOperator};
  ASSERT_TRUE(store_->Commit(std::vector<Row>{set}, {6}));
  const Status restored = RestoreModel(Reader().get(), &models_);
  ASSERT_TRUE(restored) << restored.error().text;
  ASSERT_NE(models_.compensation(), nullptr);
  EXPECT_TRUE(models_.compensation()->Knows({0}));
  EXPECT_FALSE(models_.compensation()->Knows({1})) << "its count was set after the model came";
  EXPECT_TRUE(models_.compensation()->Knows({2}));
}

TEST_F(ModelUpkeepTest, AClockThatStepsBackLeavesNoModelForAUnitThatWasHomedSince) {
  constexpr WallTime kTwelve{12 * 3'600'000'000'000};
  constexpr WallTime kFivePastEleven{11 * 3'600'000'000'000 + 300'000'000'000};
  ASSERT_TRUE(store_->Commit(
      std::vector<Row>{BindingRow{{1}, {7001}}, BindingRow{{2}, {7002}}, BindingRow{{3}, {7003}}},
      {4}));
  StoreModel(kTwelve);
  IntentRow way{.configuration = 1, .serial = {7001}, .unit = {1}, .move = {3}};
  for (AxisKnowledge& axis : way.hull) axis = {Witness::kInterval, 0, 0};
  ASSERT_TRUE(store_->Commit(
      std::vector<Row>{way, IntentEndRow{{7001}, {3}, IntentEnd::kHomed}, BindingRow{{3}, {7999}}},
      kFivePastEleven));
  const Status restored = RestoreModel(Reader().get(), &models_);
  ASSERT_TRUE(restored) << restored.error().text;
  EXPECT_FALSE(models_.compensation()->Knows({0})) << "it was homed after the model came";
  EXPECT_TRUE(models_.compensation()->Knows({1}));
  EXPECT_FALSE(models_.compensation()->Knows({2})) << "other hardware was adopted";
}

TEST_F(ModelUpkeepTest, AModelOfAnotherFleetIsNotRestored) {
  StoreModel({5});
  const auto other = Layout::Create(MakeHexLayout({.count = 3, .pitch_mm = 60}), {});
  ASSERT_TRUE(other);
  ModelRegistry models(&*other);
  EXPECT_FALSE(RestoreModel(Reader().get(), &models));
  EXPECT_EQ(models.compensation(), nullptr);
}

TEST_F(ModelUpkeepTest, AUnitWhoseHardwareWasReplacedGoesWithoutTheModel) {
  ASSERT_TRUE(models_.Load(ModelText(fleet_.layout(), "night"), "night.toml"));
  Effects effects;
  effects.rows = {BindingRow{{3}, {7003}}, BindingRow{{1}, {7001}, {6001}}};
  NoteEffects(fleet_.View(), effects, models_.compensation());
  EXPECT_FALSE(models_.compensation()->Knows({0}));
  EXPECT_TRUE(models_.compensation()->Knows({2})) << "it was bound for the first time";
  NoteEffects(fleet_.View(), effects, nullptr);
}

}  // namespace
}  // namespace focalfleet
