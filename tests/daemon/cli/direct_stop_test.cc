// stop --direct runs against buses that this test plays itself; the daemon has no part in it.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <stdexcept>
#include <thread>

#include "daemon/control/messages.h"
#include "daemon/control/unix_address.h"
#include "daemon/ports/socket_frames.h"
#include "protocol/wire/codec.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ScratchFolder;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// PlayedBus is a bus whose units answer a stop with their positions. All frames from the host are
// kept.
class PlayedBus {
 public:
  PlayedBus(const std::string& path, std::vector<NodeId> nodes) : nodes_(std::move(nodes)) {
    listener_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    const auto address = UnixAddress::Of(path);
    if (!address || bind(listener_, address->get(), UnixAddress::length()) != 0 ||
        listen(listener_, 4) != 0 || pipe2(quit_.data(), O_CLOEXEC) != 0) {
      throw std::runtime_error("no bus at " + path);
    }
    thread_ = std::thread([this] { Serve(); });
  }
  PlayedBus(const PlayedBus&) = delete;
  PlayedBus& operator=(const PlayedBus&) = delete;
  ~PlayedBus() {
    if (thread_.joinable()) End();
    close(listener_);
  }

  std::vector<CanFrame> End() {
    close(quit_[1]);
    thread_.join();
    close(quit_[0]);
    return heard_;
  }

 private:
  void Serve() {
    int client = -1;
    for (;;) {
      std::array<pollfd, 2> polls{pollfd{client < 0 ? listener_ : client, POLLIN, 0},
                                  pollfd{quit_[0], POLLIN, 0}};
      poll(polls.data(), polls.size(), -1);
      if (polls[0].revents != 0) {
        if (client < 0) {
          client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
        } else if (!Hear(client)) {
          close(client);
          client = -1;
        }
      } else if (polls[1].revents != 0) {
        break;
      }
    }
    if (client >= 0) close(client);
  }

  bool Hear(int client) {
    can_frame raw{};
    if (recv(client, &raw, sizeof raw, 0) != static_cast<ssize_t>(sizeof raw)) return false;
    const auto frame = FromSocketFrame(raw);
    if (!frame) return true;
    heard_.push_back(*frame);
    for (const NodeId node : nodes_) {
      const can_frame answer = ToSocketFrame(Encode(
          UnitMessage(Done{.outcome = Outcome::kStopped, .position = {}, .move = {}}), {node, 0}));
      [[maybe_unused]] const auto sent = send(client, &answer, sizeof answer, MSG_NOSIGNAL);
    }
    return true;
  }

  std::vector<NodeId> nodes_;
  std::vector<CanFrame> heard_;
  int listener_ = -1;
  std::array<int, 2> quit_{-1, -1};
  std::thread thread_;
};

class DirectStop : public ::testing::Test {
 protected:
  std::string Config(const std::string& text) { return scratch_.Put("fleet.toml", text); }
  ScratchFolder scratch_;
};

bool StopsNode(const CanFrame& frame, NodeId node) {
  const auto message = DecodeHost(frame);
  return message && std::holds_alternative<Stop>(message->message) && message->address.node == node;
}

TEST_F(DirectStop, PutsTheStopOnEveryBusAndCountsAnswers) {
  PlayedBus three(scratch_ / "bus3.sock", {NodeId{1}, NodeId{2}});
  PlayedBus eleven(scratch_ / "bus11.sock", {NodeId{9}});
  const auto result =
      Focalfleet({"stop", "--direct", "--json", "--config",
                  Config("[bus]\nport = \"unix\"\nunix_directory = \".\"\n[nonsense]\nx = 1\n")});
  EXPECT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["sent"], 2);
  EXPECT_EQ(reported["units_answered"], 3);
  EXPECT_THAT(reported["buses"][0]["bus"].get<std::string>(), HasSubstr("bus3.sock"));
  for (PlayedBus* bus : {&three, &eleven}) {
    const auto heard = bus->End();
    EXPECT_THAT(heard, Not(IsEmpty()));
    EXPECT_THAT(heard, Each(::testing::Truly([](const CanFrame& frame) {
                  return StopsNode(frame, kBroadcastNode);
                })));
  }
}

