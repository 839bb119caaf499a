// Campaigns out of a store: which there are, and which rows they have.
#include "daemon/campaign/recorded_campaign.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "daemon/store/store.h"
#include "fleet/drive.h"
#include "tests/daemon/verbs/small_fleet.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

constexpr WallTime kNoon{1'900'065'600'000'000'000};  // 12:00 UTC
constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int32_t kStep = 100;  // vectors of theta in each configuration

class Recorded : public ::testing::Test {
 protected:
  /// The configuration moves units 1 to 3 from (id - 1) to id steps, and ends `after_s` after noon.
  void Move(std::uint64_t id, const std::string& source, std::int64_t after_s,
            IntentEnd end_of_unit_2 = IntentEnd::kArrived) {
    ConfigurationRow row;
    row.id = id;
    row.source = source;
    std::vector<Row> rows{row};
    const auto from = static_cast<std::int32_t>(id - 1) * kStep;
    for (std::uint32_t unit = 1; unit <= 3; ++unit) {
      IntentRow intent;
      intent.configuration = id;
      intent.unit = {unit};
      intent.serial = {7000 + unit};
      intent.move = {static_cast<std::uint16_t>(id)};
      intent.from = {from, 0};
      intent.to = {from + kStep, 0};
      intent.hull = {AxisKnowledge{Witness::kInterval, from, from + kStep},
                     AxisKnowledge{Witness::kInterval, 0, 0}};
      rows.emplace_back(intent);
    }
    Commit(rows, after_s - 30);
    rows.clear();
    for (std::uint32_t unit = 1; unit <= 3; ++unit) {
      rows.emplace_back(VectorRow{{7000 + unit},
                                  Exactly(Witness::kReported, Pose{from + kStep, 0}),
                                  {},
                                  {96, 96},
                                  {static_cast<std::uint16_t>(id)},
                                  Origin::kMove});
      rows.emplace_back(IntentEndRow{{7000 + unit},
                                     {static_cast<std::uint16_t>(id)},
                                     unit == 2 ? end_of_unit_2 : IntentEnd::kArrived});
    }
    row.state = ConfigurationState::kDone;
    rows.emplace_back(row);
    Commit(rows, after_s);
  }
  /// All units are seen, unit 3 without certainty.
  void Measure(std::uint64_t configuration, std::uint64_t exposure, std::int64_t after_s) {
    std::vector<Row> rows;
    for (std::uint32_t unit = 1; unit <= 3; ++unit) {
      MeasurementRow row;
      row.exposure = exposure;
      row.configuration = configuration;
      row.serial = {7000 + unit};
      row.unit = {unit};
      row.status = unit == 3 ? MeasurementStatus::kMissing : MeasurementStatus::kMeasured;
      row.x_mm = 10.0 * unit + static_cast<double>(exposure);
      row.covariance = {4e-6, 0, 4e-6};
      rows.emplace_back(row);
    }
    Commit(rows, after_s);
  }
  Result<sim::Campaign> Take(std::uint64_t first, std::uint64_t last, std::size_t rows_max = 1000) {
    RecordedList list;
    list.name = "taken";
    list.first = first;
    list.last = last;
    return RecordedCampaign(Reader().get(), fleet_.layout(), list, rows_max);
  }
  std::unique_ptr<StoreReader> Reader() { return StoreReader::Open(scratch_ / "a.db").value(); }

 private:
  void Commit(const std::vector<Row>& rows, std::int64_t after_s) {
    const Status done = store_->Commit(rows, {kNoon.ns + after_s * kSecondNs});
    ASSERT_TRUE(done) << done.error().text;
  }

  test::ScratchFolder scratch_;
  std::unique_ptr<Store> store_ = Store::Open(scratch_ / "a.db").value();
  test::SmallFleet fleet_{3};
};

