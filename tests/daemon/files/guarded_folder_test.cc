#include "daemon/files/guarded_folder.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "daemon/files/text_file.h"
#include "tests/support/as_user.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::AsUser;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr std::size_t kMax = 1 << 20;

/// The guarded folder has neighbours that belong to another program: "secret", and a folder
/// "theirs".
class GuardedFolderTest : public ::testing::TestWithParam<uid_t> {
 protected:
  GuardedFolderTest() : user_(GetParam()), files_(std::make_unique<test::ScratchFolder>()) {
    std::ofstream(Beside("secret")) << "secret";
    std::filesystem::create_directory(Beside("theirs"));
    folder_ = std::make_unique<GuardedFolder>(GuardedFolder::Open(In("")).value());
  }
  ~GuardedFolderTest() override {
    EXPECT_EQ(Text(Beside("secret")), "secret") << "it was written through a link";
    std::filesystem::permissions(In(""), std::filesystem::perms::owner_all);
  }
  [[nodiscard]] std::string Beside(const std::string& name) const { return *files_ / name; }
  [[nodiscard]] std::string In(const std::string& name) const { return Beside("camera/" + name); }
  static std::string Text(const std::string& path) { return ReadTextFile(path).value_or("none"); }
  void Link(const std::string& to, const std::string& name) const {
    ASSERT_EQ(symlink(to.c_str(), In(name).c_str()), 0);
  }
  void Pipe(const std::string& name) const { ASSERT_EQ(mkfifo(In(name).c_str(), 0600), 0); }
  void Socket(const std::string& name) const {
    const Descriptor fd(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, In(name).c_str(), sizeof address.sun_path - 1);
    ASSERT_EQ(bind(fd.get(), static_cast<sockaddr*>(static_cast<void*>(&address)), sizeof address),
              0);
  }
  [[nodiscard]] std::string ReadError(const std::string& name) const {
    const auto text = folder_->Read(name, kMax);
    return text ? "read: " + *text : text.error().text;
  }
  [[nodiscard]] bool Exists(const std::string& path) const {
    struct stat status {};
    return lstat(path.c_str(), &status) == 0;
  }

  AsUser user_;  // from here on, the scratch folder included
  std::unique_ptr<test::ScratchFolder> files_;
  std::unique_ptr<GuardedFolder> folder_;
};

INSTANTIATE_TEST_SUITE_P(Users, GuardedFolderTest, ::testing::ValuesIn(test::UsersOfTests()),
                         test::NameOfUser);

TEST_P(GuardedFolderTest, ReadsAndWritesWholeFiles) {
  ASSERT_TRUE(folder_->Write("b", "one"));
  ASSERT_TRUE(folder_->Write("a", "two"));
  ASSERT_TRUE(folder_->Write("b", "three"));
  EXPECT_EQ(folder_->Read("b", kMax).value(), "three");
  EXPECT_THAT(folder_->Names(10).value(), ElementsAre("a", "b"));
  EXPECT_EQ(folder_->Read("a", 3).value(), "two");
  EXPECT_THAT(folder_->Read("a", 2).error().text, HasSubstr("camera/a: larger than 0 MiB"));
  EXPECT_THAT(ReadError("none"), HasSubstr("No such file"));
}

TEST_P(GuardedFolderTest, ReadsRegularFilesAndNothingElse) {
  Link("../secret", "link.csv");
  Link(Beside("secret"), "absolute.csv");
  Link("none", "dangling.csv");
  Link("loop.csv", "loop.csv");
  Link("/dev/zero", "zero.csv");
  Pipe("pipe.csv");
  Socket("socket.csv");
  std::filesystem::create_directory(In("folder.csv"));
  for (const char* link : {"link", "absolute", "dangling", "loop", "zero"})
    EXPECT_THAT(ReadError(link + std::string(".csv")), HasSubstr("a symbolic link, no file"));
  EXPECT_THAT(ReadError("pipe.csv"), HasSubstr("camera/pipe.csv: a named pipe, no file"));
  EXPECT_THAT(ReadError("socket.csv"), HasSubstr("a socket, no file"));
  EXPECT_THAT(ReadError("folder.csv"), HasSubstr("a folder, no file"));
  const auto devices = GuardedFolder::Open("/dev");
  ASSERT_TRUE(devices);
  EXPECT_THAT(devices->Read("zero", kMax).error().text, HasSubstr("a device, no file"));
}

