// A camera over DDS Security: renewed credentials, and packets that are sent again. The camera is a
// client in C, which knows only the shipped IDL.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/camera/camera_dds.h"
#include "daemon/dds/credentials.h"
#include "tests/daemon/dds/client_process.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/daemon/dds/secured_domain.h"

namespace focalfleet {
namespace {

using test::ClientProcess;
using test::OwnDomain;

constexpr std::int64_t kSinceNs = 1'795'316'645'678'000'000;
constexpr std::chrono::seconds kPatience(60);  // far above anything that is measured

/// A packet of UDP as the camera sent or received it.
struct Packet {
  sockaddr_in to{};
  std::string bytes;
};

template <class Number>
Number At(const std::string& bytes, std::size_t place) {
  Number number{};
  if (place + sizeof number <= bytes.size())
    std::memcpy(&number, bytes.data() + place, sizeof number);
  return number;
}

/// The complete packets of a file as Cyclone DDS writes it (libpcap, without link headers).
std::vector<Packet> PacketsOf(const std::string& path) {
  constexpr std::size_t kFileHeader = 24, kRecordHeader = 16, kIpHeader = 20, kUdpHeader = 8;
  std::ifstream file(path, std::ios::binary);
  const std::string all{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::vector<Packet> packets;
  for (std::size_t at = kFileHeader; at + kRecordHeader < all.size();) {
    const auto length = At<std::uint32_t>(all, at + 8);
    at += kRecordHeader;
    if (length < kIpHeader + kUdpHeader || at + length > all.size()) break;
    Packet packet;
    packet.to.sin_family = AF_INET;
    packet.to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    packet.to.sin_port = At<in_port_t>(all, at + kIpHeader + 2);
    packet.bytes = all.substr(at + kIpHeader + kUdpHeader, length - kIpHeader - kUdpHeader);
    packets.push_back(std::move(packet));
    at += length;
  }
  return packets;
}

/// The packet with each sample a later one than it was: sequence numbers and source timestamps
/// grow. The second is whether it has any sample of a user's writer.
std::pair<Packet, bool> AsIfLater(Packet packet) {
  constexpr std::size_t kRtpsHeader = 20;
  constexpr std::uint8_t kInfoTimestamp = 0x09, kData = 0x15;
  bool has_sample = false;
  std::string& bytes = packet.bytes;
  const auto grow = [&](std::size_t place, std::uint32_t by) {
    const std::uint32_t number = At<std::uint32_t>(bytes, place) + by;
    if (place + sizeof number <= bytes.size())
      std::memcpy(bytes.data() + place, &number, sizeof number);
  };
  for (std::size_t at = kRtpsHeader; at + 4 <= bytes.size();) {
    const auto kind = static_cast<std::uint8_t>(bytes[at]);
    const std::size_t length = At<std::uint16_t>(bytes, at + 2);
    const auto writer_kind = static_cast<std::uint8_t>(at + 15 < bytes.size() ? bytes[at + 15] : 0);
    if (kind == kInfoTimestamp) grow(at + 8, 1000);
    if (kind == kData && writer_kind < 0x40) {  // no writer of DDS' own
      has_sample = true;
      grow(at + 20, 1);
    }
    if (length == 0) break;  // the last one, up to the end
    at += 4 + length;
  }
  return {std::move(packet), has_sample};
}

class CameraSecurity : public test::SecuredDomain {
 protected:
  [[nodiscard]] std::unique_ptr<CameraDds> Port(const std::string& role = "daemon") const {
    return std::make_unique<CameraDds>(
        CameraDds::Options{.dds = {.domain = OwnDomain(), .config_xml = {}, .security = Keys(role)},
                           .sensor = {1000, 1000}});
  }
  /// A camera that answers so many requests, and keeps its packets in the file `packets`.
  [[nodiscard]] ClientProcess Camera(const std::vector<std::string>& answers) const {
    const auto library = [](const char* which, const char* name) {
      return std::string("<Library path=\"dds_security_") + which + "\" initFunction=\"init_" +
             name + "\" finalizeFunction=\"finalize_" + name + "\"/>";
    };
    const auto file = [this](const char* element, const char* name) {
      return std::string("<") + element + ">file:" + Keys("camera") + "/" + name + "</" + element +
             ">";
    };
    const std::string configuration =
        LOOPBACK_URI ",<Security><Authentication>" + library("auth", "authentication") +
        file("IdentityCA", "identity_ca.pem") + file("IdentityCertificate", "certificate.pem") +
        file("PrivateKey", "key.pem") + "</Authentication><AccessControl>" +
        library("ac", "access_control") + file("PermissionsCA", "permissions_ca.pem") +
        file("Governance", "governance.p7s") + file("Permissions", "permissions.p7s") +
        "</AccessControl><Cryptographic>" + library("crypto", "crypto") +
        "</Cryptographic></Security>,<Tracing><PacketCaptureFile>" + (folder_ / "packets") +
        "</PacketCaptureFile></Tracing>";
    std::vector<std::string> command{"/usr/bin/env", "CYCLONEDDS_URI=" + configuration, SPOT_SENDER,
                                     std::to_string(OwnDomain())};
    command.insert(command.end(), answers.begin(), answers.end());
    return ClientProcess(std::move(command));
  }
  /// The id of the exposure that answers, an error's text, or nothing.
  static std::string Ask(CameraDds* port, std::uint64_t id) {
    const Status asked = port->Request(id, {kSinceNs + static_cast<std::int64_t>(id)});
    if (!asked) return asked.error().text;
    return Taken(port, kPatience);
  }
  static std::string Taken(CameraDds* port, std::chrono::nanoseconds within) {
    const auto until = std::chrono::steady_clock::now() + within;
    do {
      const auto taken = port->Take();
      if (!taken) return taken.error().text;
      if (*taken) return (*taken)->id;
      std::this_thread::yield();
    } while (std::chrono::steady_clock::now() < until);
    return "";
  }
};

TEST_F(CameraSecurity, RenewedCredentialsOutliveTheOldAndNoExposureIsLost) {
  const auto begun = std::chrono::steady_clock::now();
  MakeKeys("");
  // A loaded machine needs more time for all that comes before the end.
  const auto once = std::chrono::steady_clock::now() - begun;
  const std::int64_t lasts_s = 20 + std::chrono::ceil<std::chrono::seconds>(3 * once).count();
  MakeKeys("--only daemon:daemon", "MAKE_KEYS_SECONDS=" + std::to_string(lasts_s));
  const WallTime end{ReadCredentialEnds(Keys("daemon")).value().front().at_s * 1'000'000'000};
  const auto port = Port();
  const ClientProcess camera = Camera(std::vector<std::string>(7, "good"));
  ASSERT_EQ(camera.Line(), "ready");
  EXPECT_EQ(Ask(port.get(), 1), "good-1");
  MakeKeys("--only daemon:daemon --days 30");
  port->Renew(end);
  for (std::uint64_t id = 2; id <= 4; ++id) {
    EXPECT_EQ(Ask(port.get(), id), "good-" + std::to_string(id));
    EXPECT_EQ(Taken(port.get(), std::chrono::seconds(2)), "") << "both participants receive it";
  }
  ASSERT_LT(WallTime::Now().ns, end.ns)
      << "this machine is too slow for credentials that end in " << lasts_s << " s";
  // DDS cuts a participant off some time after its credentials end.
  std::this_thread::sleep_for(
      std::chrono::nanoseconds(end.ns + 3'000'000'000 - WallTime::Now().ns));
  for (std::uint64_t id = 5; id <= 7; ++id)
    EXPECT_EQ(Ask(port.get(), id), "good-" + std::to_string(id)) << "after the old end";
}

TEST_F(CameraSecurity, TheCoordinatorOfAPlaneHasACamera) {
  MakeKeys("--sectors 2");
  const auto port = Port("coordinator");
  const ClientProcess camera = Camera({"good"});
  ASSERT_EQ(camera.Line(), "ready");
  EXPECT_EQ(Ask(port.get(), 1), "good-1");
}

TEST_F(CameraSecurity, RecordedPacketsSentAgainAreNoExposure) {
  MakeKeys("");
  const auto port = Port();
  const ClientProcess camera = Camera({"good", "many", "good"});
  ASSERT_EQ(camera.Line(), "ready");
  EXPECT_EQ(Ask(port.get(), 1), "good-1");
  EXPECT_EQ(Ask(port.get(), 2), "many-2");  // its packets push those of the first into the file
  const int stranger = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const auto send = [&](const Packet& packet) {
    ::sendto(stranger, packet.bytes.data(), packet.bytes.size(), 0,
             reinterpret_cast<const sockaddr*>(&packet.to), sizeof packet.to);
  };
  const std::vector<Packet> recorded = PacketsOf(folder_ / "packets");
  std::size_t samples = 0;
  for (const Packet& packet : recorded) {
    send(packet);
    const auto [later, has_sample] = AsIfLater(packet);
    send(later);
    samples += has_sample ? 1 : 0;
  }
  EXPECT_GT(samples, 0u) << "of " << recorded.size() << " packets";
  EXPECT_EQ(Taken(port.get(), std::chrono::seconds(2)), "");
  EXPECT_EQ(Ask(port.get(), 3), "good-3") << "the camera itself is heard as before";
  ::close(stranger);
}

}  // namespace
}  // namespace focalfleet
