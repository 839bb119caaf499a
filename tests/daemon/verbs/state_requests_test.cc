#include "daemon/verbs/state_requests.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/daemon/verbs/small_fleet.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

// Clients whose answers are kept.
class Clients final : public LineExchange {
 public:
  [[nodiscard]] int fd() const override { return -1; }
  void Service(std::vector<IncomingLine>* /*urgent*/) override {}
  std::optional<IncomingLine> Next() override { return std::nullopt; }
  [[nodiscard]] bool connected(ClientId client) const override { return !gone.contains(client); }
  bool Answer(ClientId client, std::string_view line) override {
    answers[client] += line;
    return connected(client);
  }
  bool Progress(ClientId /*client*/, std::string_view /*line*/) override { return true; }

  std::set<ClientId> gone;
  std::map<ClientId, std::string> answers;
};

class StateRequestsTest : public ::testing::Test {
 protected:
  void Serve() {
    states_.Serve(fleet_.View(), [this](StateRows* rows) {
      if (has_room_) taken_.push_back(*rows);
      return has_room_;
    });
  }
  const test::SmallFleet fleet_;
  Clients clients_;
  StateRequests states_{&clients_};
  bool has_room_ = true;
  std::vector<StateRows> taken_;
};

TEST_F(StateRequestsTest, AllWhoAskedShareTheRowsAndOneIsAnsweredATurn) {
  EXPECT_FALSE(states_.due());
  for (ClientId client = 1; client <= 40; ++client) EXPECT_TRUE(states_.Add(client, 7));
  EXPECT_TRUE(states_.due());
  Serve();
  Serve();
  ASSERT_EQ(taken_.size(), 1u);
  EXPECT_EQ(taken_[0]->size(), fleet_.layout().size());
  EXPECT_TRUE(clients_.answers.empty());
  EXPECT_FALSE(states_.due()) << "the other thread wakes the core";
  states_.Written(StateText(*taken_[0]));
  for (std::size_t turn = 1; turn <= 40; ++turn) {
    EXPECT_TRUE(states_.due());
    Serve();
    ASSERT_EQ(clients_.answers.size(), turn);
    EXPECT_THAT(clients_.answers[turn], HasSubstr(R"({"id":7,"ok":true,"result":{"rows":[{)"));
  }
  EXPECT_FALSE(states_.due());
  EXPECT_EQ(taken_.size(), 1u);
}

TEST_F(StateRequestsTest, RowsAreNeverOlderThanTheQuestion) {
  ASSERT_TRUE(states_.Add(1, 1));
  Serve();
  ASSERT_TRUE(states_.Add(2, 1));
  states_.Written("\"before\"");
  Serve();
  EXPECT_THAT(clients_.answers[1], HasSubstr(R"("result":"before")"));
  EXPECT_FALSE(clients_.answers.contains(2));
  ASSERT_EQ(taken_.size(), 2u);
  states_.Written("\"after\"");
  Serve();
  EXPECT_THAT(clients_.answers[1], Not(HasSubstr("after")));
  EXPECT_THAT(clients_.answers[2], HasSubstr(R"("result":"after")"));
}

TEST_F(StateRequestsTest, AClientHasOneOpenAndOneThatIsGoneHasNone) {
  ASSERT_TRUE(states_.Add(1, 1));
  EXPECT_EQ(states_.Add(1, 2).error().code, ErrorCode::kFull);
  ASSERT_TRUE(states_.Add(2, 1));
  Serve();
  EXPECT_FALSE(states_.Add(2, 2)) << "its first one has no answer yet";
  clients_.gone.insert(1);
  states_.Written("\"text\"");
  Serve();
  EXPECT_FALSE(clients_.answers.contains(1));
  EXPECT_THAT(clients_.answers[2], HasSubstr("text")) << "in its place";
  EXPECT_FALSE(states_.due());
  EXPECT_TRUE(states_.Add(2, 2));
}

TEST_F(StateRequestsTest, IsAnsweredWhereThereIsNoRoomNoMemoryOrAnEnd) {
  ASSERT_TRUE(states_.Add(1, 1));
  has_room_ = false;
  Serve();
  EXPECT_TRUE(states_.due()) << "rows are taken anew";
  has_room_ = true;
  Serve();
  states_.Written("");
  Serve();
  EXPECT_THAT(clients_.answers[1], HasSubstr("the state found no memory"));
  ASSERT_TRUE(states_.Add(2, 1));
  Serve();
  ASSERT_TRUE(states_.Add(3, 1));
  states_.Close({ErrorCode::kUnavailable, "the daemon ends"});
  for (const ClientId client : {2u, 3u})
    EXPECT_THAT(clients_.answers[client], HasSubstr("the daemon ends"));
}

}  // namespace
}  // namespace focalfleet
