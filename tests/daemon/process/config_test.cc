#include "daemon/process/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "daemon/process/config_manual.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ScratchFolder;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr const char* kMinimal = "[bus]\nport = \"simulated\"\n";

std::string ErrorOf(std::string_view text) {
  const auto config = ParseConfig(text, "/etc/focalfleet/f.toml");
  EXPECT_FALSE(config) << text;
  if (config) return "";
  EXPECT_EQ(config.error().code, ErrorCode::kInvalid);
  return config.error().text;
}

TEST(Config, DefaultsAreTheDocumentedOnes) {
  const auto config = ParseConfig(kMinimal, "f.toml");
  ASSERT_TRUE(config) << config.error().text;
  EXPECT_EQ(config->fleet.units, "units.csv");
  EXPECT_EQ(config->store.path, "focalfleet.db");
  EXPECT_EQ(config->control.socket, "control.sock");
  EXPECT_TRUE(config->dds.enabled);
  EXPECT_EQ(config->dds.rate_hz, 10);
  EXPECT_EQ(config->metrics.port, 0u);
  EXPECT_EQ(config->bus.bit_rate_bps, 1'000'000u);
  EXPECT_FALSE(config->bus.can_fd);
  EXPECT_EQ(config->timing.data_bit_rate_bps, 0u) << "no groups, whatever data_bit_rate_bps is";
  EXPECT_EQ(config->clock.speed, 1);
  EXPECT_EQ(config->drive.axis[1].repeat, 108);
  EXPECT_EQ(config->timing.reply_wait, CoordinatorConfig{}.reply_wait);
}

TEST(Config, APlaneAndItsSectorsAreRead) {
  const auto plane =
      ParseConfig("[plane]\nsectors = [\"0-12\", \"13,14\"]\n[bus]\nunix_directory = \"d\"\n",
                  "/etc/ff/p.toml");
  ASSERT_TRUE(plane) << plane.error().text;
  EXPECT_TRUE(plane->plane.coordinates());
  EXPECT_EQ(plane->plane.sectors, (std::vector<std::string>{"0-12", "13,14"}));
  EXPECT_EQ(plane->plane.sectors_at, "/etc/ff/p.toml:2");
  EXPECT_FALSE(plane->timing.in_plane);
  const auto sector = ParseConfig(
      "[sector]\nbuses = \"13,14\"\nnumber = 1\n[bus]\nunix_directory = \"d\"\n", "/etc/ff/s.toml");
  ASSERT_TRUE(sector) << sector.error().text;
  EXPECT_TRUE(sector->sector.present());
  EXPECT_EQ(sector->sector.buses, "13,14");
  EXPECT_EQ(sector->sector.number, 1u);
  EXPECT_TRUE(sector->timing.in_plane);
}

TEST(Config, APlaneNeedsDdsAndOneRoleADaemon) {
  for (const char* text :
       {"[plane]\nsectors = [\"0\"]\n[sector]\nbuses = \"0\"\n",
        "[sector]\nbuses = \"0\"\n[dds]\nenabled = false\n",
        "[plane]\nsectors = [\"0\"]\n[dds]\nenabled = false\n",
        "[sector]\nbuses = \"0\"\nnumber = 64\n",
        "[sector]\nbuses = \"0\"\n[camera]\ndirectory = \"c\"\nfiducials = \"f\"\n"})
    EXPECT_FALSE(ParseConfig(std::string(text) + "[bus]\nunix_directory = \"d\"\n", "/p.toml"))
        << text;
}

