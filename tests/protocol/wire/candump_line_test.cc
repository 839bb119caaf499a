#include "protocol/wire/candump_line.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace focalfleet {
namespace {

CanFrame Frame(std::uint32_t id, const std::vector<std::uint8_t>& data) {
  CanFrame frame{id, static_cast<std::uint8_t>(data.size()), {}};
  std::copy(data.begin(), data.end(), frame.data.begin());
  return frame;
}

// The lines are as candump 2020.11 printed them.
TEST(CandumpLine, ReadsBothFormsOfCandump) {
  struct Case {
    const char* line;
    const char* time;
    CanFrame frame;
  };
  const std::vector<Case> cases = {
      {"(1436509052.249713) vcan0 14A952E0#0501056434120201", "1436509052.249713",
       Frame(0x14A952E0, {5, 1, 5, 100, 0x34, 0x12, 2, 1})},
      {"(1436509052.249713) vcan0 00002A00#", "1436509052.249713", Frame(0x2A00, {})},
      {"  vcan0  00002A00   [0] ", "", Frame(0x2A00, {})},
      {"  vcan0  04007F80   [5]  01 00 E8 03 00", "", Frame(0x04007F80, {1, 0, 0xE8, 3, 0})},
      {" (000.000123)  vcan0  04007F80   [2]  01 AB", "000.000123", Frame(0x04007F80, {1, 0xAB})},
      {" (2026-02-01 20:15:00.000001)  vcan0  04007F80   [1]  01", "2026-02-01 20:15:00.000001",
       Frame(0x04007F80, {1})},
      {"  vcan0  TX - -  04007F80   [2]  41 42   'AB'", "", Frame(0x04007F80, {0x41, 0x42})},
      {"  vcan0  RX B E  04007F80   [1]  41\r", "", Frame(0x04007F80, {0x41})},
      {"  vcan0  04007F80   [3]  41 20 60   'A `'", "", Frame(0x04007F80, {0x41, 0x20, 0x60})},
      // Options -S, -i and both, with the letters of -a.
      {"  vcan0  04007F80   [3]  03`02`01", "", Frame(0x04007F80, {1, 2, 3})},
      {"  vcan0  04007F80   [3]  43`42`41                `CBA`", "",
       Frame(0x04007F80, {0x41, 0x42, 0x43})},
      {"  vcan0  04007F80   [1]  41                      `A`", "", Frame(0x04007F80, {0x41})},
      {"  vcan0  04007F80   [2]  00000001 10101011", "", Frame(0x04007F80, {1, 0xAB})},
      {"  vcan0  04007F80   [2]  10101011`00000001", "", Frame(0x04007F80, {1, 0xAB})},
      // Option -8: eight bytes with another length code.
      {"  vcan0  04007F80   {B}  01 02 03 04 05 06 07 08", "",
       Frame(0x04007F80, {1, 2, 3, 4, 5, 6, 7, 8})},
      {"(1.000000) vcan0 04007F80#0102030405060708_B", "1.000000",
       Frame(0x04007F80, {1, 2, 3, 4, 5, 6, 7, 8})},
      {"(1.000000) vcan0 04007F80#0102 T", "1.000000", Frame(0x04007F80, {1, 2})},
      {" (1436509052.249713000)  vcan0  04007F80   [1]  01", "1436509052.249713000",
       Frame(0x04007F80, {1})},
  };
  for (const Case& c : cases) {
    const auto line = ParseCandumpLine(c.line);
    ASSERT_TRUE(line) << c.line << ": " << line.error();
    EXPECT_EQ(line->time, c.time) << c.line;
    EXPECT_EQ(line->interface, "vcan0") << c.line;
    EXPECT_EQ(line->foreign, nullptr) << c.line;
    EXPECT_EQ(line->frame, c.frame) << c.line;
  }
}

TEST(CandumpLine, ReadsAGroupWithAsManyBytesAsItHas) {
  for (const char* text : {"(1.000000) vcan0 1107F800##1070028010201020107093801",
                           "  vcan0  1107F800  [12]  07 00 28 01 02 01 02 01 07 09 38 01"}) {
    const auto line = ParseCandumpLine(text);
    ASSERT_TRUE(line) << text << ": " << line.error();
    EXPECT_EQ(line->foreign, nullptr);
    EXPECT_EQ(line->frame, CanFrame{});
    const FdFrame expected{
        .id = kGroupId, .length = 12, .data = {7, 0, 0x28, 1, 2, 1, 2, 1, 7, 9, 0x38, 1}};
    EXPECT_EQ(line->group, expected);
  }
  EXPECT_FALSE(ParseCandumpLine("(1.0) vcan0 1107F800##10G"));
  EXPECT_FALSE(ParseCandumpLine("(1.0) vcan0 1107F800##1" + std::string(130, '0')));
  EXPECT_FALSE(ParseCandumpLine("vcan0 1107F800 [12] 07 00"));
  const auto classic = ParseCandumpLine("(1.0) vcan0 1107F800#00");
  ASSERT_TRUE(classic);
  EXPECT_FALSE(classic->group) << "a classic frame is none, whatever its identifier";
}

TEST(CandumpLine, TellsForeignFramesApart) {
  for (const char* text :
       {"(1.000000) vcan0 123#11", "(1.000000) vcan0 14A952E0#R", "(1.000000) vcan0 14A952E0##1AB",
        "(1.000000) vcan0 20000080#0000000000000000", "  vcan0  123   [1]  11",
        "  vcan0  14A952E0  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B",
        "  vcan0  14A952E0   [0]  remote request",
        "  vcan0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME",
        "  vcan0       123   [2]  11 22", "(1.000000) vcan0 14A952E0#R8_9",
        "(1.000000) vcan0 14A952E0##5AB", "(1.000000) vcan0 20000004#0010000000006000",
        "  vcan0  RX - -  14A952E0  [02]  00 01", "  vcan0  14A952E0  [03]  02`01`00",
        "  vcan0       123 [0003] (45|81:00:12345678) 11 22 33",
        "(1.000000) vcan0 45123#81:00:12345678#11223344.556677"}) {
    const auto line = ParseCandumpLine(text);
    ASSERT_TRUE(line) << text << ": " << line.error();
    EXPECT_NE(line->foreign, nullptr) << text;
  }
}

TEST(CandumpLine, RefusesWhatCandumpDoesNotWrite) {
  for (const char* text : {"",
                           " ",
                           "vcan0",
                           "(1.0 vcan0 14A952E0#",
                           "(1.0) vcan0",
                           "(1.0) vcan0 14A952E#",
                           "(1.0) vcan0 14A952E0#0",
                           "(1.0) vcan0 14A952E0#0G",
                           "(1.0) vcan0 14A952E0#001122334455667788",
                           "(1.0) vcan0 C4A952E0#",
                           "vcan0 14A952E0",
                           "vcan0 14A952E0 [",
                           "vcan0 14A952E0 [x] 00",
                           "vcan0 14A952E0 [9] 00",
                           "vcan0 14A952E0 [2] 00",
                           "vcan0 14A952E0 [2] 00 1",
                           "vcan0 hello [2] 00 11",
                           "vcan0 14A952E0 [2] 00`",
                           "vcan0 14A952E0 [1] 0000000",
                           "vcan0 14A952E0 [1] 00000002",
                           "vcan0 14A952E0 {G} 01 02 03 04 05 06 07 08",
                           "vcan0 14A952E0 [001] 00",
                           "(1.0) vcan0 14A952E0#01_9",
                           "(1.0) vcan0 45123#8100",
                           "() vcan0 14A952E0#"}) {
    EXPECT_FALSE(ParseCandumpLine(text)) << text;
  }
}

TEST(CandumpNote, ReadsWhatCandumpSaysBesideFrames) {
  using Kind = CandumpNote::Kind;
  for (const char* words :
       {"bus-error", "lost-arbitration{at bit 3}", "controller-problem{rx-overflow,tx-overflow}",
        "protocol-violation{{single-bit-error}{acknowledge-slot}}", "no-acknowledgement-on-tx",
        "restarted-after-bus-off", "error-counter-tx-rx{{96}{0}}"}) {
    const std::string line = "\t" + std::string(words);
    const auto note = ParseCandumpNote(line);
    ASSERT_TRUE(note) << words;
    EXPECT_EQ(note->kind, Kind::kErrorWords);
    EXPECT_EQ(note->text, words);
  }
  for (const auto& [line, dropped] :
       {std::pair("DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 7)", 1),
        {"DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 7)", 3}}) {
    const auto note = ParseCandumpNote(line);
    ASSERT_TRUE(note) << line;
    EXPECT_EQ(note->kind, Kind::kDropped);
    EXPECT_EQ(note->interface, "can0");
    EXPECT_EQ(note->dropped, dropped);
    EXPECT_EQ(note->dropped_total, 7);
  }
  for (const char* line : {"Enabling Logfile 'candump-2026-02-01_201500.log'",
                           "Disabled standard output while logging.", "can0: interface down",
                           "Warning: console output active while logging!", "read: Network is down",
                           "The socket receive buffer size was adjusted due to "
                           "/proc/sys/net/core/rmem_max.",
                           "Error class 0x20000 is invalid\r"}) {
    const auto note = ParseCandumpNote(line);
    ASSERT_TRUE(note) << line;
    EXPECT_EQ(note->kind, Kind::kOther);
  }
  for (const char* line : {"", "\t", "\t11 22", "  can0  123   [1]  11", "(1.0) can0 123#11",
                           "DROPCOUNT: dropped x CAN frames on 'can0' socket (total drops 7)",
                           "DROPCOUNT: dropped 3 CAN frames", "hello"})
    EXPECT_FALSE(ParseCandumpNote(line)) << line;
}

TEST(CandumpLine, ColoursAndMovingSignsAreNoPartOfIt) {
  EXPECT_EQ(WithoutDecoration(" \033[31m (000.000000)  can0  04007F80   [1]  01\033[0m"),
            "  (000.000000)  can0  04007F80   [1]  01");
  EXPECT_EQ(WithoutDecoration("|\b/\b-\bDROPCOUNT: x"), "DROPCOUNT: x");
  EXPECT_EQ(WithoutDecoration("Warning: console output active while logging!  can0  123   [1]  11"),
            "  can0  123   [1]  11");
  EXPECT_EQ(WithoutDecoration("Warning: console output active while logging!"),
            "Warning: console output active while logging!");
  for (const char* text : {"", "\033", "\033[", "\033[1", "\b", "a\b\b"})
    EXPECT_LT(WithoutDecoration(text).size(), 2u) << "no more than there was";
}

}  // namespace
}  // namespace focalfleet