TEST_F(DirectStop, StopsOneUnitOnItsBusAlone) {
  std::vector<NodeId> nodes;
  for (std::uint8_t node = 1; node <= 60; ++node) nodes.push_back(NodeId{node});
  PlayedBus three(scratch_ / "bus3.sock", nodes);
  PlayedBus four(scratch_ / "bus4.sock", nodes);
  ASSERT_EQ(Focalfleet({"layout", "hex", "--count", "300", "--units-per-bus", "60", "--out",
                        scratch_ / "units.csv"})
                .exit,
            0);
  // Unit 1 of this layout is on the bus and node that its row gives.
  const std::string csv = test::Slurp(scratch_ / "units.csv");
  const auto columns = csv.substr(0, csv.find('\n'));
  ASSERT_THAT(columns, HasSubstr("rail_id,bus_id,node_id,enabled"));
  const std::string row = csv.substr(csv.find("\n1,") + 1, csv.find("\n2,") - csv.find("\n1,") - 1);
  std::vector<std::string> cells;
  for (std::size_t at = 0; at <= row.size();) {
    const std::size_t comma = std::min(row.find(',', at), row.size());
    cells.push_back(row.substr(at, comma - at));
    at = comma + 1;
  }
  const std::string bus = cells.at(14);
  const NodeId node{static_cast<std::uint8_t>(std::stoi(cells.at(15)))};
  ASSERT_TRUE(bus == "3" || bus == "4") << row;

  const auto result =
      Focalfleet({"stop", "1", "--direct", "--config",
                  Config("[fleet]\nunits = \"units.csv\"\n[bus]\nunix_directory = \".\"\n")});
  EXPECT_EQ(result.exit, 0) << result.err;
  const auto heard_three = three.End();
  const auto heard_four = four.End();
  const auto& meant = bus == "3" ? heard_three : heard_four;
  const auto& other = bus == "3" ? heard_four : heard_three;
  EXPECT_THAT(other, IsEmpty());
  ASSERT_THAT(meant, Not(IsEmpty()));
  EXPECT_THAT(meant, Each(::testing::Truly([&](const CanFrame& f) { return StopsNode(f, node); })));
}

TEST_F(DirectStop, NamesABusThatDoesNotTakeIt) {
  PlayedBus alive(scratch_ / "bus0.sock", {});
  const std::string dead = scratch_.Put("bus1.sock", "");
  const auto result =
      Focalfleet({"stop", "--direct", "--config", Config("[bus]\nunix_directory = \".\"\n")});
  EXPECT_EQ(result.exit, 3);
  EXPECT_THAT(result.err, HasSubstr("bus1.sock"));
  EXPECT_THAT(result.out, HasSubstr("1 of 2 buses"));
}

TEST_F(DirectStop, IsNotDoneWhereNoUnitAnswers) {
  PlayedBus mute(scratch_ / "bus0.sock", {});
  const auto result =
      Focalfleet({"stop", "--direct", "--config", Config("[bus]\nunix_directory = \".\"\n")});
  EXPECT_EQ(result.exit, 3);
  EXPECT_THAT(result.err, HasSubstr("no unit answered: whether they stand is not known"));
}

TEST_F(DirectStop, TellsWhatIsWrongWithTheConfiguration) {
  const auto stop = [&](const std::string& toml) {
    return Focalfleet({"stop", "--direct", "--config", Config(toml)});
  };
  EXPECT_THAT(stop("[bus\n").err, HasSubstr("fleet.toml:1: "));
  EXPECT_THAT(stop("[bus]\nport = \"simulated\"\n").err, HasSubstr("simulated"));
  EXPECT_THAT(stop("[bus]\nport = \"unix\"\n").err, HasSubstr("unix_directory: not given"));
  EXPECT_THAT(stop("[bus]\nunix_directory = \"none\"\n").err, HasSubstr("No such file"));
  EXPECT_THAT(stop("[bus]\nunix_directory = \".\"\n").err, HasSubstr("no bus<ID>.sock there"));
  EXPECT_THAT(stop("[bus]\nport = \"socketcan\"\n").err, HasSubstr("interfaces: none named"));
  const auto can = stop("[bus]\nport = \"socketcan\"\ninterfaces = [\"nosuchcan7\"]\n");
  EXPECT_THAT(can.err, HasSubstr("nosuchcan7"));
  EXPECT_EQ(can.exit, 1);
  EXPECT_EQ(Focalfleet({"stop", "--direct", "--config", scratch_ / "none.toml"}).exit, 1);
  EXPECT_EQ(Focalfleet({"stop", "--config", scratch_ / "none.toml"}).exit, 2);
}

}  // namespace
}  // namespace focalfleet
