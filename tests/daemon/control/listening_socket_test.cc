// The socket file of a line server.
#include "daemon/control/listening_socket.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "daemon/control/line_server.h"
#include "daemon/control/unix_address.h"
#include "tests/daemon/control/line_server_turns.h"
#include "tests/daemon/control/raw_client.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Drain;
using test::RawClient;
using ::testing::HasSubstr;

TEST(LineServer, OnlyOwnerAndGroupMayConnect) {
  const test::ScratchFolder scratch;
  const auto server = LineServer::Create(scratch / "s").value();
  struct stat info {};
  ASSERT_EQ(::stat((scratch / "s").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0660u);
}

TEST(LineServer, ReplacesASocketFileThatNoServerAnswers) {
  const test::ScratchFolder scratch;
  const auto address = UnixAddress::Of(scratch / "s").value();
  const int dead = ::socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(::bind(dead, address.get(), address.length()), 0);
  ::close(dead);  // as after kill -9: the file stays
  auto server = LineServer::Create(scratch / "s");
  ASSERT_TRUE(server) << server.error().text;
  const RawClient client(scratch / "s");
  client.Send("hello\n");
  EXPECT_EQ(Drain(&*server).size(), 1u);
}

TEST(LineServer, RefusesASocketThatALiveServerHolds) {
  const test::ScratchFolder scratch;
  const auto first = LineServer::Create(scratch / "s").value();
  const auto second = LineServer::Create(scratch / "s");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kRefused);
  EXPECT_THAT(second.error().text, HasSubstr("in use"));
  EXPECT_EQ(::access((scratch / "s").c_str(), F_OK), 0) << "the first one's file stays";
}

TEST(LineServer, DoesNotTakeAFileThatIsNoSocket) {
  const test::ScratchFolder scratch;
  std::ofstream(scratch / "s") << "precious";
  const auto server = LineServer::Create(scratch / "s");
  ASSERT_FALSE(server);
  EXPECT_THAT(server.error().text, HasSubstr("not a socket"));
}

TEST(LineServer, NamesAPathThatIsTooLongOrNotThere) {
  EXPECT_THAT(LineServer::Create(std::string(200, 'x')).error().text, HasSubstr("107 bytes"));
  EXPECT_THAT(LineServer::Create("/no/such/place/s").error().text, HasSubstr("/no/such/place/s"));
}

TEST(LineServer, RemovesItsSocketFileButNotItsSuccessors) {
  const test::ScratchFolder scratch;
  { const auto server = LineServer::Create(scratch / "s").value(); }
  EXPECT_NE(::access((scratch / "s").c_str(), F_OK), 0);
  {
    const auto server = LineServer::Create(scratch / "s").value();
    ::unlink((scratch / "s").c_str());
    std::ofstream(scratch / "s") << "another's";
  }
  EXPECT_EQ(::access((scratch / "s").c_str(), F_OK), 0);
}

}  // namespace
}  // namespace focalfleet
