#include "protocol/wire/identifier.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "protocol/wire/can_frame.h"
#include "protocol/wire/codec.h"
#include "tests/protocol/random_messages.h"

namespace focalfleet {
namespace {

TEST(Identifier, TableNumbersEqualTheirIndex) {
  std::set<std::string> names;
  for (std::uint32_t i = 0; i < kFunctionCount; ++i) {
    EXPECT_EQ(static_cast<std::uint32_t>(kFunctions[i].function), i);
    EXPECT_LT(kFunctions[i].priority, 8) << "three bits";
    EXPECT_TRUE(names.insert(kFunctions[i].name).second);
    EXPECT_STREQ(Name(kFunctions[i].function), kFunctions[i].name);
  }
}

// Firmware in the field is built on these numbers, so they must not change.
TEST(Identifier, PrioritiesAreAsDocumented) {
  const int priorities[kFunctionCount] = {0, 1, 2, 2, 3, 4, 4, 4, 4, 5, 5, 5, 5, 6, 6, 6, 4, 5};
  for (std::uint32_t i = 0; i < kFunctionCount; ++i)
    EXPECT_EQ(kFunctions[i].priority, priorities[i]) << kFunctions[i].name;
}

// docs/adr/0009 reserves these functions for a boot loader.
TEST(Identifier, ThoseForUpdatesOfFirmwareAreFree) {
  for (const FunctionRow& row : kFunctions) {
    EXPECT_LT(row.priority, 7) << row.name;
    EXPECT_LT(static_cast<int>(row.function), 56) << row.name;
  }
  EXPECT_NE(kProtocolVersion, 0);
}

TEST(Identifier, FieldsStandWhereTheHeaderSays) {
  const auto bits = [](std::uint32_t value, int count) {
    std::string text;
    for (int i = count - 1; i >= 0; --i) text += (value >> i & 1) != 0 ? '1' : '0';
    return text;
  };
  for (std::uint32_t function = 0; function < kFunctionCount; ++function) {
    for (const bool from_unit : {false, true}) {
      for (const unsigned node : {0u, 1u, 0x5Au, 127u, 255u}) {
        for (const unsigned sequence : {0u, 1u, 0xA5u, 255u}) {
          for (std::uint8_t detail = 0; detail < 8; ++detail) {
            const Address address{{static_cast<std::uint8_t>(node)},
                                  static_cast<std::uint8_t>(sequence)};
            const std::uint32_t id =
                Pack({static_cast<Function>(function), from_unit, address, detail});
            EXPECT_EQ(bits(id, 32), "000" + bits(kFunctions[function].priority, 3) +
                                        bits(function, 6) + (from_unit ? "1" : "0") +
                                        bits(node, 8) + bits(sequence, 8) + bits(detail, 3));
          }
        }
      }
    }
  }
}

TEST(Identifier, ABroadcastStopWinsAgainstAllButStopsOfSingleUnits) {
  const std::uint32_t stop = Encode(HostMessage{Stop{}}, {kBroadcastNode, 255}).id;
  Rng rng(1);
  for (int i = 0; i < 5000; ++i) {
    const auto host = test::RandomHost(rng);
    if (!std::holds_alternative<Stop>(host)) {
      EXPECT_LT(stop, Encode(host, {{0}, 0}).id);
    }
    EXPECT_LT(stop, Encode(test::RandomUnit(rng), {{0}, 0}).id);
  }
}

// A controller may send its lowest waiting identifier first, in whatever order the frames came.
TEST(Identifier, AnUploadsFramesKeepTheirOrderUnderArbitration) {
  for (unsigned i = 0; i < 256; ++i) {
    const Address first{{9}, static_cast<std::uint8_t>(i)};
    const Address next{{9}, static_cast<std::uint8_t>(i + 1)};  // after 255 follows 0
    const std::uint32_t begin = Encode(HostMessage{StageBegin{{1}, {}, {}}}, first).id;
    const std::uint32_t segment = Encode(HostMessage{StageSegment{}}, next).id;
    EXPECT_LT(begin, segment);
    EXPECT_LT(segment, Encode(HostMessage{Confirm{{1}}}, first).id);
  }
}

TEST(Identifier, DetailNeverLeaksIntoTheSequenceNumber) {
  EXPECT_EQ(Pack({Function::kStop, false, {{0}, 0}, 0xFF}), 7u);
}

}  // namespace
}  // namespace focalfleet
