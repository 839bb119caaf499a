#include "daemon/process/fleet_setup.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <set>

#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

// Three buses of one unit each, on interfaces of which only some are there.
class OpenPortsTest : public ::testing::Test {
 protected:
  [[nodiscard]] auto Open(const std::set<std::string>& there,
                          const std::string& interfaces = R"(["can0", "can1", "can2"])") const {
    const auto config = ParseConfig(
        "[bus]\nport = \"socketcan\"\ninterfaces = " + interfaces + "\n", "/etc/f.toml");
    EXPECT_TRUE(config) << config.error().text;
    const auto layout = Layout::Create(MakeHexLayout({.count = 3, .units_per_bus = 1}), {});
    EXPECT_TRUE(layout) << layout.error().text;
    const InterfaceOpener open = [&](const std::string& name,
                                     const Listening&) -> Result<OpenedInterface> {
      if (name.size() > 15) return Fail(ErrorCode::kInvalid, "none can be called " + name);
      if (!there.contains(name)) return Fail(ErrorCode::kUnavailable, "no interface " + name);
      return OpenedInterface{-1, {.kind = kind}};  // present, and down
    };
    return OpenPorts(*config, *layout, HostClock(speed), open);
  }

  std::string kind = "can";
  double speed = 1;
};

TEST(OpenSync, AChipThatIsNotThereIsReportedWithItsLine) {
  const auto config = ParseConfig(
      "[bus]\nport = \"simulated\"\n[sync]\nchip = \"/dev/gpiochip4711\"\n", "/etc/f.toml");
  ASSERT_TRUE(config) << config.error().text;
  const auto sync = OpenSync(config->sync);
  ASSERT_FALSE(sync);
  EXPECT_EQ(sync.error().text, "/etc/f.toml:4: /dev/gpiochip4711: No such file or directory");
  const auto none = OpenSync({});
  ASSERT_TRUE(none);
  EXPECT_EQ(*none, nullptr);
}

TEST_F(OpenPortsTest, OnlyVirtualInterfacesMayRunInAnotherTime) {
  const std::set<std::string> all{"can0", "can1", "can2"};
  speed = 0.5;
  const auto real = Open(all);
  ASSERT_FALSE(real);
  EXPECT_EQ(real.error().text,
            "/etc/f.toml:3: clock.speed must be 1: 'can0' is no virtual CAN interface, and real "
            "motors do not hurry");
  kind = "vcan";
  EXPECT_TRUE(Open(all));
  EXPECT_FALSE(Open({"can0", "can2"})) << "it is unknown what can1 will be";
}

TEST_F(OpenPortsTest, AnInterfaceThatIsMissingIsABusThatIsDown) {
  const auto ports = Open({"can0", "can2"});
  ASSERT_TRUE(ports) << ports.error().text;
  ASSERT_EQ(ports->size(), 3u);
  EXPECT_EQ((*ports)[1]->name(), "can1");
  EXPECT_EQ((*ports)[1]->state(), LinkState::kDown);
  EXPECT_EQ((*ports)[1]->trouble(), "no interface can1");
  EXPECT_EQ((*ports)[2]->trouble(), "the interface is down");
}

TEST_F(OpenPortsTest, WhereAllAreMissingTheLineOfTheConfigurationIsReported) {
  const auto ports = Open({});
  ASSERT_FALSE(ports);
  EXPECT_EQ(ports.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(ports.error().text,
            "/etc/f.toml:3: none of bus.interfaces is there: no interface can0");
}

TEST_F(OpenPortsTest, WrongNumbersAndNamesAreReportedWithTheLine) {
  const auto two = Open({"can0"}, R"(["can0", "can1"])");
  ASSERT_FALSE(two);
  EXPECT_THAT(two.error().text,
              HasSubstr("/etc/f.toml:3: bus.interfaces names 2 interfaces, but "));
  const auto named = Open({"can0"}, R"(["can0", "can1", "can-of-a-long-name"])");
  ASSERT_FALSE(named);
  EXPECT_EQ(named.error().text, "/etc/f.toml:3: none can be called can-of-a-long-name");
}

}  // namespace
}  // namespace focalfleet
