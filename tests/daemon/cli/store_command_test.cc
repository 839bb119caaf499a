// store check, backup and restore as processes.
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/control/messages.h"
#include "daemon/store/store.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ProgramResult;
using test::ScratchFolder;
using ::testing::HasSubstr;

TEST(StoreCommands, ABackupIsTakenBesideTheDaemonAndRestoredWhereNoFileIs) {
  const ScratchFolder scratch;
  const std::string path = scratch / "fleet.db";
  const std::string backup = scratch / "backup.db";
  {
    auto store = Store::Open(path);  // as a daemon has it
    ASSERT_TRUE(store);
    ASSERT_TRUE((*store)->Commit(std::vector<Row>{BindingRow{{12}, {7}}}, {5}));
    EXPECT_EQ(Focalfleet({"store", "check", path}).exit, 0);
    const ProgramResult taken = Focalfleet({"store", "backup", path, backup, "--json"});
    EXPECT_EQ(taken.exit, 0) << taken.err;
    EXPECT_EQ(Json::parse(taken.out)["to"], backup);
    const ProgramResult again = Focalfleet({"store", "backup", path, backup});
    EXPECT_EQ(again.exit, 1);
    EXPECT_THAT(again.err, HasSubstr("is there already"));
    EXPECT_EQ(Focalfleet({"store", "restore", backup, path}).exit, 1) << "a daemon has it";
  }
  ASSERT_EQ(::rename(path.c_str(), (path + ".damaged").c_str()), 0);
  const ProgramResult restored = Focalfleet({"store", "restore", backup, path});
  EXPECT_EQ(restored.exit, 0) << restored.err;
  const auto fleet = (*Store::Open(path))->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  EXPECT_EQ(fleet->units.size(), 1u);
}

TEST(StoreCommands, CheckSaysWhatIsWrong) {
  const ScratchFolder scratch;
  const std::string path = scratch.Put("fleet.db", "no store");
  const ProgramResult result = Focalfleet({"store", "check", path});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("not a store"));
}

}  // namespace
}  // namespace focalfleet