TEST(Config, EveryKeyIsRead) {
  const auto config = ParseConfig(R"(
[fleet]
units = "u.csv"
obstacles = "o.csv"
clearance_mm = 0.25
[store]
path = "s.db"
keep_days = 400
[control]
socket = "c.sock"
viewers = ["look", "2001"]
operators = ["move"]
engineers = ["root"]
[dds]
enabled = false
domain = 7
rate_hz = 2.5
config = "c.xml"
security = "keys"
[http]
address = "192.0.2.1"
port = 443
names = ["plate"]
certificate = "p.crt"
key = "p.key"
tokens = "t.csv"
viewers_max = 5
[log]
level = "debug"
file = "l.log"
journal = false
[metrics]
address = "::1"
port = 9890
names = ["plate", "plate.example.org"]
[bus]
port = "socketcan"
bit_rate_bps = 500000
can_fd = true
data_bit_rate_bps = 4000000
unix_directory = "d"
interfaces = ["can0", "can1"]
opener = "o.sock"
[sync]
chip = "/dev/gpiochip3"
line = 9
active_low = true
[clock]
speed = 1.0
[drive]
v_bus_V = 2.4
counter1 = 400
repeat = 37
subdivision = 48
mode = "seven_segment"
[timing]
reply_wait_ms = 1
identify_period_ms = 2
poll_period_ms = 3
clock_period_ms = 4
start_delay_ms = 5
sync_lead_ms = 9
settle_margin_ms = 6
silence_limit_ms = 7
[simulated]
seed = 8
spread = "real"
)",
                                  "/etc/ff/f.toml");
  ASSERT_TRUE(config) << config.error().text;
  EXPECT_EQ(config->fleet.units, "/etc/ff/u.csv") << "relative to the file";
  EXPECT_EQ(config->fleet.clearance_mm, 0.25);
  EXPECT_EQ(config->control.roles.viewers, (std::vector<std::string>{"look", "2001"}));
  EXPECT_EQ(config->control.roles.operators, std::vector<std::string>{"move"});
  EXPECT_EQ(config->control.roles.engineers, std::vector<std::string>{"root"});
  EXPECT_EQ(config->control.roles_at, "/etc/ff/f.toml:13");
  EXPECT_EQ(config->dds.security, "/etc/ff/keys");
  EXPECT_EQ(config->http.address, "192.0.2.1");
  EXPECT_EQ(config->http.port, 443u);
  EXPECT_EQ(config->http.names, std::vector<std::string>{"plate"});
  EXPECT_EQ(config->http.certificate, "/etc/ff/p.crt");
  EXPECT_EQ(config->http.key, "/etc/ff/p.key");
  EXPECT_EQ(config->http.tokens, "/etc/ff/t.csv");
  EXPECT_EQ(config->http.viewers_max, 5u);
  EXPECT_EQ(config->bus.opener, "/etc/ff/o.sock");
  EXPECT_EQ(config->dds.domain, 7u);
  EXPECT_EQ(config->metrics.address, "::1");
  EXPECT_EQ(config->metrics.port, 9890u);
  EXPECT_EQ(config->metrics.names, (std::vector<std::string>{"plate", "plate.example.org"}));
  EXPECT_EQ(config->bus.port, PortKind::kSocketCan);
  EXPECT_EQ(config->bus.interfaces, (std::vector<std::string>{"can0", "can1"}));
  EXPECT_EQ(config->timing.bit_rate_bps, 500'000u);
  EXPECT_EQ(config->timing.data_bit_rate_bps, 4'000'000u);
  EXPECT_EQ(config->drive.mode, WaveMode::kSevenSegment);
  EXPECT_EQ(config->drive.axis[0], config->drive.axis[1]);
  EXPECT_EQ(config->drive.axis[0].counter1, 400);
  EXPECT_EQ(config->timing.silence_limit, Milliseconds(7));
  EXPECT_EQ(config->simulated.seed, 8u);
  EXPECT_FALSE(config->log.journal);
  EXPECT_EQ(config->store.keep_days, 400u);
  EXPECT_EQ(config->log.file_at, "/etc/ff/f.toml:30");
  EXPECT_EQ(config->bus.interfaces_at, "/etc/ff/f.toml:42");
  EXPECT_EQ(config->sync.chip, "/dev/gpiochip3");
  EXPECT_EQ(config->sync.line, 9u);
  EXPECT_TRUE(config->sync.active_low);
  EXPECT_EQ(config->sync.chip_at, "/etc/ff/f.toml:45");
  EXPECT_TRUE(config->timing.sync_line);
  EXPECT_EQ(config->timing.sync_lead, Milliseconds(9));
}

