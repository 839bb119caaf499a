#include "daemon/ports/bounded_question.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <future>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "daemon/ports/socketcan_port.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

BoundedQuestion::Answer Bytes(std::size_t count) { return std::vector<std::byte>(count); }

TEST(BoundedQuestion, GivesTheAnswerThatComes) {
  BoundedQuestion question({.patience = std::chrono::seconds(60)});
  for (std::size_t n = 1; n <= 3; ++n) {
    const auto answer = question([n] { return Bytes(n); });
    ASSERT_TRUE(answer) << answer.error().text;
    EXPECT_EQ(answer->size(), n);
  }
  const auto refused = question(
      []() -> BoundedQuestion::Answer { return Fail(ErrorCode::kUnavailable, "no netlink"); });
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().text, "no netlink");
}

TEST(BoundedQuestion, IsNotWaitedForWhereItHangsAndNoOtherIsBegunThen) {
  std::promise<void> kernel;
  const std::shared_future<void> answers = kernel.get_future().share();
  std::vector<std::thread> threads;
  BoundedQuestion question(
      {.patience = std::chrono::milliseconds(1), .start = [&threads](std::function<void()> work) {
         // The thread itself can be joined here, and its stand-in detached.
         threads.emplace_back(std::move(work));
         return std::thread([] {});
       }});
  const auto hangs = question([answers] {
    answers.wait();
    return Bytes(1);
  });
  const auto why = [](const BoundedQuestion::Answer& answer) {
    return answer ? std::string("an answer") : answer.error().text;
  };
  EXPECT_EQ(why(hangs), "the kernel does not answer within 1 ms");
  for (int bus = 0; bus < 50; ++bus)
    EXPECT_THAT(why(question([] { return Bytes(1); })),
                HasSubstr("has not answered the question before"));
  EXPECT_EQ(threads.size(), 1u) << "no other thread hangs";
  kernel.set_value();
  for (std::thread& thread : threads) thread.join();
  threads.clear();
  static_cast<void>(question([] { return Bytes(2); }));
  EXPECT_EQ(threads.size(), 1u) << "it is asked again";
  for (std::thread& thread : threads) thread.join();
}

TEST(BoundedQuestion, WithoutAThreadItIsRefusedAndAskedLater) {
  bool any = false;
  BoundedQuestion question(
      {.patience = std::chrono::seconds(60), .start = [&any](std::function<void()> work) {
         if (!any) throw std::system_error(EAGAIN, std::generic_category());
         return std::thread(std::move(work));
       }});
  const auto none = question([] { return Bytes(1); });
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().text, HasSubstr("no thread to ask by"));
  any = true;
  EXPECT_TRUE(question([] { return Bytes(1); }));
}

TEST(SocketCanPort, KeepsTheLastStateWhereTheKernelDoesNotAnswer) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0, ends.data()), 0);
  CanLink link{.index = 7, .can = true, .up = true, .kind = "can"};
  link.state = ControllerState::kPassive;
  int looks = 0;
  bool answers = false;
  auto port = SocketCanPort::Create(
      {.bus = BusId{1},
       .interface = "can7",
       .open = [&](const std::string&, const Listening&) -> Result<OpenedInterface> {
         return OpenedInterface{ends[0], link};
       },
       .look = [&](const std::string&) -> Result<CanLink> {
         ++looks;
         if (answers) return link;
         return Fail(ErrorCode::kUnavailable, "the kernel does not answer within 20 ms");
       }});
  ASSERT_TRUE(port) << port.error().text;
  std::vector<ReceivedFrame> frames;
  const auto receive_at = [&](std::int64_t ms) {
    (*port)->Receive(HostInstant{} + Milliseconds(ms), &frames);
  };
  receive_at(1);
  EXPECT_EQ(looks, 1);
  EXPECT_EQ((*port)->state(), LinkState::kPassive);
  receive_at(900);
  EXPECT_EQ(looks, 1) << "it is not asked again at once";
  link.state = ControllerState::kActive;
  answers = true;
  receive_at(1001);
  EXPECT_EQ(looks, 2);
  EXPECT_EQ((*port)->state(), LinkState::kUp);
  ::close(ends[1]);
}

}  // namespace
}  // namespace focalfleet
