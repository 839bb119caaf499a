// DDS Security end to end: credentials of deploy/dds-security/make-keys, a publisher, readers with
// and without credentials, forgers. Each side is a process of its own: within one process DDS does
// not protect a writer from a reader.
#include <dds/dds.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <thread>

#include "daemon/dds/credentials.h"
#include "daemon/dds/cyclone.h"
#include "daemon/dds/status_publisher.h"
#include "daemon/dds/status_reader.h"
#include "daemon/status/renewing_status_publisher.h"
#include "focalfleet.h"  // generated from focalfleet.idl
#include "tests/daemon/dds/client_process.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ClientProcess;
using test::OwnDomain;
using ::testing::HasSubstr;

constexpr std::chrono::seconds kPatience(60);  // far above anything that is measured
constexpr std::uint32_t kUnits = 100;

class DdsSecurity : public ::testing::Test {
 protected:
  DdsSecurity() { MakeKeys(""); }

  void MakeKeys(const std::string& options, const std::string& environment = "") {
    const std::string command = environment + " " MAKE_KEYS " " + (folder_ / "keys") +
                                " --domain " + std::to_string(OwnDomain()) + " " + options +
                                " > /dev/null";
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
  }
  [[nodiscard]] std::string Keys(const std::string& who) const { return folder_ / ("keys/" + who); }
  [[nodiscard]] ClientProcess Talker(const std::string& who) const {
    return ClientProcess(
        {TALKER, std::to_string(OwnDomain()), std::to_string(kUnits), "0", Keys(who)});
  }
  static std::unique_ptr<StatusReader> Reader(const std::string& security) {
    StatusReader::Options options;
    options.dds = {.domain = OwnDomain(), .config_xml = {}, .security = security};
    auto reader = StatusReader::Create(options);
    EXPECT_TRUE(reader) << (reader ? "" : reader.error().text);
    return reader ? std::move(*reader) : nullptr;
  }
  /// The units that the reader has received once `enough` of them are there.
  static std::set<std::uint32_t> Received(StatusReader* reader, std::size_t enough) {
    std::set<std::uint32_t> units;
    StatusUpdate update;
    const auto until = std::chrono::steady_clock::now() + kPatience;
    do {
      EXPECT_TRUE(reader->Wait(std::chrono::milliseconds(100)));
      EXPECT_TRUE(reader->Take(&update));
      for (const auto& unit : update.units) units.insert(unit.unit.value);
    } while (units.size() < enough && std::chrono::steady_clock::now() < until);
    return units;
  }

  /// Received by a WATCHER, as it prints once a second.
  struct Line {
    std::size_t units = 0;
    std::uint64_t samples = 0;
    long longest_ms = 0;
  };
  static Line Next(ClientProcess* watcher) {
    Line line;
    std::istringstream(watcher->Line()) >> line.units >> line.samples >> line.longest_ms;
    return line;
  }
  static Line WaitForUnits(ClientProcess* watcher, std::size_t enough) {
    Line line = Next(watcher);
    for (std::int64_t s = 0; s < kPatience.count() && line.units < enough; ++s)
      line = Next(watcher);
    return line;
  }

  test::ScratchFolder folder_;
};

// Cyclone DDS keeps one set of permissions for each domain and process: the first. Whoever has
// others is a process of its own here, or has the domain after the one before has left it.
TEST_F(DdsSecurity, AMonitorReadsAllAndAnOutsiderNothing) {
  const ClientProcess talker = Talker("daemon");
  ASSERT_EQ(talker.Line(), "ready");
  ClientProcess outsider({WATCHER, std::to_string(OwnDomain())});
  // The outsider has the time of two handshakes, one after the other.
  for (const char* who : {"monitor", "display"}) {
    ClientProcess reader({WATCHER, std::to_string(OwnDomain()), Keys(who)});
    EXPECT_EQ(WaitForUnits(&reader, kUnits).units, kUnits) << who;
  }
  EXPECT_EQ(WaitForUnits(&outsider, 0).samples, 0u);
}

TEST_F(DdsSecurity, AMonitorCannotWrite) {
  for (const char* who : {"monitor", "display", "camera"}) {
    const auto publisher =
        StatusPublisher::Create({.domain = OwnDomain(), .config_xml = {}, .security = Keys(who)});
    ASSERT_FALSE(publisher) << who;
    EXPECT_THAT(publisher.error().text, HasSubstr("Security")) << who;
  }
}

TEST_F(DdsSecurity, ExposuresComeFromTheCameraAlone) {
  using namespace dds_internal;
  const auto writes = [&](const std::string& who, const dds_topic_descriptor& type,
                          const char* name) {
    const auto domain = Domain::Acquire(OwnDomain(), "");
    auto participant = MakeParticipant(OwnDomain(), Keys(who));
    EXPECT_TRUE(participant) << participant.error().text;
    const auto topic = MakeTopic(*participant, type, name);
    return topic && MakeWriter(*participant, *topic);
  };
  EXPECT_TRUE(writes("camera", focalfleet_Exposure_desc, kExposureTopic));
  for (const char* who : {"daemon", "monitor", "display"})
    EXPECT_FALSE(writes(who, focalfleet_Exposure_desc, kExposureTopic)) << who;
  EXPECT_TRUE(writes("daemon", focalfleet_ExposureRequest_desc, kExposureRequestTopic));
  EXPECT_FALSE(writes("camera", focalfleet_ExposureRequest_desc, kExposureRequestTopic));
}