TEST(Config, HttpFromElsewhereTakesTlsAndTokens) {
  const std::string bus = "[bus]\nport = \"simulated\"\n[http]\n";
  EXPECT_EQ(ParseConfig(kMinimal, "f.toml")->http.port, 0u) << "off";
  EXPECT_TRUE(ParseConfig(bus + "port = 8080\n", "f.toml")) << "loopback";
  for (const char* address : {"0.0.0.0", "192.0.2.1", "::", "2001:db8::1"})
    EXPECT_THAT(ErrorOf(bus + "port = 8080\naddress = \"" + address + "\"\n"),
                HasSubstr("that takes http.certificate and http.key"))
        << address;
  EXPECT_THAT(ErrorOf(bus + "port = 8080\nkey = \"k\"\n"), HasSubstr("belong together"));
  EXPECT_THAT(ErrorOf(bus + "port = 8080\ntokens = \"\"\n"), HasSubstr("http.tokens"));
  EXPECT_FALSE(ParseConfig(kMinimal, "f.toml")->http.viewer_without_token) << "off";
  EXPECT_TRUE(ParseConfig(bus + "port = 8080\nviewer_without_token = true\n", "f.toml"));
  EXPECT_THAT(ErrorOf(bus + "port = 8080\naddress = \"192.0.2.1\"\ncertificate = \"c\"\nkey = "
                            "\"k\"\nviewer_without_token = true\n"),
              HasSubstr("viewer_without_token needs a loopback address"));
  EXPECT_THAT(ErrorOf(bus + "address = \"localhost\"\n"), HasSubstr("numeric"));
}

TEST(Config, ASyncLineAsksForRealTimeAndAnEdgeWithinTheUnitsWindow) {
  const std::string bus = "[bus]\nport = \"simulated\"\n";
  EXPECT_FALSE(ParseConfig(kMinimal, "f.toml")->timing.sync_line);
  EXPECT_THAT(ErrorOf(bus + "[sync]\nchip = \"/dev/gpiochip0\"\n[clock]\nspeed = 4.0\n"),
              HasSubstr(":4: sync.chip asks for clock.speed = 1"));
  EXPECT_THAT(ErrorOf(bus + "[timing]\nsync_lead_ms = 20\n"),
              HasSubstr(":4: timing.sync_lead_ms must be below 20"));
}

TEST(Config, MetricsAreOffUnlessTheyHaveAPortAndGoToANumericAddress) {
  const std::string bus = "[bus]\nport = \"simulated\"\n";
  EXPECT_EQ(ParseConfig(kMinimal, "f.toml")->metrics.port, 0u);
  EXPECT_EQ(ParseConfig(kMinimal, "f.toml")->metrics.address, "127.0.0.1");
  EXPECT_THAT(ErrorOf(bus + "[metrics]\nport = 65536\n"),
              HasSubstr(":4: metrics.port must be in 0..65535"));
  for (const char* address : {"", "localhost", "127.0.0.1:9890", "[::1]"})
    EXPECT_THAT(ErrorOf(bus + "[metrics]\naddress = \"" + address + "\"\n"),
                HasSubstr(":4: metrics.address must be a numeric address"));
}

TEST(Config, AbsolutePathsStay) {
  const auto config =
      ParseConfig("[store]\npath = \"/var/s.db\"\n[bus]\nport = \"simulated\"", "/etc/f.toml");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->store.path, "/var/s.db");
}

TEST(Config, UnknownKeyIsAnErrorWithItsLine) {
  EXPECT_EQ(ErrorOf("[bus]\nport = \"simulated\"\n\n[dds]\nrate = 5\n"),
            "/etc/focalfleet/f.toml:5: unknown key 'dds.rate'");
  EXPECT_EQ(ErrorOf("[bus]\nport = \"simulated\"\n[buss]\nx = 1\n"),
            "/etc/focalfleet/f.toml:3: unknown key 'buss'");
}

TEST(Config, WrongTypeIsAnErrorWithItsLine) {
  EXPECT_THAT(ErrorOf("[bus]\nport = \"simulated\"\nbit_rate_bps = \"fast\""),
              StartsWith("/etc/focalfleet/f.toml:3: bus.bit_rate_bps must be a whole number"));
  EXPECT_THAT(ErrorOf("[bus]\nport = \"simulated\"\nbit_rate_bps = 1e6"), HasSubstr(":3:"));
  EXPECT_THAT(ErrorOf("[bus]\nport = 4"), HasSubstr(":2: bus.port must be a text"));
  EXPECT_THAT(ErrorOf("[bus]\nport = \"simulated\"\n[dds]\nenabled = 1"),
              HasSubstr(":4: dds.enabled must be true or false"));
  EXPECT_THAT(ErrorOf("[bus]\nport = \"simulated\"\ninterfaces = [\"can0\", 1]"),
              HasSubstr(":3: bus.interfaces must be a list of texts"));
  EXPECT_THAT(ErrorOf("fleet = 3\n[bus]\nport = \"simulated\""),
              HasSubstr(":1: fleet must be a table"));
  EXPECT_THAT(ErrorOf("[bus]\nport = \"simulated\"\n[clock]\nspeed = \"2\""),
              HasSubstr(":4: clock.speed must be a number"));
}