TEST_F(Recorded, ListsAreTheMovesOfAListAndTheNights) {
  Move(1, "one.csv move 7", -100);
  Move(2, "one.csv move 8", 100);  // beyond noon: another night
  Move(3, "targets.csv", 200);
  Move(4, "one.csv move 9", 300);  // the list was begun again
  Move(5, "night move x", 400);
  const auto lists = RecordedLists(Reader().get(), 100);
  ASSERT_TRUE(lists);
  ASSERT_EQ(lists->size(), 4u);
  EXPECT_EQ((*lists)[0].name, "one.csv");
  EXPECT_EQ((*lists)[0].first, 4u);
  EXPECT_EQ((*lists)[1].first, 1u);
  EXPECT_EQ((*lists)[1].last, 2u);
  EXPECT_EQ((*lists)[1].configurations, 2u);
  EXPECT_TRUE((*lists)[2].is_night);
  EXPECT_EQ((*lists)[2].first, 2u);
  EXPECT_EQ((*lists)[2].last, 5u);
  EXPECT_EQ((*lists)[3].last, 1u);
}

TEST_F(Recorded, ARowIsAUnitInTheLastExposureOfAConfiguration) {
  Move(1, "a", 100);
  Measure(1, 1, 130);
  Measure(1, 2, 140);
  Move(2, "b", 200);
  Measure(2, 3, 230);
  const auto campaign = Take(1, 2);
  ASSERT_TRUE(campaign) << campaign.error().text;
  ASSERT_TRUE(sim::Validate(*campaign));
  ASSERT_EQ(campaign->rows(), 6u);
  const double step_deg = AngleDeg(kStep, {7.4, 0, 890, -190, 190}, {});
  EXPECT_EQ(campaign->move_id[0], 1);
  EXPECT_EQ(campaign->x_mm[0], 12) << "the second exposure";
  EXPECT_NEAR(campaign->from_deg[0][1], step_deg, 1e-9);
  EXPECT_NEAR(campaign->cmd_deg[0][1], 2 * step_deg, 1e-9);
  EXPECT_EQ(campaign->units[0].serial, 7001u);
  EXPECT_TRUE(std::isnan(campaign->x_mm[5])) << "unit 3 was not found";
  EXPECT_NEAR(campaign->Find("t_s")[1], 90, 1e-6);
  EXPECT_NEAR(campaign->Find("sigma_um")[0], 2, 1e-9);
}

TEST_F(Recorded, AUnitWhoseMoveDidNotArriveHasNoRowUntilItArrives) {
  Move(1, "a", 100);
  Measure(1, 1, 130);
  Move(2, "b", 200, IntentEnd::kStopped);
  Measure(2, 2, 230);
  Move(3, "c", 300);
  Measure(3, 3, 330);
  const auto campaign = Take(1, 3);
  ASSERT_TRUE(campaign);
  const std::vector<std::int64_t> of_unit_2(
      campaign->move_id.begin() + static_cast<std::ptrdiff_t>(campaign->first_row[1]),
      campaign->move_id.begin() + static_cast<std::ptrdiff_t>(campaign->first_row[2]));
  EXPECT_EQ(of_unit_2, (std::vector<std::int64_t>{1, 3}));
}

TEST_F(Recorded, ConfigurationsThatWereNotMeasuredMoveUnitsToo) {
  Move(1, "a", 100);
  Measure(1, 1, 130);
  Move(2, "b", 200);
  Move(3, "c", 300);
  Measure(3, 2, 330);
  const auto campaign = Take(1, 3);
  ASSERT_TRUE(campaign);
  const double step_deg = AngleDeg(kStep, {7.4, 0, 890, -190, 190}, {});
  EXPECT_NEAR(campaign->from_deg[0][1], 2 * step_deg, 1e-9) << "of the last move";
}

TEST_F(Recorded, TheNewestExposuresFit) {
  for (std::uint64_t id = 1; id <= 5; ++id) {
    Move(id, "a", static_cast<std::int64_t>(100 * id));
    Measure(id, id, static_cast<std::int64_t>(100 * id + 30));
  }
  const auto campaign = Take(1, 5, 6);
  ASSERT_TRUE(campaign);
  EXPECT_EQ(campaign->rows(), 6u);
  EXPECT_EQ(*std::ranges::min_element(campaign->move_id), 4);
}

TEST_F(Recorded, WithoutAnExposureThereIsNothingToDiagnose) {
  Move(1, "a", 100);
  const auto campaign = Take(1, 1);
  ASSERT_FALSE(campaign);
  EXPECT_EQ(campaign.error().code, ErrorCode::kRefused);
  EXPECT_FALSE(Take(7, 9));
}

}  // namespace
}  // namespace focalfleet
