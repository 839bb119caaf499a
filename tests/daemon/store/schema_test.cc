#include "daemon/store/schema.h"

#include <gmock/gmock.h>

#include "tests/daemon/store/faulty_disk.h"
#include "tests/daemon/store/store_fixture.h"

namespace focalfleet::store_internal {
namespace {

using focalfleet::test::StoreTest;

std::unique_ptr<Connection> Open(const std::string& path, const char* vfs = nullptr) {
  auto connection = Connection::Open(path, Connection::Mode::kWrite, vfs, 0);
  EXPECT_TRUE(connection);
  return std::move(*connection);
}

TEST_F(StoreTest, MigrationsCarryAStoreOverStepByStep) {
  const char* const steps[] = {
      "CREATE TABLE place(id INTEGER PRIMARY KEY, deg REAL) STRICT; INSERT INTO place VALUES(1, 2)",
      "ALTER TABLE place ADD COLUMN turns INTEGER NOT NULL DEFAULT 7",
      "UPDATE place SET turns = turns + 1"};
  auto connection = Open(Path());
  for (std::size_t known = 1; known <= 3; ++known) {  // three releases, one after the other
    const auto version = static_cast<std::int32_t>(known) - 1;
    ASSERT_EQ(connection->Integer("PRAGMA user_version"), version);
    ASSERT_TRUE(Migrate(*connection, version, std::span(steps).first(known)));
  }
  EXPECT_EQ(connection->Integer("PRAGMA user_version"), 3);
  EXPECT_EQ(connection->Integer("SELECT turns FROM place"), 8);
  auto all_at_once = Open(folder_ / "second.db");
  ASSERT_TRUE(Migrate(*all_at_once, 0, steps));
  EXPECT_EQ(all_at_once->Integer("SELECT turns FROM place"), 8);
}

TEST_F(StoreTest, AFailedStepLeavesTheVersionBeforeIt) {
  const char* const steps[] = {"CREATE TABLE a(x)", "CREATE TABLE b(x); CREATE TABLE a(x)"};
  auto connection = Open(Path());
  const Status done = Migrate(*connection, 0, steps);
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error().text, ::testing::HasSubstr("version 2"));
  EXPECT_EQ(connection->Integer("PRAGMA user_version"), 1);
  EXPECT_EQ(connection->Integer("SELECT count(*) FROM sqlite_schema"), 1);
}

TEST_F(StoreTest, AStoreOfVersionOneKeepsWhatItHasAndTakesTunings) {
  {
    auto connection = Open(Path());
    ASSERT_TRUE(Migrate(*connection, 0, Migrations().first(1)));
    ASSERT_TRUE(
        connection->Execute("INSERT INTO unit VALUES(12, 7001, 1, '', 5); "
                            "INSERT INTO parameter VALUES(7001, 1, 1, 37, 1, 5); "
                            "INSERT INTO parameter_history VALUES(1, 7001, 1, 1, 37, 1, 5)"));
    EXPECT_EQ(connection->Integer("PRAGMA user_version"), 1);
  }
  const TuningRow row{.serial = {7001},
                      .axis = Axis::kPhi,
                      .critical = 37,
                      .repeat = 54,
                      .margin = 0.5,
                      .load_uNm = 4.07,
                      .v_bus_V = 1.8,
                      .counter1 = 500,
                      .subdivision = 96};
  {
    auto store = OpenStore();
    const auto fleet = store->Load();
    ASSERT_TRUE(fleet) << fleet.error().text;
    ASSERT_EQ(fleet->units.size(), 1u);
    EXPECT_EQ(fleet->units[0].serial.value, 7001u);
    ASSERT_EQ(fleet->parameters.size(), 1u);
    EXPECT_EQ(fleet->parameters[0].value, 37);
    EXPECT_TRUE(fleet->tunings.empty());
    test::ExpectDone(store->Commit(std::vector<Row>{row}, {6}));
    EXPECT_EQ(store->Load()->tunings.size(), 1u);
  }
  EXPECT_EQ(OpenReader()->Parameters({7001}, 9)->size(), 1u);
  auto connection = Open(Path());
  EXPECT_EQ(connection->Integer("PRAGMA user_version"),
            static_cast<std::int64_t>(Migrations().size()));
  EXPECT_EQ(connection->Integer("SELECT critical FROM tuned WHERE unit_id = 12 AND axis = 'phi' "
                                "AND origin = 'tuning' AND mode = 'asymmetric'"),
            37);
}

TEST_F(StoreTest, AStoreOfVersionFourGetsRoundCovariancesOfItsMeasurements) {
  {
    auto connection = Open(Path());
    ASSERT_TRUE(Migrate(*connection, 0, Migrations().first(4)));
    ASSERT_TRUE(connection->Execute(
        "INSERT INTO measurement VALUES(7, 12, 7001, 3, 0, NULL, 1.5, 2.5, 4, 5, 6, 1, 2, 9, 5)"));
  }
  {
    auto store = OpenStore();
    ASSERT_TRUE(store->Load());
  }
  const auto read = OpenReader()->Measurements(7);
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_EQ(read->size(), 1u);
  const MeasurementRow& row = read->front().row;
  EXPECT_NEAR(row.covariance.xx, 16e-6, 1e-18);
  EXPECT_EQ(row.covariance.xy, 0);
  EXPECT_NEAR(SigmaUm(row.covariance), 4, 1e-12);
  EXPECT_EQ(row.x_mm, 1.5);
  EXPECT_EQ(row.target_id, "");
  EXPECT_FALSE(row.delay_s);
}

TEST_F(StoreTest, AlarmsOfVersionEightHaveNoNameAndNoneIsOpen) {
  {
    auto connection = Open(Path());
    ASSERT_TRUE(Migrate(*connection, 0, Migrations().first(8)));
    ASSERT_TRUE(connection->Execute("INSERT INTO alarm VALUES(7, 2, 12, NULL, 'old', 5)"));
  }
  const auto fleet = OpenStore()->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  EXPECT_TRUE(fleet->open_alarms.empty());
  EXPECT_TRUE(fleet->mutes.empty());
  const auto alarms = OpenReader()->Alarms(9);
  ASSERT_TRUE(alarms) << alarms.error().text;
  ASSERT_EQ(alarms->size(), 1u);
  EXPECT_EQ(alarms->front().row.text, "old");
  EXPECT_STREQ(Name(alarms->front().row.name), "unnamed");
}

TEST_F(StoreTest, AStoreOfVersionElevenKnowsWhoseCountBeganAnewSinceEachModel) {
  {
    auto connection = Open(Path());
    ASSERT_TRUE(Migrate(*connection, 0, Migrations().first(11)));
    ASSERT_TRUE(connection->Execute(
        "INSERT INTO unit(unit_id, serial, enabled, reason, at_ns) VALUES(1, 11, 1, '', 1), "
        "(2, 12, 1, '', 1), (3, 13, 1, '', 1), (4, 24, 1, '', 60), (5, 15, 1, '', 1); "
        "INSERT INTO unit_history VALUES(1, 4, 14, 1, '', 1), (2, 4, 24, 1, '', 60); "
        "INSERT INTO model_change(entry, name, campaign, campaign_sha256, at_ns) "
        "VALUES(1, '', '', '', 20), (2, '', '', '', 50); "
        "INSERT INTO axis_history VALUES(1, 13, 0, 3, 1, 1, 96, 3, 60), "
        "(2, 15, 0, 3, 1, 1, 96, 5, 60); "
        "INSERT INTO intent(configuration, unit_id, serial, move, theta_from, phi_from, theta_to, "
        "phi_to, theta_low, theta_high, phi_low, phi_high, began_ns, ended_ns, end) VALUES"
        "(1, 1, 11, 1, 0, 0, 0, 0, 0, 0, 0, 0, 9, 10, 5), "
        "(1, 2, 12, 1, 0, 0, 0, 0, 0, 0, 0, 0, 29, 30, 5)"));
  }
  OpenStore();
  const auto units = [&](std::uint64_t change) { return OpenReader()->CountedAnewSince(change); };
  EXPECT_EQ(units(1), (std::vector<UnitId>{{2}, {3}, {4}}));
  EXPECT_EQ(units(2), (std::vector<UnitId>{{3}, {4}}));
}

TEST_F(StoreTest, OpeningANewStoreSurvivesEveryFailingWrite) {
  focalfleet::test::FaultyDisk disk;
  std::uint64_t n = 1;
  for (;; ++n) {
    ASSERT_LT(n, 1000u);
    const std::string path = folder_ / ("n" + std::to_string(n) + ".db");
    disk.FailAt(n, SQLITE_IOERR_WRITE, false);
    const auto store = Store::Open(path, {.vfs = disk.kVfsName});
    const bool failed = disk.has_failed();
    disk.Heal();
    if (!failed) break;
    if (!store) {
      EXPECT_EQ(store.error().code, ErrorCode::kUnavailable) << store.error().text;
      const auto again = Store::Open(path);
      ASSERT_TRUE(again) << again.error().text;
      EXPECT_TRUE((*again)->Load());
    }
  }
  EXPECT_GT(n, 10u);  // or nothing was tried
}

}  // namespace
}  // namespace focalfleet::store_internal