TEST(Config, ValueOutOfRangeIsAnErrorWithItsLine) {
  const std::string bus = "[bus]\nport = \"simulated\"\n";
  EXPECT_THAT(ErrorOf(bus + "bit_rate_bps = 2000000"),
              HasSubstr(":3: bus.bit_rate_bps must be in"));
  EXPECT_THAT(ErrorOf(bus + "data_bit_rate_bps = 9000000"),
              HasSubstr(":3: bus.data_bit_rate_bps must be in 10000..8000000"));
  EXPECT_THAT(ErrorOf(bus + "[clock]\nspeed = 0"), HasSubstr(":4: clock.speed must be in"));
  EXPECT_THAT(ErrorOf(bus + "[clock]\nspeed = nan"), HasSubstr(":4: clock.speed must be in"));
  EXPECT_THAT(ErrorOf(bus + "[dds]\ndomain = -1"), HasSubstr(":4: dds.domain must be in 0..230"));
  EXPECT_THAT(ErrorOf(bus + "[dds]\nsecurity = \"keys\"\ndomain = 224"),
              HasSubstr("dds.domain is 0..223 with dds.security"));
  EXPECT_THAT(ErrorOf(bus + "[drive]\nrepeat = 256"),
              HasSubstr(":4: drive.repeat must be in 1..255"));
  EXPECT_THAT(ErrorOf(bus + "[timing]\nreply_wait_ms = 0"), HasSubstr(":4: timing.reply_wait_ms"));
  EXPECT_THAT(ErrorOf(bus + "[log]\nlevel = \"loud\""), HasSubstr(":4: log.level must be one of"));
}

TEST(Config, KeysThatContradictEachOtherAreReported) {
  EXPECT_THAT(ErrorOf("[bus]\nport = \"socketcan\""), HasSubstr("bus.interfaces must name"));
  EXPECT_THAT(ErrorOf("[bus]\nport = \"socketcan\"\ninterfaces = [\"a\", \"a\"]"),
              HasSubstr(":3: bus.interfaces must name each interface once"));
  EXPECT_THAT(ErrorOf("[bus]\nport = \"unix\""), HasSubstr("bus.unix_directory"));
  for (const char* port : {"\"simulated\"", "\"unix\"\nunix_directory = \"d\""})
    EXPECT_THAT(ErrorOf("[bus]\ncan_fd = true\nport = " + std::string(port)),
                HasSubstr(":2: bus.can_fd needs bus.port = \"socketcan\": simulated buses and UNIX "
                          "sockets carry classic frames only"));
  EXPECT_THAT(ErrorOf("[bus]\nport = \"socketcan\"\ninterfaces = [\"a\"]\ncan_fd = true\n"
                      "data_bit_rate_bps = 500000"),
              HasSubstr(":5: bus.data_bit_rate_bps must not be below bus.bit_rate_bps"));
  EXPECT_THAT(ErrorOf(std::string(kMinimal) + "[store]\npath = \"\""), HasSubstr(":4: store.path"));
}

TEST(Config, ManyFaultsNameTheFirstAndCountTheRest) {
  EXPECT_EQ(ErrorOf("[bus]\nport = \"simulated\"\nx = 1\n[dds]\ny = 2\nz = 3"),
            "/etc/focalfleet/f.toml:3: unknown key 'bus.x' (and 2 more)");
}

TEST(Config, ATextThatIsNoTomlIsAnErrorWithItsLine) {
  EXPECT_THAT(ErrorOf("[bus]\nport = \n"), StartsWith("/etc/focalfleet/f.toml:2: "));
  EXPECT_THAT(ErrorOf(std::string_view("\x00\xff\xfe garbage", 11)),
              StartsWith("/etc/focalfleet/f.toml:1: "));
  EXPECT_THAT(ErrorOf("[bus]\nport=\"unix\"\nport=\"unix\"\n"), HasSubstr(":3: "));
}

