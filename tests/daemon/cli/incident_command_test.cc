// incident as a process, beside no daemon: a dead one is the common case.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <string>

#include "daemon/control/messages.h"
#include "daemon/store/store.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ProgramResult;
using test::RunProgram;
using test::ScratchFolder;
using ::testing::HasSubstr;
using ::testing::Not;

class Incident : public ::testing::Test {
 protected:
  Incident() {
    scratch_.Put("units.csv", "unit_id\n1\n");
    scratch_.Put("daemon.log", "a line\n");
    scratch_.Put("tokens.csv", "secret-token\n");
    scratch_.Put("key.pem", "secret-key\n");
    scratch_.Put("f.toml",
                 "[bus]\nport = \"simulated\"\n[log]\nfile = \"daemon.log\"\n"
                 "[http]\ntokens = \"tokens.csv\"\nkey = \"key.pem\"\ncertificate = \"key.pem\"\n");
    static_cast<void>(Store::Open(scratch_ / "focalfleet.db"));
  }
  ProgramResult Pack(const std::string& since = "1h") {
    return Focalfleet({"incident", "--json", "--config", scratch_ / "f.toml", "--since", since,
                       "--socket", scratch_ / "none.sock", "--out", out_});
  }

  ScratchFolder scratch_;
  std::string out_ = scratch_ / "fault.tar.gz";
};

TEST_F(Incident, PacksWhatIsThereAndNamesWhatIsNot) {
  const ProgramResult packed = Pack();
  EXPECT_EQ(packed.exit, 3) << packed.err;
  const Json answer = Json::parse(packed.out);
  EXPECT_EQ(answer["file"], out_);
  std::string missing;
  for (const Json& part : answer["missing"]) missing += part["part"].get<std::string>() + " ";
  EXPECT_EQ(missing, "journal status.json alarms.json events.json ");
  const ProgramResult list = RunProgram({"/usr/bin/tar", "--list", "--file", out_});
  EXPECT_EQ(list.exit, 0) << list.err;
  for (const char* part : {"/about.json", "/focalfleet.toml", "/focalfleet.effective.toml",
                           "/units.csv", "/store.db", "/daemon.log", "/doctor.json"})
    EXPECT_THAT(list.out, HasSubstr(part));
  struct stat of {};
  ASSERT_EQ(::stat(out_.c_str(), &of), 0);
  EXPECT_EQ(of.st_mode & 0777, 0600u);
  for (const std::string& name : scratch_.List())
    EXPECT_THAT(name, Not(HasSubstr("fault.tar.gz."))) << "a folder of the work is left";
}

TEST_F(Incident, HasNoKeyAndNoToken) {
  ASSERT_EQ(Pack().exit, 3);
  const ProgramResult all =
      RunProgram({"/usr/bin/tar", "--extract", "--to-stdout", "--file", out_});
  EXPECT_THAT(all.out, HasSubstr("a line"));
  EXPECT_THAT(all.out, Not(HasSubstr("secret-")));
}

TEST_F(Incident, HasEachLifeOfTheJournalThatWasWrittenSince) {
  ASSERT_EQ(::mkdir((scratch_ / "focalfleet.db.journal").c_str(), 0700), 0);
  for (const char* name : {"20240101T000000.000Z.000001", "20240102T000000.000Z.000001",
                           "20240102T000000.000Z.000002", "20240103T000000.000Z.000001"})
    scratch_.Put(std::string("focalfleet.db.journal/") + name + ".journal", name);
  const std::string old[] = {"20240101T000000.000Z.000001", "20240102T000000.000Z.000001"};
  for (const std::string& name : old) {
    const timespec long_ago[2] = {{1'000'000'000, 0}, {1'000'000'000, 0}};
    const std::string path = scratch_ / ("focalfleet.db.journal/" + name + ".journal");
    ASSERT_EQ(::utimensat(AT_FDCWD, path.c_str(), long_ago, 0), 0);
  }
  ASSERT_EQ(Pack().exit, 3);
  const ProgramResult list = RunProgram({"/usr/bin/tar", "--list", "--file", out_});
  EXPECT_THAT(list.out, Not(HasSubstr("20240101T")));
  EXPECT_THAT(list.out, HasSubstr("20240102T000000.000Z.000001")) << "the first of a newer life";
  EXPECT_THAT(list.out, HasSubstr("20240102T000000.000Z.000002"));
  EXPECT_THAT(list.out, HasSubstr("20240103T000000.000Z.000001"));
}

TEST_F(Incident, RefusesWhatItCannotDo) {
  scratch_.Put("fault.tar.gz", "mine");
  const ProgramResult there = Pack();
  EXPECT_EQ(there.exit, 1);
  EXPECT_THAT(there.err, HasSubstr("something is there already"));
  EXPECT_EQ(test::Slurp(out_), "mine");
  EXPECT_EQ(Pack("yesterday").exit, 2);
  out_ = scratch_ / "nowhere/fault.tar.gz";
  EXPECT_EQ(Pack().exit, 1);
  const ProgramResult without =
      Focalfleet({"incident", "--config", scratch_ / "none.toml", "--out", scratch_ / "x"});
  EXPECT_EQ(without.exit, 1);
  EXPECT_THAT(without.err, HasSubstr("none.toml"));
}

}  // namespace
}  // namespace focalfleet
