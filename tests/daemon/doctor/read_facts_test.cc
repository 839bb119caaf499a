#include "daemon/doctor/read_facts.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "daemon/control/listening_socket.h"
#include "daemon/store/store.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::doctor {
namespace {

using focalfleet::test::ScratchFolder;
using ::testing::HasSubstr;

void Write(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

constexpr const char* kUnits =
    "unit_id,base_x_mm,base_y_mm,arm_theta_mm,arm_phi_mm,theta_zero_deg,phi_zero_deg,theta_gear,"
    "phi_gear,theta_min_deg,theta_max_deg,phi_min_deg,phi_max_deg,bus_id,node_id\n"
    "1,0,0,7.4,7.4,0,0,890,890,-190,190,0,190,0,1\n"
    "2,25.6,0,7.4,7.4,0,0,890,890,-190,190,0,190,1,1\n";

TEST(ReadFacts, ReadsWhatTheConfigurationNames) {
  const ScratchFolder scratch;
  Write(scratch / "units.csv", kUnits);
  ASSERT_EQ(mkdir((scratch / "camera").c_str(), 0710), 0);
  Write(scratch / "f.toml",
        "[bus]\nport = \"socketcan\"\ninterfaces = [\"nocan0\", \"nocan1\"]\n"
        "[camera]\ndirectory = \"camera\"\nfiducials = \"f.csv\"\n"
        "[sync]\nchip = \"nochip\"\n");
  ASSERT_TRUE(Store::Open(scratch / "focalfleet.db"));
  const Facts facts = ReadFacts({.program_version = "9",
                                 .config_path = scratch / "f.toml",
                                 .socket = "",
                                 .socket_otherwise = "/nowhere"});
  ASSERT_TRUE(facts.config) << facts.config.error().text;
  EXPECT_EQ(facts.buses.value_or(0), 2u);
  ASSERT_EQ(facts.interfaces.size(), 2u);
  EXPECT_FALSE(facts.interfaces[1].link);
  ASSERT_TRUE(facts.camera_folder);
  EXPECT_EQ(facts.camera_folder->mode, S_IFDIR | 0710u);
  EXPECT_EQ(facts.camera_folder->uid, geteuid());
  ASSERT_TRUE(facts.gpio_chip);
  EXPECT_THAT(facts.gpio_chip->trouble, HasSubstr("No such file"));
  ASSERT_EQ(facts.disks.size(), 2u);
  EXPECT_GT(facts.disks[0].free_bytes, 0u);
  ASSERT_TRUE(facts.store && *facts.store);
  EXPECT_EQ((*facts.store)->flaw, "");
  EXPECT_EQ((*facts.store)->version, (*facts.store)->version_expected);
  EXPECT_EQ(facts.daemon.socket, scratch / "control.sock");
  EXPECT_EQ(facts.daemon.connect_error, ENOENT);
  EXPECT_EQ(facts.daemon_user.uid, geteuid()) << "the owner of the store's folder";
  ASSERT_TRUE(facts.dds);
  EXPECT_EQ(facts.dds->participants, 120u);
}

TEST(ReadFacts, TheDaemonIsNotRootWhereNobodySaysSo) {
  Facts facts;
  facts.operator_user.uid = 4711;
  // The folder of the store does not exist before the first start.
  facts.store_folder = {.path = "/nowhere", .trouble = "No such file or directory"};
  EXPECT_EQ(IdentityOfDaemon(facts, "nobody").name, "nobody") << "of the installed service";
  EXPECT_EQ(IdentityOfDaemon(facts, "no such user").uid, 4711u);
  facts.store_folder = {};
  EXPECT_EQ(IdentityOfDaemon(facts, "no such user").uid, 4711u) << "no configuration";
  facts.store_folder = {.path = "/", .trouble = "", .uid = 0};
  EXPECT_EQ(IdentityOfDaemon(facts, "nobody").uid, 0u) << "root's folder";
}

TEST(ReadFacts, GoesOnWithoutAConfiguration) {
  const Facts facts = ReadFacts({.program_version = "9",
                                 .config_path = "/nowhere/f.toml",
                                 .socket = "",
                                 .socket_otherwise = "/nowhere/control.sock"});
  EXPECT_FALSE(facts.config);
  EXPECT_EQ(facts.daemon.socket, "/nowhere/control.sock");
  EXPECT_GT(facts.host.open_files_max, 0u);
}

TEST(ReadDaemon, KnowsWhoListensEvenWhereNobodyAnswers) {
  const ScratchFolder scratch;
  const auto listening = ListeningSocket::Create(scratch / "control.sock");
  ASSERT_TRUE(listening);
  const DaemonFacts daemon = ReadDaemon(scratch / "control.sock");
  EXPECT_EQ(daemon.connect_error, 0);
  EXPECT_NE(daemon.silence, "");
  ASSERT_TRUE(daemon.process);
  EXPECT_EQ(daemon.process->user.uid, geteuid());
  EXPECT_NE(std::ranges::find(daemon.process->user.groups, getegid()),
            daemon.process->user.groups.end());
  EXPECT_GT(daemon.process->open_files_max.value_or(0), 0u);
  EXPECT_TRUE(daemon.process->may_configure_network);
}

TEST(ReadHost, SeesAnUdpPortInUse) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ASSERT_GE(fd, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const at = static_cast<sockaddr*>(static_cast<void*>(&address));
  ASSERT_EQ(bind(fd, at, size), 0);
  ASSERT_EQ(getsockname(fd, at, &size), 0);
  const HostFacts host = ReadHost();
  EXPECT_TRUE(host.udp_ports.contains(ntohs(address.sin_port)));
  close(fd);
  EXPECT_FALSE(ReadHost().udp_ports.contains(ntohs(address.sin_port)));
  const auto loopback = std::ranges::find(host.interfaces, "lo", &NetworkInterface::name);
  ASSERT_NE(loopback, host.interfaces.end());
  EXPECT_TRUE(loopback->addresses.contains("127.0.0.1"));
}

}  // namespace
}  // namespace focalfleet::doctor