TEST(Config, EffectiveConfigReadsBackTheSame) {
  const auto config = ParseConfig(
      "[bus]\nport = \"unix\"\nunix_directory = \"/run/ff\"\n[clock]\nspeed = 4\n"
      "[log]\nfile = \"odd \\\"name\\\".log\"\n[timing]\npoll_period_ms = 77",
      "/etc/f.toml");
  ASSERT_TRUE(config) << config.error().text;
  const std::string shown = EffectiveConfig(*config);
  const auto again = ParseConfig(shown, "/etc/f.toml");
  ASSERT_TRUE(again) << again.error().text << "\n" << shown;
  EXPECT_EQ(EffectiveConfig(*again), shown);
  EXPECT_EQ(again->timing.poll_period, Milliseconds(77));
  EXPECT_EQ(again->log.file, config->log.file);
}

TEST(Config, WaitsForOurOwnProcessesStayInRealTimeWhereTheFleetIsFaster) {
  const std::string fast = "[bus]\nport = \"simulated\"\n[clock]\nspeed = 10\n";
  const auto config = ParseConfig(fast, "f.toml");
  ASSERT_TRUE(config) << config.error().text;
  EXPECT_EQ(config->timing.reply_wait, CoordinatorConfig{}.reply_wait * 10);
  EXPECT_EQ(config->timing.start_delay, CoordinatorConfig{}.start_delay * 10);
  EXPECT_EQ(config->timing.confirm_within, CoordinatorConfig{}.confirm_within * 10);
  EXPECT_EQ(config->timing.poll_period, CoordinatorConfig{}.poll_period);
  EXPECT_EQ(ParseConfig(fast + "[timing]\nreply_wait_ms = 60", "f.toml")->timing.reply_wait,
            Milliseconds(60))
      << "what is said holds";
}

TEST(Config, FileThatIsNotThereOrNoFileIsNamed) {
  const ScratchFolder scratch;
  EXPECT_THAT(LoadConfig(scratch / "none.toml").error().text, HasSubstr(scratch / "none.toml"));
  EXPECT_THAT(LoadConfig(scratch.path()).error().text, HasSubstr("directory"));
  std::ofstream(scratch / "f.toml") << kMinimal;
  const auto config = LoadConfig(scratch / "f.toml");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->fleet.units, scratch / "units.csv");
}

TEST(Config, TheExampleHasEveryKeyWithItsDefault) {
  std::ifstream file(FOCALFLEET_SOURCE_DIR "/deploy/focalfleet.toml");
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const auto example = ParseConfig(text, "focalfleet.toml");
  ASSERT_TRUE(example) << example.error().text;
  DaemonConfig expected;
  expected.bus.port = PortKind::kSocketCan;  // the example is for real buses
  expected.bus.interfaces = {"can0", "can1"};
  expected.metrics.port = 9890;  // a daemon in service is watched
  EXPECT_EQ(EffectiveConfig(*example), EffectiveConfig(expected));
  for (const ConfigSection& section : DescribeConfig()) {
    const std::size_t begin = text.find("\n[" + section.name + "]");
    ASSERT_NE(begin, std::string::npos) << section.name;
    const std::string body = text.substr(begin, text.find("\n[", begin + 1) - begin);
    for (const ConfigKey& key : section.keys) {
      const std::string name = key.name.substr(section.name.size() + 1);
      EXPECT_THAT(body, HasSubstr("\n" + name + " = ")) << key.name;
    }
  }
}

TEST(Config, TheListOfKeysHasTypeRangeDefaultAndMeaning) {
  const auto sections = DescribeConfig();
  ASSERT_EQ(sections.front().name, "fleet");
  const ConfigKey& clearance = sections.front().keys.at(2);
  EXPECT_EQ(clearance.name, "fleet.clearance_mm");
  EXPECT_EQ(clearance.kind, "number from 0 to 1000");
  EXPECT_EQ(clearance.initial, "0");
  for (const ConfigSection& section : sections) {
    EXPECT_NE(section.meaning, "") << section.name;
    for (const ConfigKey& key : section.keys) {
      EXPECT_NE(key.meaning, "") << key.name;
      EXPECT_NE(key.kind, "") << key.name;
      EXPECT_NE(key.initial, "") << key.name;
    }
  }
}

}  // namespace
}  // namespace focalfleet