TEST_P(GuardedFolderTest, AFileThatChangesWhileItIsReadIsNotTaken) {
  const char* reported = "changed while it was read: write it under another ending, then rename it";
  // The kernel's own files report a size of 0.
  const auto kernel = GuardedFolder::Open("/proc/self");
  ASSERT_TRUE(kernel);
  EXPECT_THAT(kernel->Read("status", kMax).error().text, HasSubstr(reported));
  ASSERT_TRUE(folder_->Write("x", std::string(kMax, 'x')));
  const Descriptor file(open(In("x").c_str(), O_WRONLY | O_CLOEXEC));
  std::atomic<bool> seen{false};
  std::thread writer([&] {
    while (!seen) EXPECT_EQ(pwrite(file.get(), "y", 1, 0), 1);
  });
  std::string error;
  for (int k = 0; k < 100'000 && error.empty(); ++k)
    if (const auto read = folder_->Read("x", kMax); !read) error = read.error().text;
  seen = true;
  writer.join();
  EXPECT_THAT(error, HasSubstr(reported));
  EXPECT_TRUE(folder_->Read("x", kMax)) << "it rests";
}

TEST_P(GuardedFolderTest, NamesDoNotLeadOut) {
  for (const char* name : {"../secret", "..", ".", "", "theirs/x", "/etc/hostname"}) {
    EXPECT_FALSE(folder_->Read(name, kMax)) << name;
    EXPECT_FALSE(folder_->Write(name, "x")) << name;
  }
}

TEST_P(GuardedFolderTest, ReplacesLinksAndPipesInsteadOfWritingIntoThem) {
  Link("../secret", "link");
  Link("../new", "dangling");
  Pipe("pipe");
  Socket("socket");
  for (const char* name : {"link", "dangling", "pipe", "socket"}) {
    ASSERT_TRUE(folder_->Write(name, "mine")) << name;
    EXPECT_TRUE(std::filesystem::is_regular_file(std::filesystem::symlink_status(In(name))));
    EXPECT_EQ(Text(In(name)), "mine");
  }
  EXPECT_FALSE(Exists(Beside("new")));
  std::filesystem::create_directories(In("folder/of theirs"));
  const Status written = folder_->Write("folder", "mine");
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().text, HasSubstr("camera/folder: cannot be written: Is a directory"));
  EXPECT_TRUE(Exists(In("folder/of theirs")));
  EXPECT_THAT(folder_->Names(10).value(),
              ElementsAre("dangling", "folder", "link", "pipe", "socket"))
      << "and nothing lies beside";
}

TEST_P(GuardedFolderTest, WhatLiesWhereItWritesBesideIsNotFollowed) {
  const std::string beside = ".focalfleet." + std::to_string(getpid()) + ".";
  Link("../secret", beside + "0.tmp");
  ASSERT_TRUE(folder_->Write("x", "mine"));
  std::filesystem::create_directories(In(beside + "0.tmp/theirs"));
  ASSERT_TRUE(folder_->Write("x", "again"));
  EXPECT_EQ(Text(In("x")), "again");
  EXPECT_TRUE(Exists(In(beside + "0.tmp/theirs")));
}

TEST_P(GuardedFolderTest, MovesWhateverItIsWithoutFollowingIt) {
  const auto aside = folder_->Subfolder("aside");
  ASSERT_TRUE(aside);
  Link("../secret", "link");
  Pipe("pipe");
  std::filesystem::create_directories(In("folder/of theirs"));
  for (const char* name : {"link", "pipe", "folder"}) {
    ASSERT_TRUE(folder_->Move(name, *aside)) << name;
    EXPECT_FALSE(Exists(In(name)));
    EXPECT_TRUE(Exists(In(std::string("aside/") + name)));
  }
  EXPECT_TRUE(Exists(In("aside/folder/of theirs")));
  ASSERT_TRUE(folder_->Write("folder", "a file now"));
  ASSERT_TRUE(folder_->Move("folder", *aside));
  EXPECT_EQ(Text(In("aside/folder.1")), "a file now");
  EXPECT_TRUE(Exists(In("aside/folder/of theirs")));
  EXPECT_FALSE(folder_->Move("none", *aside));
  for (const char* text : {"first", "second", "third"}) {
    ASSERT_TRUE(folder_->Write("night", text));
    ASSERT_TRUE(folder_->Move("night", *aside));
  }
  EXPECT_EQ(Text(In("aside/night")), "first");
  EXPECT_EQ(Text(In("aside/night.1")), "second");
  EXPECT_EQ(Text(In("aside/night.2")), "third");
}

