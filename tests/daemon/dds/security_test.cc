// DDS Security end to end: credentials of deploy/dds-security/make-keys, a publisher, readers with
// and without credentials, forgers. A side without credentials is a process of its own: within one
// process DDS does not protect a writer from a reader.
#include <dds/dds.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "daemon/dds/credentials.h"
#include "daemon/dds/cyclone.h"
#include "daemon/dds/status_publisher.h"
#include "daemon/dds/status_reader.h"
#include "daemon/status/renewing_status_publisher.h"
#include "focalfleet.h"  // generated from focalfleet.idl
#include "tests/daemon/dds/client_process.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/daemon/dds/secured_domain.h"

namespace focalfleet {
namespace {

using test::ClientProcess;
using test::OwnDomain;
using ::testing::HasSubstr;

constexpr std::chrono::seconds kPatience(60);  // far above anything that is measured
constexpr std::uint32_t kUnits = 100;

class DdsSecurity : public test::SecuredDomain {
 protected:
  DdsSecurity() { MakeKeys(""); }

  [[nodiscard]] ClientProcess Talker(const std::string& who) const {
    return ClientProcess(
        {TALKER, std::to_string(OwnDomain()), std::to_string(kUnits), "0", Keys(who)});
  }
  static Result<dds_internal::Participant> Join(const std::string& security) {
    return dds_internal::Participant::Join(
        {.domain = OwnDomain(), .config_xml = {}, .security = security});
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
};

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
    const auto participant = Join(Keys(who));
    EXPECT_TRUE(participant) << participant.error().text;
    if (!participant) return false;
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
  // Twice as many units as there are, by somebody without credentials, who came first.
  const ClientProcess forger(
      {TALKER, std::to_string(OwnDomain()), std::to_string(2 * kUnits), "0"});
  ASSERT_EQ(forger.Line(), "ready");
  const ClientProcess talker = Talker("daemon");
  ASSERT_EQ(talker.Line(), "ready");
  // Without credentials there is no handshake, so the forger would have been heard first.
  const std::set<std::uint32_t> units = Received(monitor.get(), kUnits);
  ASSERT_EQ(units.size(), kUnits) << "of the daemon";
  EXPECT_EQ(*units.rbegin(), kUnits);
}

TEST_F(DdsSecurity, ForeignAuthoritiesAndTamperedDocumentsAreRefused) {
  const std::string other = folder_ / "other";
  ASSERT_EQ(std::system((std::string(MAKE_KEYS) + " " + other + " --domain " +
                         std::to_string(OwnDomain()) + " > /dev/null")
                            .c_str()),
            0);
  const auto made = [](const std::string& folder) { return static_cast<bool>(Join(folder)); };
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
  EXPECT_FALSE(Join(Keys("monitor")));
  const auto ends = ReadCredentialEnds(Keys("monitor"));
  ASSERT_TRUE(ends) << ends.error().text;
  EXPECT_EQ(ends->front().what, "permissions.p7s");
  EXPECT_LT(ends->front().at_s, WallTime::Now().ns / 1'000'000'000);
  CredentialClock clock;
  EXPECT_EQ(clock.Look(*ends, WallTime::Now())->name, AlarmName::kDdsCredentialsEnded);
}

// Two participants of one process, each with its own permissions: what one may not, the other may.
TEST_F(DdsSecurity, EachParticipantOfAProcessHasItsOwnPermissions) {
  using namespace dds_internal;
  const auto camera = Join(Keys("camera"));
  const auto daemon = Join(Keys("daemon"));
  ASSERT_TRUE(camera && daemon);
  EXPECT_FALSE(MakeTopic(*camera, focalfleet_UnitStatus_desc, kUnitTopic));
  EXPECT_TRUE(MakeTopic(*daemon, focalfleet_UnitStatus_desc, kUnitTopic));
}

TEST_F(DdsSecurity, ARenewalLeavesNoGapInTheStatusOfAnyUnit) {
  constexpr std::uint32_t kFleet = 5000;
  const auto begun = std::chrono::steady_clock::now();
  MakeKeys("--only daemon:daemon");
  // A loaded machine needs more time for all that comes before the end.
  const auto once = std::chrono::steady_clock::now() - begun;
  const std::int64_t lasts_s = 10 + std::chrono::ceil<std::chrono::seconds>(4 * once).count();
  MakeKeys("--only daemon:daemon", "MAKE_KEYS_SECONDS=" + std::to_string(lasts_s));
  const WallTime end{ReadCredentialEnds(Keys("daemon")).value().front().at_s * 1'000'000'000};
  int joined = 0;
  RenewingStatusPublisher publisher(
      {.join = {.join =
                    [&] {
                      ++joined;
                      return StatusPublisher::Create(
                          {.domain = OwnDomain(), .config_xml = {}, .security = Keys("daemon")});
                    }},
       .renews = true});
  const auto monitor = Reader(Keys("monitor"));
  StatusBatch all;
  all.units.resize(kFleet);
  for (std::uint32_t n = 0; n < kFleet; ++n) all.units[n].unit = {n + 1};
  std::vector<std::int64_t> newest(kFleet + 1);  // value of each unit
  std::int64_t cycle = 0, cycles_beside = 0, alone = 0, received = 0;
  const auto publish_and_receive = [&] {
    ++cycle;
    for (auto& unit : all.units) unit.at = {cycle};
    const auto next = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
    publisher.Publish(all);
    std::size_t there = 0;
    StatusUpdate update;
    while (there < kFleet && std::chrono::steady_clock::now() < next + kPatience) {
      EXPECT_TRUE(monitor->Wait(std::chrono::milliseconds(100)) && monitor->Take(&update));
      alone += monitor->writer_seen() && !monitor->writer_alive() ? 1 : 0;
      for (const auto& unit : update.units) {
        ++received;
        if (unit.at.ns == cycle && newest[unit.unit.value] < cycle) ++there;
        newest[unit.unit.value] = std::max(newest[unit.unit.value], unit.at.ns);
      }
    }
    std::this_thread::sleep_until(next);
    return there;
  };
  ASSERT_EQ(publish_and_receive(), kFleet);
  MakeKeys("--only daemon:daemon --days 30");
  ASSERT_LT(WallTime::Now().ns, end.ns)
      << "this machine is too slow for credentials that end in " << lasts_s << " s";
  publisher.Renew(end);
  for (; WallTime::Now().ns < end.ns + 5'000'000'000; cycles_beside += joined == 2 ? 1 : 0)
    ASSERT_EQ(publish_and_receive(), kFleet) << "cycle " << cycle;
  std::printf(
      "%ld cycles of %u units, %ld of them since the renewal: each arrived, %ld samples in "
      "all\n",
      cycle, kFleet, cycles_beside, received);
  EXPECT_EQ(joined, 2);
  EXPECT_EQ(alone, 0) << "looks at which no publisher was there";
}

}  // namespace
}  // namespace focalfleet
