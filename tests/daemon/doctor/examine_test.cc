#include "daemon/doctor/examine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "tests/daemon/doctor/well_machine.h"

namespace focalfleet::doctor {
namespace {

using test::Find;
using test::WellMachine;
using ::testing::HasSubstr;

TEST(Examine, FindsNothingWrongOnAWellMachine) {
  const std::vector<Check> checks = Examine(WellMachine());
  std::set<std::string> names;
  for (const Check& check : checks) {
    EXPECT_EQ(check.verdict, Verdict::kOk) << check.name << ": " << check.text;
    EXPECT_EQ(check.todo, "") << check.name;
    EXPECT_FALSE(check.text.empty()) << check.name;
    EXPECT_TRUE(names.insert(check.name).second) << check.name << " stands twice";
  }
  EXPECT_EQ(Worst(checks), Verdict::kOk);
  for (const char* name : {"configuration",
                           "daemon",
                           "version",
                           "alarms",
                           "units",
                           "buses",
                           "senders",
                           "af_can",
                           "interface can0",
                           "interface can1",
                           "store folder",
                           "camera folder",
                           "gpio",
                           "disk /var/lib/focalfleet",
                           "disk /srv/camera",
                           "store",
                           "dds",
                           "dds participants",
                           "dds interface",
                           "dds buffers",
                           "clock",
                           "open files"})
    EXPECT_TRUE(names.contains(name)) << name;
}

/// A fault of a machine, and its check.
struct Ailment {
  const char* what;
  std::function<void(Facts*)> make_wrong;
  const char* check;
  Verdict verdict;
  const char* text;  // a part of what is found
  const char* todo;  // a part of what to type
};

void ExpectDiagnosed(const std::vector<Ailment>& ailments) {
  for (const Ailment& ailment : ailments) {
    SCOPED_TRACE(ailment.what);
    Facts facts = WellMachine();
    ailment.make_wrong(&facts);
    facts.daemon.status = Json::parse(facts.daemon.status.dump());  // as it comes from a daemon
    const Check check = Find(facts, ailment.check);
    EXPECT_EQ(check.verdict, ailment.verdict) << check.text;
    EXPECT_THAT(check.text, HasSubstr(ailment.text));
    EXPECT_THAT(check.todo, HasSubstr(ailment.todo));
    for (const Check& other : Examine(facts))
      EXPECT_EQ(other.verdict == Verdict::kOk, other.todo.empty()) << other.name;
  }
}

CanLink& LinkOf(Facts* facts) { return *facts->interfaces[1].link; }

TEST(Examine, DiagnosesBuses) {
  ExpectDiagnosed({
      {"no AF_CAN", [](Facts* f) { f->host.af_can_error = EAFNOSUPPORT; }, "af_can", Verdict::kFail,
       "not supported", "modprobe can"},
      {"missing",
       [](Facts* f) {
         f->interfaces[1].link = tl::unexpected(
             Error{ErrorCode::kUnavailable, "no CAN interface 'can1': No such device"});
       },
       "interface can1", Verdict::kFail, "No such device", "plug in"},
      {"down", [](Facts* f) { LinkOf(f).up = false; }, "interface can1", Verdict::kFail, "down",
       "ip link set can1 up"},
      {"bit rate", [](Facts* f) { LinkOf(f).bit_rate_bps = 500'000; }, "interface can1",
       Verdict::kFail, "500000", "type can bitrate 1000000"},
      {"no CAN FD", [](Facts* f) { f->config->bus.can_fd = true; }, "interface can1",
       Verdict::kFail, "no CAN FD", "dbitrate 2000000 fd on"},
      {"data bit rate",
       [](Facts* f) {
         f->config->bus.can_fd = true;
         LinkOf(f).mtu = 72;
         LinkOf(f).data_bit_rate_bps = 4'000'000;
       },
       "interface can1", Verdict::kFail, "4000000", "dbitrate 2000000"},
      {"bus-off", [](Facts* f) { LinkOf(f).state = ControllerState::kBusOff; }, "interface can1",
       Verdict::kFail, "bus-off", "termination"},
      {"warning", [](Facts* f) { LinkOf(f).state = ControllerState::kWarning; }, "interface can1",
       Verdict::kWarn, "errors", "termination"},
      {"restart-ms", [](Facts* f) { LinkOf(f).restart_ms = 0; }, "interface can1", Verdict::kWarn,
       "restart-ms is 0", "restart-ms 100"},
      {"queue", [](Facts* f) { LinkOf(f).queue_frames = 2; }, "interface can1", Verdict::kWarn,
       "2 frames", "txqueuelen 10"},
  });
}

TEST(Examine, ADaemonThatRestartsControllersNeedsNoRestartOfTheKernel) {
  Facts facts = WellMachine();
  facts.interfaces[1].link->restart_ms = 0;
  facts.daemon.process->may_configure_network = true;
  EXPECT_EQ(Find(facts, "interface can1").verdict, Verdict::kOk);
}

TEST(Examine, AVirtualInterfaceHasNoTiming) {
  Facts facts = WellMachine();
  facts.interfaces[1].link->kind = "vcan";
  facts.interfaces[1].link->bit_rate_bps = facts.interfaces[1].link->restart_ms = 0;
  facts.interfaces[1].link->state.reset();
  EXPECT_EQ(Find(facts, "interface can1").verdict, Verdict::kOk);
}

TEST(Examine, OtherPortsNeedNoCan) {
  Facts facts = WellMachine();
  facts.config->bus.port = PortKind::kUnix;
  facts.interfaces.clear();
  facts.bus_sockets_folder = {test::Folder("/run/sim", 1, 1, 0755)};
  facts.host.af_can_error = EAFNOSUPPORT;
  EXPECT_EQ(Worst(Examine(facts)), Verdict::kOk);
  facts.bus_sockets_folder[0].trouble = "No such file";
  EXPECT_THAT(Find(facts, "bus sockets").todo, HasSubstr("focalfleet-sim"));
}

TEST(Examine, DiagnosesTheDaemon) {
  const auto silent = [](Facts* f, int error, const char* why) {
    f->daemon.connect_error = error;
    f->daemon.silence = why;
    f->daemon.status = Json();
    f->daemon.process.reset();
  };
  ExpectDiagnosed({
      {"not running", [&](Facts* f) { silent(f, ENOENT, "nobody"); }, "daemon", Verdict::kFail,
       "No such file", "systemctl start focalfleetd"},
      {"no right to the socket", [&](Facts* f) { silent(f, EACCES, "no"); }, "daemon",
       Verdict::kFail, "may not be used by anna", "usermod --append"},
      {"hangs", [&](Facts* f) { silent(f, 0, "no answer for 3 s"); }, "daemon", Verdict::kFail,
       "no answer for 3 s", "focalfleet stop --direct"},
      {"other version", [](Facts* f) { f->daemon.status["version"] = "1.2.2"; }, "version",
       Verdict::kWarn, "the daemon is 1.2.2, the command line 1.2.3", "systemctl restart"},
      {"alarms",
       [](Facts* f) {
         f->daemon.status["alarms"] = {{"open", 3}, {"worst", "warning"}};
       },
       "alarms", Verdict::kWarn, "3 open", "focalfleet alarms"},
      {"errors",
       [](Facts* f) {
         f->daemon.status["alarms"] = {{"open", 1}, {"worst", "error"}};
       },
       "alarms", Verdict::kFail, "worst: error", "focalfleet alarms"},
      {"silent units", [](Facts* f) { f->daemon.status["phases"]["absent"] = 7; }, "units",
       Verdict::kWarn, "without an answer: 7", "focalfleet status"},
      {"bus down",
       [](Facts* f) {
         f->daemon.status["buses"][1]["link"] = "down";
         f->daemon.status["buses"][1]["trouble"] = "gone\x1b[2J";
       },
       "buses", Verdict::kFail, "1 (gone\\x1b[2J)", "status --buses"},
      {"others send", [](Facts* f) { f->daemon.status["buses"][1]["malformed"] = 5; }, "senders",
       Verdict::kWarn, "5 frames of other senders, on bus 1", "can decode"},
  });
}

TEST(Examine, AnAnswerOfAnyShapeIsTaken) {
  for (const char* text :
       {"null", "[]", "7", "{}", R"({"version":5,"buses":{},"alarms":[],"dds":3})",
        R"({"buses":[1,null],"phases":[],"alarms":{"open":-1}})"}) {
    Facts facts = WellMachine();
    facts.daemon.status = Json::parse(text);
    EXPECT_FALSE(Examine(facts).empty()) << text;
  }
}

TEST(Examine, DiagnosesFiles) {
  ExpectDiagnosed({
      {"configuration",
       [](Facts* f) {
         f->config = tl::unexpected(Error{ErrorCode::kInvalid, "f.toml:3: odd"});
       },
       "configuration", Verdict::kFail, "f.toml:3: odd",
       "focalfleetd --config /etc/focalfleet/focalfleet.toml --check"},
      {"units",
       [](Facts* f) {
         f->buses = tl::unexpected(Error{ErrorCode::kInvalid, "units.csv:9"});
       },
       "configuration", Verdict::kFail, "units.csv:9", "fleet.units"},
      {"interfaces", [](Facts* f) { f->buses = 3; }, "configuration", Verdict::kFail,
       "names 2 interfaces", "one interface a bus"},
      {"store folder missing", [](Facts* f) { f->store_folder.trouble = "No such file"; },
       "store folder", Verdict::kFail, "No such file", "install --directory --owner=focalfleet"},
      {"store folder of root", [](Facts* f) { f->store_folder.uid = f->store_folder.gid = 0; },
       "store folder", Verdict::kFail, "may not write", "chown focalfleet /var/lib/focalfleet"},
      {"camera folder without group", [](Facts* f) { f->camera_folder->mode = S_IFDIR | 0755; },
       "camera folder", Verdict::kFail, "group991, mode 0755", "chown"},
      {"gpio without group", [](Facts* f) { f->gpio_chip->gid = 5; }, "gpio", Verdict::kFail,
       "may not use", "usermod --append --groups gpio focalfleet"},
      {"gpio is a file", [](Facts* f) { f->gpio_chip->mode = S_IFREG | 0666; }, "gpio",
       Verdict::kFail, "no device", "gpiodetect"},
      {"disk nearly full", [](Facts* f) { f->disks[0].free_bytes = 5'000'000'000; },
       "disk /var/lib/focalfleet", Verdict::kWarn, "5.0 GB free", "df -h"},
      {"disk full", [](Facts* f) { f->disks[1].free_bytes = 1'000'000; }, "disk /srv/camera",
       Verdict::kFail, "1.0 MB free", "df -h"},
      {"inodes", [](Facts* f) { f->disks[0].free_inodes = 12; }, "disk /var/lib/focalfleet",
       Verdict::kFail, "12 inodes", "df -i"},
  });
}

TEST(Examine, DiagnosesTheStore) {
  const auto error = [](ErrorCode code) {
    return Result<StoreHealth>(tl::unexpected(Error{code, "the reason"}));
  };
  ExpectDiagnosed({
      {"none yet", [](Facts* f) { f->store.reset(); }, "store", Verdict::kWarn, "does not exist",
       "first start"},
      {"damaged", [](Facts* f) { (*f->store)->flaw = "row 3 missing"; }, "store", Verdict::kFail,
       "row 3 missing", "backup"},
      {"older", [](Facts* f) { (*f->store)->version = 5; }, "store", Verdict::kWarn,
       "expects version 7", "systemctl restart"},
      {"large", [](Facts* f) { (*f->store)->bytes = 200'000'000'000; }, "store", Verdict::kWarn,
       "no room", "larger disk"},
      {"newer", [&](Facts* f) { f->store = error(ErrorCode::kNewer); }, "store", Verdict::kFail,
       "the reason", "install the version"},
      {"no store", [&](Facts* f) { f->store = error(ErrorCode::kInvalid); }, "store",
       Verdict::kFail, "the reason", "store.path"},
      {"not readable", [&](Facts* f) { f->store = error(ErrorCode::kUnavailable); }, "store",
       Verdict::kWarn, "the reason", "sudo -u focalfleet focalfleet doctor"},
  });
}

TEST(Examine, DiagnosesDds) {
  ExpectDiagnosed({
      {"participants",
       [](Facts* f) {
         for (std::uint16_t p = 7410; p < 7650; ++p) f->host.udp_ports.insert(p);
       },
       "dds participants", Verdict::kFail, "120 of 120", "ss -ulnp"},
      {"few left",
       [](Facts* f) {
         for (std::uint16_t p = 7410; p < 7640; ++p) f->host.udp_ports.insert(p);
       },
       "dds participants", Verdict::kWarn, "115 of 120", "MaxAutoParticipantIndex"},
      {"no interface",
       [](Facts* f) {
         f->dds->interfaces = {{"eth7", ""}};
       },
       "dds interface", Verdict::kFail, "no interface eth7", "ip address"},
      {"no such address",
       [](Facts* f) {
         f->dds->interfaces = {{"", "10.0.0.9"}};
       },
       "dds interface", Verdict::kFail, "no interface 10.0.0.9", "ip address"},
      {"down", [](Facts* f) { f->host.interfaces[0].up = false; }, "dds interface", Verdict::kFail,
       "lo is down", "ip link set lo up"},
      {"multicast", [](Facts* f) { f->dds->multicast = true; }, "dds interface", Verdict::kFail,
       "no multicast", "ip link set lo multicast on"},
      {"rmem", [](Facts* f) { f->host.receive_buffer_max = 212'992; }, "dds buffers",
       Verdict::kWarn, "212992", "sysctl -w net.core.rmem_max=4194304"},
      {"missing", [](Facts* f) { f->daemon.status["dds"]["trouble"] = "no port"; }, "dds",
       Verdict::kFail, "no port", "dds checks"},
      {"file",
       [](Facts* f) {
         f->dds = tl::unexpected(Error{ErrorCode::kUnavailable, "no file"});
       },
       "dds", Verdict::kFail, "no file", "dds.config"},
  });
  Facts off = WellMachine();
  off.config->dds.enabled = false;
  off.host.receive_buffer_max = 1;
  EXPECT_EQ(Find(off, "dds").verdict, Verdict::kOk);
  EXPECT_EQ(Find(off, "dds buffers").name, "");
}

TEST(Examine, PortsOfAnotherDomainAreNotCounted) {
  Facts facts = WellMachine();
  facts.config->dds.domain = 1;
  EXPECT_THAT(Find(facts, "dds participants").text, HasSubstr("0 of 120"));
  facts.host.udp_ports = {7660};
  EXPECT_THAT(Find(facts, "dds participants").text, HasSubstr("1 of 120"));
}

TEST(Examine, DiagnosesTheHost) {
  ExpectDiagnosed({
      {"clock", [](Facts* f) { f->host.clock_synchronised = false; }, "clock", Verdict::kWarn,
       "nothing synchronises", "chrony"},
      {"open files", [](Facts* f) { f->daemon.process->open_files_max = 100; }, "open files",
       Verdict::kFail, "the daemon may have 100", "LimitNOFILE=148"},
      {"open files of the shell",
       [](Facts* f) {
         f->daemon.process.reset();
         f->host.open_files_max = 64;
       },
       "open files", Verdict::kFail, "this shell may have 64", "ulimit -n 148"},
  });
}

}  // namespace
}  // namespace focalfleet::doctor
