// Any bytes as a request to the HTTP door, over a real connection. The door answers by HTTP or
// closes, whatever comes, and hands nothing to its handlers but a request that shows the token. The
// first byte says whether the bytes follow a request line that shows a token of a viewer, so that
// what is behind the door is reached, too.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "daemon/access/token.h"
#include "daemon/control/messages.h"
#include "daemon/http/http_server.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

/// The door, its token, and how often it let somebody in.
struct FuzzedDoor {
  std::string folder;
  std::string secret;
  std::atomic<std::uint64_t> admitted{0};
  std::unique_ptr<HttpServer> server;

  FuzzedDoor() {
    std::string path = "/tmp/focalfleet_http_fuzz_XXXXXX";
    FOCALFLEET_CHECK(::mkdtemp(path.data()) != nullptr);
    folder = path;
    std::vector<Token> tokens;
    secret = *AddToken("look", Role::kViewer, 0, std::int64_t{1} << 40, &tokens);
    std::ofstream(folder + "/tokens.csv") << FormatTokens(tokens);
    ::chmod((folder + "/tokens.csv").c_str(), 0600);
    auto router = std::make_shared<HttpRouter>(
        HttpRouter::Options{.tokens = std::make_shared<TokenRegister>(TokenRegister::Options{
                                .path = folder + "/tokens.csv",
                                .attempts = {.burst = 1e9, .per_second = 1e9},
                                .requests = {.burst = 1e9, .per_second = 1e9}})});
    for (const char* verb : {"status", "apply", "stop"})
      router->Add({.method = "POST",
                   .path = std::string("/api/") + verb,
                   .verb = verb,
                   .answer = [this](const HttpRequest& request, const Caller& caller) {
                     ++admitted;
                     FOCALFLEET_CHECK(caller.role == Role::kViewer && caller.token == "look");
                     FOCALFLEET_CHECK(request.path != "/api/apply");
                     const auto args = DecodeObject(request.body);
                     return HttpAnswer{.status = args ? 200 : 400, .body = "answer"};
                   }});
    HttpLimits limits;
    limits.first_byte = limits.connection = limits.admitted = std::chrono::milliseconds(2000);
    server = std::make_unique<HttpServer>(
        HttpServer::Options{.address = "127.0.0.1", .router = std::move(router), .limits = limits});
    while (server->port() == 0) ::usleep(1000);
  }
  ~FuzzedDoor() {
    server.reset();
    ::unlink((folder + "/tokens.csv").c_str());
    ::rmdir(folder.c_str());
  }
};

std::string Ask(std::uint16_t port, const std::string& request) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  FOCALFLEET_CHECK(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
  [[maybe_unused]] const ssize_t sent =
      ::send(fd, request.data(), request.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  ::shutdown(fd, SHUT_WR);
  std::string answer;
  std::array<char, 4096> chunk{};
  for (ssize_t got = 1; got > 0;) {
    got = ::recv(fd, chunk.data(), chunk.size(), 0);
    if (got > 0) answer.append(chunk.data(), static_cast<std::size_t>(got));
  }
  ::close(fd);
  return answer;
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace focalfleet;
  static FuzzedDoor door;
  if (size == 0) return 0;
  const bool shows_token = data[0] % 2 == 1;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  const std::string request =
      shows_token ? "POST /api/status HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " +
                        door.secret + "\r\n" + text
                  : text;
  const std::uint64_t before = door.admitted;
  const std::string answer = Ask(door.server->port(), request);
  FOCALFLEET_CHECK(answer.empty() || answer.starts_with("HTTP/1.1 "));
  FOCALFLEET_CHECK(answer.find(door.secret) == std::string::npos);
  FOCALFLEET_CHECK(shows_token || door.admitted == before);
  return 0;
}
