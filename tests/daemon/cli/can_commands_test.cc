// can decode as a process: words, JSON lines, bad lines and pipes.
#include <gmock/gmock.h>

#include <sstream>

#include "daemon/control/messages.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::FocalfleetInto;
using test::ScratchFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<Json> Objects(const std::string& text) {
  std::vector<Json> objects;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) objects.push_back(Json::parse(line));
  return objects;
}

constexpr const char* kLog =
    "(1436509052.249713) vcan0 106152E1#03E80300FFFFFF25\n"
    "(1436509052.249913) vcan1 14A952E0#0501056434120201\n"
    "\n"
    "(1436509052.250000) vcan1 0007F800#\n"
    "(1436509052.250001) vcan1 123#11\n"
    "(1436509052.250002) vcan1 14A952E0#05\n";

TEST(CanDecodeCommand, PutsFramesIntoWords) {
  const ScratchFolder scratch;
  const auto result = Focalfleet({"can", "decode", scratch.Put("bus.log", kLog)});
  EXPECT_EQ(result.exit, 0) << result.err;
  EXPECT_EQ(result.out,
            "1436509052.249713  vcan0   42 <- host  #92   stage_segment  axis phi  index 3  "
            "start_ticks 1000  delta -1  repeat 37\n"
            "1436509052.249913  vcan1   42 -> host  #92   status_reply  state fault  fault "
            "over_temperature  interrupted yes  host_lost no  restarted yes  progress_percent 100  "
            "move 4660  moves_begun 258\n"
            "1436509052.250000  vcan1  all <- host  #0    stop\n"
            "1436509052.250001  vcan1  not ours: an 11-bit identifier\n"
            "1436509052.250002  vcan1  malformed (length): 14A952E0#05\n");
}

TEST(CanDecodeCommand, GivesAnObjectALine) {
  const ScratchFolder scratch;
  const auto result = Focalfleet({"can", "decode", scratch.Put("bus.log", kLog), "--json"});
  EXPECT_EQ(result.exit, 0) << result.err;
  const std::vector<Json> objects = Objects(result.out);
  ASSERT_EQ(objects.size(), 5u);
  EXPECT_EQ(objects[0], Json({{"schema", 1},
                              {"time", "1436509052.249713"},
                              {"interface", "vcan0"},
                              {"id", "106152E1"},
                              {"data", "03E80300FFFFFF25"},
                              {"message", "stage_segment"},
                              {"from", "host"},
                              {"node", 42},
                              {"sequence", 92},
                              {"fields",
                               {{"axis", "phi"},
                                {"index", 3},
                                {"start_ticks", 1000},
                                {"delta", -1},
                                {"repeat", 37}}}}));
  EXPECT_EQ(objects[3]["foreign"], "an 11-bit identifier");
  EXPECT_EQ(objects[4]["malformed"], "length");
}

// The input is the example of docs/protocol.md and the same with a wrong byte.
TEST(CanDecodeCommand, PutsAGroupIntoTheWordsOfItsFrames) {
  const ScratchFolder scratch;
  const std::string log =
      scratch.Put("bus.log",
                  "(1.000000) vcan0 1107F800##107002801020102010709380102FFFFFF\n"
                  "(2.000000) vcan0 1107F800##107002801020102010709F80102FFFFFF\n");
  const auto text = Focalfleet({"can", "decode", log});
  EXPECT_EQ(text.exit, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("1.000000  vcan0    7 <- host  #0    stage_begin"));
  EXPECT_THAT(text.out, HasSubstr("1.000000  vcan0    7 <- host  #9    confirm"));
  EXPECT_THAT(text.out, HasSubstr("2.000000  vcan0  malformed (function): 1107F800##0700"));
  const std::vector<Json> objects = Objects(Focalfleet({"can", "decode", log, "--json"}).out);
  ASSERT_EQ(objects.size(), 3u);
  EXPECT_EQ(objects[0]["message"], "stage_begin");
  EXPECT_EQ(objects[0]["group"], 1);
  EXPECT_EQ(objects[1]["message"], "confirm");
  EXPECT_EQ(objects[1]["group"], 2);
  EXPECT_EQ(objects[2]["malformed"], "function");
}

