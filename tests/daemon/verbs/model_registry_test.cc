#include "daemon/verbs/model_registry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "daemon/access/sha256.h"
#include "fleet/hex_layout.h"
#include "tests/daemon/verbs/model_text.h"

namespace focalfleet {
namespace {

using test::ModelText;
using ::testing::HasSubstr;

class ModelRegistryTest : public ::testing::Test {
 protected:
  ModelRegistryTest() : layout_(*Layout::Create(MakeHexLayout({.count = 3}), {})) {}

  [[nodiscard]] std::string Text(const std::string& name) const { return ModelText(layout_, name); }
  ModelRow Load(ModelRegistry* registry, const std::string& name) {
    const auto row = registry->Load(Text(name), name + ".toml");
    EXPECT_TRUE(row) << row.error().text;
    if (row) stored_[row->sha256] = *row->text;
    return row ? *row : ModelRow{};
  }
  Result<ModelRow> Rollback(ModelRegistry* registry) {
    return registry->Rollback([this](const std::string& sha256) -> Result<std::string> {
      if (stored_.contains(sha256)) return stored_[sha256];
      return Fail(ErrorCode::kUnavailable, "the store has it not");
    });
  }

  Layout layout_;
  std::map<std::string, std::string> stored_;
};

TEST_F(ModelRegistryTest, ALoadedModelIsInForceAndNamesItsOrigin) {
  ModelRegistry registry(&layout_);
  EXPECT_EQ(registry.compensation(), nullptr);
  const ModelRow row = Load(&registry, "one");
  EXPECT_EQ(row.entry, 1u);
  EXPECT_EQ(row.sha256, Sha256Hex(Text("one")));
  EXPECT_EQ(row.campaign, "night");
  EXPECT_EQ(row.rms_after_um, 9);
  ASSERT_NE(registry.compensation(), nullptr);
  EXPECT_EQ(registry.compensation()->units(), 3u);
  const Json shown = registry.Show(10);
  EXPECT_EQ(shown["in_force"]["name"], "one");
  EXPECT_EQ(shown["in_force"]["units"], 3);
  EXPECT_EQ(shown["changes"].size(), 1u);
}

TEST_F(ModelRegistryTest, ABadFileChangesNothing) {
  ModelRegistry registry(&layout_);
  Load(&registry, "one");
  const Json before = registry.Show(10);
  const std::string good = Text("two");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    const auto row = registry.Load(text, "bad.toml");
    return row ? std::string() : row.error().text;
  };
  EXPECT_THAT(with("arm_phi_mm = ", "arm_phi_mm = -"), HasSubstr("bad.toml:"));
  EXPECT_THAT(with("[[unit]]", "[[unit"), HasSubstr("bad.toml:"));
  EXPECT_THAT(with("explained", "insufficient"), HasSubstr("insufficient"));
  for (const char* const id : {"1e300", "-1", "0.5", "4294967296"})
    EXPECT_THAT(with("unit_id = 1", std::string("unit_id = ") + id), HasSubstr("a unit's number"));
  EXPECT_FALSE(registry.Load("", "empty.toml"));
  EXPECT_FALSE(registry.Load(Text("one"), "again.toml"));
  EXPECT_EQ(registry.Show(10), before);
}

TEST_F(ModelRegistryTest, GoesBackStepByStepAndForwardAgainByLoading) {
  ModelRegistry registry(&layout_);
  EXPECT_FALSE(Rollback(&registry));
  Load(&registry, "one");
  Load(&registry, "two");
  Load(&registry, "three");
  ASSERT_TRUE(Rollback(&registry));
  EXPECT_EQ(registry.name(), "two");
  ASSERT_TRUE(Rollback(&registry));
  EXPECT_EQ(registry.name(), "one");
  ASSERT_TRUE(Rollback(&registry));
  EXPECT_EQ(registry.compensation(), nullptr);
  ASSERT_TRUE(Rollback(&registry));  // the last change took a model away
  EXPECT_EQ(registry.name(), "one");
  stored_.clear();
  Load(&registry, "four");
  const auto failed = Rollback(&registry);  // the store has lost it
  ASSERT_FALSE(failed);
  EXPECT_EQ(registry.name(), "four");
  const auto unloaded = registry.Unload();
  ASSERT_TRUE(unloaded);
  EXPECT_EQ(unloaded->sha256, "");
  EXPECT_FALSE(registry.Unload());
  EXPECT_EQ(registry.compensation(), nullptr);
}

TEST_F(ModelRegistryTest, ARestartRestoresTheModelInForce) {
  ModelRegistry registry(&layout_);
  std::vector<ModelHistory> newest_first;
  for (const char* name : {"one", "two"})
    newest_first.insert(newest_first.begin(), ModelHistory{Load(&registry, name), {5}});
  ModelRegistry after(&layout_);
  after.TakeChanges(newest_first);
  ASSERT_TRUE(after.Restore(Text("two")));
  EXPECT_EQ(after.name(), "two");
  EXPECT_EQ(after.since(), 2u);
  ASSERT_TRUE(Rollback(&after));
  EXPECT_EQ(after.name(), "one");
  EXPECT_EQ(after.since(), 1u) << "the change that put it in force first";
  // The model does not belong to this layout: none is in force, and the past is known.
  const auto other = Layout::Create(MakeHexLayout({.count = 3, .pitch_mm = 60}), {});
  ASSERT_TRUE(other);
  ModelRegistry elsewhere(&*other);
  elsewhere.TakeChanges(newest_first);
  EXPECT_FALSE(elsewhere.Restore(Text("two")));
  EXPECT_EQ(elsewhere.compensation(), nullptr);
  EXPECT_EQ(elsewhere.Show(10)["changes"].size(), 2u);
}

TEST_F(ModelRegistryTest, AChangeIsNumberedAfterAllThatTheStoreHas) {
  // The same where the text of the newest model cannot be read: no number is given twice.
  ModelRegistry after(&layout_);
  after.TakeChanges({ModelHistory{{.entry = 7, .sha256 = "lost", .name = "two"}, {5}},
                     ModelHistory{{.entry = 6, .sha256 = "older", .name = "one"}, {4}}});
  EXPECT_EQ(after.compensation(), nullptr);
  const auto loaded = after.Load(Text("three"), "three.toml");
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_EQ(loaded->entry, 8u);
}

}  // namespace
}  // namespace focalfleet
