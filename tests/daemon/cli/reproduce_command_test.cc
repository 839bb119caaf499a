// reproduce as a process: its files, its statuses, and bad input.
#include <gmock/gmock.h>

#include <set>

#include "daemon/control/messages.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ScratchFolder;
using test::Slurp;
using ::testing::HasSubstr;

TEST(ReproduceCommand, WritesEveryClaimWithItsStatusAndAPage) {
  const ScratchFolder scratch;
  const auto result =
      Focalfleet({"reproduce", "--out", scratch / "claims", "--start-sets", "C", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out);
  const Json claims = Json::parse(Slurp(scratch / "claims/claims.json"));
  EXPECT_EQ(claims, reported["claims"]);
  EXPECT_GT(claims.size(), 40u);
  std::set<std::string> statuses;
  for (const Json& claim : claims) {
    for (const char* key : {"id", "text", "unit", "conditions", "status", "reason"})
      EXPECT_TRUE(claim.at(key).is_string()) << key;
    EXPECT_TRUE(claim.contains("paper") && claim.contains("simulated"));
    statuses.insert(claim["status"]);
  }
  EXPECT_THAT(statuses, ::testing::UnorderedElementsAre("reproduced", "ordering", "fitted",
                                                        "disagrees", "not testable"));
  const std::string page = Slurp(scratch / "claims/report.html");
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_THAT(page, HasSubstr("time for 360 degrees with the critical n"));
}

TEST(ReproduceCommand, RefusesWhatItCannotDo) {
  const ScratchFolder scratch;
  EXPECT_EQ(Focalfleet({"reproduce"}).exit, 2) << "no --out";
  EXPECT_EQ(Focalfleet({"reproduce", "--out", scratch / "x", "--set", "Q"}).exit, 2);
  EXPECT_EQ(Focalfleet({"reproduce", "--out", scratch / "x", "--resistance-factor", "0"}).exit, 2);
  const auto blocked = Focalfleet({"reproduce", "--out", scratch.Put("file", "") + "/x"});
  EXPECT_EQ(blocked.exit, 1);
  EXPECT_THAT(blocked.err, HasSubstr("file/x"));
  EXPECT_THAT(scratch.List(), ::testing::ElementsAre("file"));
}

}  // namespace
}  // namespace focalfleet