// The lines are as candump -e -d prints them.
constexpr const char* kErrors =
    "  can0  10501800   [5]  07 00 01 00 00\n"
    "  can0  20000088   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n"
    "\tbus-error\n"
    "\n"
    "Enabling Logfile 'candump-2026-02-01_201500.log'\n"
    "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 4)\n"
    "\033[32m (1.000000)  can1  0007F800   [0] \033[0m\n";

TEST(CanDecodeCommand, TellsErrorFramesInWordsAndFramesThatAreMissing) {
  const ScratchFolder scratch;
  const std::string log = scratch.Put("bus.log", kErrors);
  const auto result = Focalfleet({"can", "decode", log});
  EXPECT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("can0  not ours: an error frame\n"
                                    "can0  error frame: bus-error\n"
                                    "can0  dropped 3 frames (in all 4)\n"
                                    "1.000000  can1  all <- host  #0    stop\n"));
  EXPECT_EQ(result.err, "focalfleet: " + log +
                            ": 3 frames are missing: candump could not keep up\n"
                            "focalfleet: " +
                            log + ": 1 line of candump's own words passed over\n");
  const auto json = Focalfleet({"can", "decode", log, "--json", "--quiet"});
  EXPECT_EQ(json.exit, 0);
  EXPECT_EQ(json.err, "");
  const std::vector<Json> objects = Objects(json.out);
  ASSERT_EQ(objects.size(), 5u);
  EXPECT_EQ(objects[2],
            Json({{"schema", 1}, {"time", ""}, {"interface", "can0"}, {"error", "bus-error"}}));
  EXPECT_EQ(objects[3],
            Json({{"schema", 1}, {"interface", "can0"}, {"dropped", 3}, {"dropped_total", 4}}));
}

TEST(CanDecodeCommand, ACompressedLogIsReportedOnce) {
  const ScratchFolder scratch;
  const std::string log = scratch.Put("bus.log.gz", std::string("\x1f\x8b\x08\0\n\n\n\n", 8));
  for (const bool from_stdin : {false, true}) {
    const auto result = from_stdin ? FocalfleetInto("<" + log, {"can", "decode"})
                                   : Focalfleet({"can", "decode", log});
    EXPECT_EQ(result.exit, 1);
    EXPECT_THAT(result.err, HasSubstr("this is compressed with gzip: unpack it first"));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
}

TEST(CanDecodeCommand, NamesBadLinesAndDecodesTheOthers) {
  const ScratchFolder scratch;
  const std::string log = scratch.Put("bus.log", std::string(kLog) + "hello\n" + kLog + "x y z\n");
  const auto result = Focalfleet({"can", "decode", log});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr(log + ":7: not a line of candump: "));
  EXPECT_THAT(result.err, HasSubstr(log + ":14: not a line of candump: "));
  EXPECT_THAT(result.err, HasSubstr("2 of 14 lines not candump's, first " + log + ":7"));
  EXPECT_EQ(std::count(result.out.begin(), result.out.end(), '\n'), 10);
  const auto json = Focalfleet({"can", "decode", log, "--json"});
  EXPECT_EQ(Objects(json.out).back()["exit"], 1);
  EXPECT_EQ(Objects(json.out).back()["error"]["code"], "invalid");
}

TEST(CanDecodeCommand, ReadsStandardInput) {
  const ScratchFolder scratch;
  const std::string log = scratch.Put("bus.log", "  vcan0  0007F800   [0] \n");
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"can", "decode"}, {"can", "decode", "-"}}) {
    const auto result = FocalfleetInto("<" + log, arguments);
    EXPECT_EQ(result.exit, 0) << result.err;
    EXPECT_EQ(result.out, "vcan0  all <- host  #0    stop\n");
  }
}

TEST(CanDecodeCommand, RefusesAFileThatItCannotRead) {
  const ScratchFolder scratch;
  EXPECT_EQ(Focalfleet({"can"}).exit, 2);
  EXPECT_EQ(Focalfleet({"can", "decode", "a", "b"}).exit, 2);
  const auto missing = Focalfleet({"can", "decode", scratch / "none.log"});
  EXPECT_EQ(missing.exit, 1);
  EXPECT_THAT(missing.err, HasSubstr("none.log: No such file"));
  const auto folder = Focalfleet({"can", "decode", scratch.path()});
  EXPECT_EQ(folder.exit, 1);
  EXPECT_THAT(folder.err, HasSubstr("a directory"));
}

}  // namespace
}  // namespace focalfleet
