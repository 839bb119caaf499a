#include "daemon/process/http_door.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <utility>

#include "daemon/access/log_limit.h"
#include "daemon/access/token.h"
#include "daemon/clock/wall_time.h"
#include "daemon/http/api_routes.h"

namespace focalfleet {
namespace {

/// The log of a door: lines that strangers cause are limited.
class DoorLog {
 public:
  void operator()(const std::string& text) {
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    const std::lock_guard lock(mutex_);
    const std::string line = limit_.Admit({std::chrono::nanoseconds(now).count()}, text);
    if (!line.empty()) spdlog::warn("{}", line);
  }

 private:
  std::mutex mutex_;
  LogLimit limit_;
};

Status CheckTokens(const DaemonConfig::Http& http) {
  const auto tokens = ReadTokens(http.tokens);
  const auto at = [&](const std::string& text) { return http.tokens_at + ": " + text; };
  if (!tokens)
    return Fail(tokens.error().code,
                at(tokens.error().text) + "; focalfleet token add makes the file");
  const std::int64_t now_s = WallTime::Now().ns / 1'000'000'000;
  const bool any = std::ranges::any_of(
      *tokens, [&](const Token& token) { return StateOf(token, now_s) == TokenState::kValid; });
  if (any || !http.tls()) return {};
  return Fail(ErrorCode::kInvalid, at(http.tokens + " has no valid token, so nobody could come"));
}

}  // namespace

Status CheckHttpDoor(const DaemonConfig::Http& http) {
  if (http.port == 0) return {};
  FOCALFLEET_TRY(CheckTokens(http));
  if (http.tls()) FOCALFLEET_TRY(TlsContext::Open({http.certificate, http.key}));
  return {};
}

std::string PageAddress(const DaemonConfig::Http& http) {
  if (http.port == 0) return "";
  const bool is_v6 = http.address.find(':') != std::string::npos;
  // A certificate is for a name.
  const std::string address = is_v6 ? "[" + http.address + "]" : http.address;
  const std::string& host = http.tls() && !http.names.empty() ? http.names.front() : address;
  return (http.tls() ? "https://" : "http://") + host + ":" + std::to_string(http.port) + "/";
}

Result<std::unique_ptr<HttpServer>> OpenHttp(const DaemonConfig::Http& http,
                                             const std::string& socket, const PageParts& page) {
  if (http.port == 0) return std::unique_ptr<HttpServer>();
  FOCALFLEET_TRY(CheckTokens(http));
  std::shared_ptr<TlsContext> tls;
  if (http.tls()) {
    FOCALFLEET_TRY_ASSIGN(tls, TlsContext::Open({http.certificate, http.key}));
  }
  auto log = std::make_shared<DoorLog>();
  auto router = std::make_shared<HttpRouter>(HttpRouter::Options{
      .tokens = std::make_shared<TokenRegister>(TokenRegister::Options{.path = http.tokens}),
      .tls = http.tls(),
      .viewer_without_token = http.viewer_without_token,
      .log = [log](const std::string& text) { (*log)(text); }});
  AddApiRoutes(socket, router.get());
  AddPageRoutes(page, router.get());
  std::vector<std::string> names = http.names;
  names.push_back(http.address);
  return std::make_unique<HttpServer>(
      HttpServer::Options{.address = http.address,
                          .port = http.port,
                          .names = std::move(names),
                          .router = std::move(router),
                          .tls = std::move(tls),
                          .tell =
                              [](const std::string& trouble) {
                                if (trouble.empty())
                                  spdlog::info("HTTP is served again");
                                else
                                  spdlog::warn("no HTTP, it is tried again: {}", trouble);
                              },
                          .limits = {.streams = http.viewers_max}});
}

}  // namespace focalfleet
