#include "tests/daemon/simulator/running_simulation.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>

#include "daemon/control/unix_address.h"
#include "daemon/ports/socket_frames.h"

extern char** environ;

namespace focalfleet::test {
namespace {

constexpr int kPatienceMs = 20'000;

struct Child {
  pid_t pid = -1;
  int out = -1;
  int err = -1;
};

Child Spawn(std::vector<std::string> arguments, bool with_stderr) {
  arguments.insert(arguments.begin(), FOCALFLEET_SIM_PROGRAM);
  std::vector<char*> pointers;
  for (std::string& text : arguments) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  std::array<int, 2> out{-1, -1};
  std::array<int, 2> err{-1, -1};
  if (::pipe2(out.data(), O_CLOEXEC) != 0 || ::pipe2(err.data(), O_CLOEXEC) != 0) return {};
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
  if (with_stderr) ::posix_spawn_file_actions_adddup2(&actions, err[1], STDERR_FILENO);
  Child child;
  ::posix_spawn(&child.pid, FOCALFLEET_SIM_PROGRAM, &actions, nullptr, pointers.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(out[1]);
  ::close(err[1]);
  child.out = out[0];
  child.err = err[0];
  return child;
}

// Reads until the text contains `enough`, the other end closes, or the limit of time is reached.
std::string ReadUntil(int fd, const std::string& enough) {
  std::string text;
  while (enough.empty() || text.find(enough) == std::string::npos) {
    pollfd poller{fd, POLLIN, 0};
    if (::poll(&poller, 1, kPatienceMs) <= 0) break;
    std::array<char, 4096> chunk{};
    const ssize_t got = ::read(fd, chunk.data(), chunk.size());
    if (got <= 0) break;
    text.append(chunk.data(), static_cast<std::size_t>(got));
  }
  return text;
}

int ExitOf(pid_t pid) {
  int status = 0;
  if (pid <= 0 || ::waitpid(pid, &status, 0) != pid) return -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace

RunningSimulation::RunningSimulation(std::vector<std::string> arguments) {
  const Child child = Spawn(std::move(arguments), /*with_stderr=*/false);
  pid_ = child.pid;
  ready_ = ReadUntil(child.out, "ready\n") == "ready\n";
  ::close(child.out);
  ::close(child.err);
}

RunningSimulation::~RunningSimulation() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

int RunningSimulation::Terminate() {
  ::kill(pid_, SIGTERM);
  return Wait();
}

int RunningSimulation::Wait() {
  const int exit = ExitOf(pid_);
  pid_ = -1;
  return exit;
}

BusClient::BusClient(const std::string& path) {
  const auto address = UnixAddress::Of(path);
  fd_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  connected_ = address && ::connect(fd_, address->get(), address->length()) == 0;
}

BusClient::~BusClient() { ::close(fd_); }

void BusClient::Send(std::uint8_t node, const HostMessage& message, std::uint8_t sequence) {
  const CanFrame frame = Encode(message, {{node}, sequence});
  (void)SendFrames(fd_, {&frame, 1});
}

std::optional<CanFrame> BusClient::Receive() {
  pollfd poller{fd_, POLLIN, 0};
  if (::poll(&poller, 1, kPatienceMs) <= 0) return std::nullopt;
  can_frame raw{};
  if (::recv(fd_, &raw, sizeof raw, 0) != static_cast<ssize_t>(sizeof raw)) return std::nullopt;
  return FromSocketFrame(raw);
}

Said RunToEnd(std::vector<std::string> arguments) {
  const Child child = Spawn(std::move(arguments), /*with_stderr=*/true);
  // The output of these tests fits a pipe, so the two streams can be read one after the other.
  Said said;
  said.out = ReadUntil(child.out, "");
  said.err = ReadUntil(child.err, "");
  said.exit = ExitOf(child.pid);
  ::close(child.out);
  ::close(child.err);
  return said;
}

}  // namespace focalfleet::test
