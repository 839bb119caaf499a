#include "daemon/http/router.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "daemon/access/rights.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

constexpr std::string_view kBearer = "Bearer ";
/// The name of callers without a token. No token can have it (access/token.h).
constexpr const char* kNoToken = "(none, on this host)";

bool IsOfThisHost(const HttpRequest& request) {
  return !request.forwarded && (request.address.starts_with("127.") || request.address == "::1");
}

/// The media type without its parameters, in lower case.
std::string MediaTypeOf(const std::string& content_type) {
  std::string type = content_type.substr(0, content_type.find(';'));
  while (type.ends_with(' ')) type.pop_back();
  std::ranges::transform(type, type.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return type;
}

HttpAnswer Unauthorized(const std::string& text) {
  HttpAnswer answer = HttpFailure(401, "unauthorized", text);
  answer.headers.emplace_back("WWW-Authenticate", "Bearer realm=\"focalfleet\"");
  return answer;
}

HttpAnswer TooMany(const std::string& text) {
  HttpAnswer answer = HttpFailure(429, "full", text);
  answer.headers.emplace_back("Retry-After", "1");
  return answer;
}

}  // namespace

HttpAnswer HttpFailure(int status, const std::string& code, const std::string& text) {
  const nlohmann::json error{{"error", {{"code", code}, {"text", text}}}};
  return {.status = status,
          .content_type = "application/json",
          .body = error.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n"};
}

void HttpRouter::Add(HttpRoute route) {
  FOCALFLEET_CHECK(route.method == "GET" || route.method == "POST");
  FOCALFLEET_CHECK(route.verb.empty() || RightOf(route.verb) != nullptr);
  FOCALFLEET_CHECK(std::ranges::none_of(routes_, [&](const HttpRoute& other) {
    return other.method == route.method && other.path == route.path;
  }));
  routes_.push_back(std::move(route));
}

bool HttpRouter::IsOwnOrigin(const HttpRequest& request) const {
  const bool foreign = !request.fetch_site.empty() && request.fetch_site != "same-origin" &&
                       request.fetch_site != "none";
  if (foreign && request.method != "GET") return false;
  const std::string own = (options_.tls ? "https://" : "http://") + request.host;
  return request.origin.empty() || request.origin == own;
}

std::optional<HttpAnswer> HttpRouter::Authenticate(const HttpRequest& request,
                                                   const HttpRoute& route, Caller* caller) const {
  if (options_.tokens == nullptr) return Unauthorized("no token is valid here");
  TokenRegister& tokens = *options_.tokens;
  const WallTime now = options_.now();
  if (request.authorization.empty() && options_.viewer_without_token && IsOfThisHost(request)) {
    *caller = {
        .role = Role::kViewer, .door = Door::kHttp, .token = kNoToken, .address = request.address};
    return CheckCaller(route, *caller);
  }
  if (!request.authorization.starts_with(kBearer))
    return Unauthorized("a token is needed: Authorization: Bearer TOKEN");
  const auto found = tokens.Find(request.authorization.substr(kBearer.size()), now);
  if (!found) {
    // Valid tokens from the same address are not held up: others on a host share its addresses.
    if (!tokens.MayTry(request.address, now)) return TooMany("too many tokens that are not valid");
    options_.log("http: a token is refused, from " + request.address + ": " + found.error().text);
    return Unauthorized("the token is not valid");  // the reason is for the log alone
  }
  *caller = {
      .role = found->role, .door = Door::kHttp, .token = found->name, .address = request.address};
  return CheckCaller(route, *caller);
}

std::optional<HttpAnswer> HttpRouter::CheckCaller(const HttpRoute& route,
                                                  const Caller& caller) const {
  if (route.verb != "stop" && !options_.tokens->MayAsk(caller.token, options_.now()))
    return TooMany("too many requests of this token");
  const Status right = CheckRight(caller, route.verb, nlohmann::json::object());
  if (right) return std::nullopt;
  options_.log("http: " + right.error().text);
  return HttpFailure(403, "refused", right.error().text);
}

bool HttpRouter::StillAdmits(const Admission& admission, const HttpRequest& request) const {
  if (admission.route->verb.empty() || request.authorization.empty()) return true;
  const auto found =
      options_.tokens->Find(request.authorization.substr(kBearer.size()), options_.now());
  return found && found->name == admission.caller.token && found->role == admission.caller.role;
}

HttpRouter::Admission HttpRouter::Admit(const HttpRequest& request) const {
  const auto refuse = [](HttpAnswer answer) { return Admission{.refused = std::move(answer)}; };
  const HttpRoute* route = nullptr;
  std::string allowed;
  for (const HttpRoute& each : routes_) {
    if (each.path != request.path) continue;
    allowed += (allowed.empty() ? "" : ", ") + each.method;
    if (each.method == request.method) route = &each;
  }
  if (allowed.empty()) return refuse(HttpFailure(404, "invalid", "there is no such page"));
  if (route == nullptr) {
    HttpAnswer answer = HttpFailure(405, "invalid", "another method is asked for");
    answer.headers.emplace_back("Allow", allowed);
    return refuse(std::move(answer));
  }
  if (!IsOwnOrigin(request))
    return refuse(HttpFailure(403, "refused", "pages of other sites get no answer"));
  Admission admission{.route = route};
  if (!route->verb.empty()) {
    admission.refused = Authenticate(request, *route, &admission.caller);
    if (admission.refused) return admission;
  }
  if (route->method == "POST" && (MediaTypeOf(request.content_type) != "application/json" ||
                                  !request.content_encoding.empty()))
    return refuse(HttpFailure(415, "invalid", "Content-Type must be application/json, not packed"));
  return admission;
}

HttpAnswer HttpRouter::Answer(const Admission& admission, const HttpRequest& request) const {
  return admission.route->answer(request, admission.caller);
}

}  // namespace focalfleet