TEST_F(DdsSecurity, AForgedStatusReachesNobody) {
  const auto monitor = Reader(Keys("monitor"));
  // Units 1 to 100 by somebody without credentials, who came first.
  const ClientProcess forger({TALKER, std::to_string(OwnDomain()), std::to_string(kUnits), "0"});
  ASSERT_EQ(forger.Line(), "ready");
  EXPECT_EQ(Received(monitor.get(), 0).size(), 0u);
  const ClientProcess talker = Talker("daemon");
  ASSERT_EQ(talker.Line(), "ready");
  EXPECT_EQ(Received(monitor.get(), kUnits).size(), kUnits) << "of the daemon";
}

TEST_F(DdsSecurity, ForeignAuthoritiesAndTamperedDocumentsAreRefused) {
  const std::string other = folder_ / "other";
  ASSERT_EQ(std::system((std::string(MAKE_KEYS) + " " + other + " --domain " +
                         std::to_string(OwnDomain()) + " > /dev/null")
                            .c_str()),
            0);
  const auto made = [](const std::string& folder) {
    const auto domain = dds_internal::Domain::Acquire(OwnDomain(), "");
    return static_cast<bool>(dds_internal::MakeParticipant(OwnDomain(), folder));
  };
  ASSERT_TRUE(made(Keys("monitor")));
  const auto copy = [&](const std::string& what) {
    std::system(("rm -rf " + (folder_ / "odd") + " && cp -r " + Keys("monitor") + " " +
                 (folder_ / "odd") + " && " + what)
                    .c_str());
  };
  copy("cp " + Keys("daemon") + "/permissions.p7s " + (folder_ / "odd"));
  EXPECT_FALSE(made(folder_ / "odd")) << "permissions of another";
  copy("cp " + other + "/monitor/permissions.p7s " + (folder_ / "odd"));
  EXPECT_FALSE(made(folder_ / "odd")) << "of another authority";
  copy("sed -i 's/unit_status/exposure/' " + (folder_ / "odd/permissions.p7s"));
  EXPECT_FALSE(made(folder_ / "odd")) << "tampered";
  copy("sed -i 's/<rtps_protection_kind>SIGN/<rtps_protection_kind>NONE/' " +
       (folder_ / "odd/governance.p7s"));
  EXPECT_FALSE(made(folder_ / "odd")) << "tampered governance";
  copy("rm " + (folder_ / "odd/key.pem"));
  EXPECT_FALSE(made(folder_ / "odd")) << "no key";
}

TEST_F(DdsSecurity, CredentialsThatHaveEndedAdmitNobody) {
  MakeKeys("--only monitor:monitor", "MAKE_KEYS_SECONDS=-1");
  EXPECT_FALSE(dds_internal::MakeParticipant(OwnDomain(), Keys("monitor")));
  const auto ends = ReadCredentialEnds(Keys("monitor"));
  ASSERT_TRUE(ends) << ends.error().text;
  EXPECT_EQ(ends->front().what, "permissions.p7s");
  EXPECT_LT(ends->front().at_s, WallTime::Now().ns / 1'000'000'000);
  CredentialClock clock;
  EXPECT_EQ(clock.Look(*ends, WallTime::Now())->name, AlarmName::kDdsCredentialsEnded);
}

TEST_F(DdsSecurity, RenewedCredentialsOutliveTheOld) {
  constexpr std::uint32_t kFleet = 5000;
  MakeKeys("--only daemon:daemon", "MAKE_KEYS_SECONDS=20");
  ClientProcess watcher({WATCHER, std::to_string(OwnDomain()), Keys("monitor")});
  RenewingStatusPublisher publisher(
      {.join = {.join =
                    [this] {
                      return StatusPublisher::Create(
                          {.domain = OwnDomain(), .config_xml = {}, .security = Keys("daemon")});
                    }},
       .renews = true});
  StatusBatch all;
  all.units.resize(kFleet);
  for (std::uint32_t n = 0; n < kFleet; ++n) all.units[n].unit = {n + 1};
  std::atomic<bool> ending{false};
  std::jthread flow([&] {
    for (std::int64_t cycle = 0; !ending; ++cycle) {
      for (auto& unit : all.units) unit.at = {cycle};
      publisher.Publish(all);
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  });
  Line line = WaitForUnits(&watcher, kFleet);
  EXPECT_EQ(line.units, kFleet);
  const long before_ms = line.longest_ms;
  MakeKeys("--only daemon:daemon --days 30");
  publisher.Renew();
  for (int n = 0; n < 25; ++n) line = Next(&watcher);
  // The old credentials have ended, and readers get what is new.
  const std::uint64_t at_end = line.samples;
  line = Next(&watcher);
  line = Next(&watcher);
  EXPECT_GT(line.samples, at_end + kFleet);
  std::printf("longest gap %ld ms before, %ld ms with the renewal\n", before_ms, line.longest_ms);
  ending = true;
}

}  // namespace
}  // namespace focalfleet
