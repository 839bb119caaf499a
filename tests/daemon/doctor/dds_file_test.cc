#include "daemon/doctor/dds_file.h"

#include <gtest/gtest.h>

#include "daemon/dds/loopback_config.h"

namespace focalfleet::doctor {
namespace {

TEST(DdsFile, TheInstalledOneStaysOnTheLoopbackInterface) {
  const DdsNeeds needs = NeedsOf(kLoopbackConfig);
  ASSERT_EQ(needs.interfaces.size(), 1u);
  EXPECT_EQ(needs.interfaces[0].name, "lo");
  EXPECT_FALSE(needs.multicast);
  EXPECT_EQ(needs.buffer_bytes, std::uint64_t{4} << 20);
  EXPECT_EQ(needs.participants, 120u);
}

TEST(DdsFile, ReadsNamesAddressesAndSizes) {
  const DdsNeeds needs = NeedsOf(R"(<CycloneDDS><Domain>
    <General><Interfaces>
      <!-- <NetworkInterface name="old0"/> -->
      <NetworkInterface address='10.0.0.5' priority="1"/>
      <NetworkInterface
          name="eth1" />
    </Interfaces></General>
    <Discovery><MaxAutoParticipantIndex> 40 </MaxAutoParticipantIndex></Discovery>
    <Internal><SocketReceiveBufferSize min="10 MB"/></Internal></Domain></CycloneDDS>)");
  ASSERT_EQ(needs.interfaces.size(), 2u);
  EXPECT_EQ(needs.interfaces[0].address, "10.0.0.5");
  EXPECT_EQ(needs.interfaces[1].name, "eth1");
  EXPECT_TRUE(needs.multicast);
  EXPECT_EQ(needs.buffer_bytes, std::uint64_t{10} << 20);
  EXPECT_EQ(needs.participants, 41u);
}

TEST(DdsFile, OtherTextGivesTheDefaults) {
  for (const char* text :
       {"", "<", "<!--", "<NetworkInterface", "<NetworkInterface name=",
        "<NetworkInterface name=\"", "<SocketReceiveBufferSize max=\"99999999999999999999MB\"/>",
        "<AllowMulticast>", "<MaxAutoParticipantIndex>many</MaxAutoParticipantIndex>",
        "<NetworkInterfaces name=\"x\"/>", "<SocketReceiveBufferSize max=\"4\"/>"}) {
    const DdsNeeds needs = NeedsOf(text);
    EXPECT_TRUE(needs.multicast) << text;
    EXPECT_FALSE(needs.buffer_bytes) << text;
    EXPECT_EQ(needs.participants, 10u) << text;
  }
}

}  // namespace
}  // namespace focalfleet::doctor
