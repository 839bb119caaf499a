// Pages of events, one after the other, as a follower asks for them.
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "daemon/store/store.h"
#include "daemon/verbs/history_requests.h"
#include "tests/daemon/verbs/small_fleet.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ScratchFolder;
using test::SmallFleet;

class EventPages : public ::testing::Test {
 protected:
  /// Stores `count` alarms at an instant, and a configuration that ends with them.
  void Happen(std::uint32_t count, WallTime at) {
    std::vector<Row> rows;
    for (std::uint32_t n = 0; n < count; ++n) {
      ++alarm_;
      rows.emplace_back(AlarmRow{alarm_,
                                 alarm_ % 2 == 0 ? Severity::kError : Severity::kInfo,
                                 UnitId{1},
                                 {},
                                 "a" + std::to_string(alarm_),
                                 AlarmName::kUnitHeldBack});
    }
    rows.emplace_back(EnableRow{UnitId{1}, false, "e" + std::to_string(alarm_)});
    ConfigurationRow configuration;
    configuration.id = ++configuration_;
    configuration.source = "t.csv";
    rows.emplace_back(configuration);
    configuration.state = ConfigurationState::kDone;
    rows.emplace_back(configuration);
    const Status done = store_->Commit(rows, at);
    ASSERT_TRUE(done) << done.error().text;
  }
  Json Ask(const Json& args) {
    const auto reading = AskEvents({.id = 1, .verb = "events", .args = args}, fleet_.View());
    EXPECT_TRUE(reading) << reading.error().text;
    if (!reading) return {};
    const auto reader = StoreReader::Open(scratch_ / "s.db");
    EXPECT_TRUE(reader) << reader.error().text;
    const auto answer = (*reading)(reader->get());
    EXPECT_TRUE(answer) << answer.error().text;
    return answer.value_or(Json{});
  }
  /// Goes on after `next` until there is no more; how often each text was shown.
  std::map<std::string, int> Follow(Json next, Json filter = Json::object()) {
    std::map<std::string, int> shown;
    for (int page = 0; page < 100; ++page) {
      filter["after"] = next;
      const Json answer = Ask(filter);
      for (const Json& event : answer["events"]) ++shown[event["text"].get<std::string>()];
      next = answer["next"];
      if (!answer["more"].get<bool>()) break;
    }
    EXPECT_TRUE(Ask({{"after", next}})["events"].empty()) << "all of it was shown";
    return shown;
  }

  const ScratchFolder scratch_;
  SmallFleet fleet_;
  std::unique_ptr<Store> store_ = Store::Open(scratch_ / "s.db").value();
  std::uint64_t alarm_ = 0;
  std::uint64_t configuration_ = 0;
};

constexpr WallTime kSoon{2'000'000'000'000'000'000};
constexpr WallTime kEarlier{1'900'000'000'000'000'000};  // a clock that was set back

TEST_F(EventPages, ShowEveryEventOnceHoweverManyCome) {
  Happen(150, kSoon);
  const Json first = Ask({{"limit", 100}});
  EXPECT_EQ(first["events"].size(), 100u) << "the newest";
  Happen(2500, kSoon);
  Happen(700, kEarlier);
  const auto shown = Follow(first["next"]);
  EXPECT_EQ(shown.size(), 2500u + 700 + 2 + 4) << "alarms, units, beginnings and ends";
  for (const auto& [text, times] : shown) EXPECT_EQ(times, 1) << text;
  EXPECT_FALSE(shown.contains("a150"));
  EXPECT_TRUE(shown.contains("a151") && shown.contains("a3350"));
}

TEST_F(EventPages, AFilterHidesNothingElse) {
  const Json first = Ask(Json::object());
  Happen(2500, kSoon);
  const auto errors = Follow(first["next"], {{"severity", "error"}});
  EXPECT_EQ(errors.size(), 1250u);
  const auto others = Follow(first["next"], {{"unit_ids", {2}}});
  EXPECT_TRUE(others.empty());
}

TEST_F(EventPages, AfterNeedsAllItsNumbers) {
  for (const Json& bad :
       {Json(7), Json{{"alarm", 1}}, Json{{"alarm", -1}, {"unit", 0}, {"begun", 0}, {"ended", 0}},
        Json{{"alarm", 1ull << 63}, {"unit", 0}, {"begun", 0}, {"ended", 0}}})
    EXPECT_FALSE(AskEvents({.id = 1, .verb = "events", .args = {{"after", bad}}}, fleet_.View()))
        << bad;
}

}  // namespace
}  // namespace focalfleet