TEST_P(GuardedFolderTest, ASubfolderIsNoLinkToOne) {
  Link("../theirs", "taken");
  const auto link = folder_->Subfolder("taken");
  ASSERT_FALSE(link);
  EXPECT_THAT(link.error().text,
              HasSubstr("camera/taken: a symbolic link, where a folder is to be"));
  Pipe("refused");
  EXPECT_THAT(folder_->Subfolder("refused").error().text, HasSubstr("a named pipe, where a"));
  ASSERT_TRUE(folder_->Write("file", ""));
  EXPECT_THAT(folder_->Subfolder("file").error().text, HasSubstr("a file, where a folder"));
  EXPECT_TRUE(std::filesystem::is_empty(Beside("theirs")));
}

TEST_P(GuardedFolderTest, TheFolderItselfMayBeTheOperatorsLink) {
  ASSERT_EQ(symlink(Beside("theirs").c_str(), Beside("link").c_str()), 0);
  const auto folder = GuardedFolder::Open(Beside("link"));
  ASSERT_TRUE(folder);
  ASSERT_TRUE(folder->Write("x", "1"));
  EXPECT_EQ(Text(Beside("theirs/x")), "1");
  EXPECT_FALSE(GuardedFolder::Open(Beside("secret")));
}

TEST_P(GuardedFolderTest, AFullDiskIsReportedAndLeavesNothing) {
  ASSERT_TRUE(folder_->Write("x", "before"));
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit none{0, before.rlim_max};
  auto* const handler = signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &none), 0);
  const Status written = folder_->Write("x", "after");
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  signal(SIGXFSZ, handler);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kFull);
  EXPECT_EQ(Text(In("x")), "before");
  EXPECT_THAT(folder_->Names(10).value(), ElementsAre("x"));
}

TEST_P(GuardedFolderTest, AFolderThatMayNotBeWrittenIsReported) {
  ASSERT_TRUE(folder_->Write("x", "1"));
  const auto aside = folder_->Subfolder("aside").value();
  std::filesystem::permissions(
      In(""), std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  // Root may write into a read-only folder all the same.
  EXPECT_EQ(folder_->Write("y", "2").has_value(), GetParam() == 0);
  EXPECT_EQ(folder_->Move("x", aside).has_value(), GetParam() == 0);
  if (GetParam() != 0) {
    EXPECT_THAT(folder_->Write("y", "2").error().text,
                HasSubstr("camera/y: cannot be written: Permission denied"));
  }
}

TEST_P(GuardedFolderTest, AFileThatIsNotOursToReadIsReported) {
  ASSERT_TRUE(folder_->Write("x", "1"));
  std::filesystem::permissions(In("x"), std::filesystem::perms::none);
  EXPECT_THAT(ReadError("x"), HasSubstr(GetParam() == 0 ? "read: 1" : "Permission denied"));
}

TEST_P(GuardedFolderTest, TooManyFilesAreNotLookedAt) {
  for (const char* name : {"a", "b", "c"}) ASSERT_TRUE(folder_->Write(name, ""));
  EXPECT_EQ(folder_->Names(3).value().size(), 3u);
  EXPECT_EQ(folder_->Names(2).error().code, ErrorCode::kFull);
}

TEST_P(GuardedFolderTest, NamesAreShownWithoutControlCharacters) {
  EXPECT_THAT(folder_->Shown("a\nforged\x1b[2J"), HasSubstr("camera/a?forged?[2J"));
}

TEST_P(GuardedFolderTest, AnotherFileOfThatNameIsAnotherFile) {
  ASSERT_TRUE(folder_->Write("x", "1"));
  const auto first = folder_->IdentityOf("x");
  ASSERT_TRUE(first);
  EXPECT_EQ(folder_->IdentityOf("x"), first);
  std::ofstream(In("x"), std::ios::app) << "2";
  EXPECT_NE(folder_->IdentityOf("x"), first);
  EXPECT_FALSE(folder_->IdentityOf("none"));
}

}  // namespace
}  // namespace focalfleet
