// The router decides over a request before its body is read, and hands admitted ones to the code
// that answers. Other rooms add routes:
//
//   router->Add({.method = "POST", .path = "/api/stop", .verb = "stop", .answer = ...});
//
// A route names its verb of the table of rights (access/rights.h), and the bearer of a token whose
// role may use this verb is admitted. A route without a verb is for everybody: it may show nothing
// of the fleet, as the text of a page and its script. Nothing of a request ever names a file.
//
// Pages of other sites get no answer: neither under a foreign Host (http_server.h) nor with a
// foreign Origin. A browser sends no token by itself, since there are no cookies.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/access/caller.h"
#include "daemon/access/token_register.h"
#include "daemon/http/http_message.h"

namespace focalfleet {

struct HttpRoute {
  std::string method = "GET";  // or POST, which takes JSON
  std::string path;            // the whole path
  std::string verb;            // of the table of rights; empty: for everybody
  /// Runs on a thread of the server, several at once. `caller` has no role where the verb is empty.
  std::function<HttpAnswer(const HttpRequest& request, const Caller& caller)> answer;
};

class HttpRouter {
 public:
  struct Options {
    std::shared_ptr<TokenRegister> tokens;  // none: routes with a verb admit nobody
    bool tls = false;                       // the scheme of its own Origin
    /// A request without a token that comes from this host is a viewer's.
    bool viewer_without_token = false;
    /// Receives refusals worth a line of the log; the caller limits them.
    std::function<void(const std::string&)> log = [](const std::string&) {};
    std::function<WallTime()> now = &WallTime::Now;
  };
  explicit HttpRouter(Options options) : options_(std::move(options)) {}

  /// Pre: the verb is empty or in the table of rights, and no route has this method and path.
  void Add(HttpRoute route);

  /// The decision over a request without its body: an answer at once, or its route and caller.
  struct Admission {
    std::optional<HttpAnswer> refused = {};
    const HttpRoute* route = nullptr;
    Caller caller = {};
  };
  [[nodiscard]] Admission Admit(const HttpRequest& request) const;
  /// A request that was admitted would be admitted again: its token is still valid, with the same
  /// role. Long answers ask this now and then.
  [[nodiscard]] bool StillAdmits(const Admission& admission, const HttpRequest& request) const;
  /// Pre: the request was admitted.
  [[nodiscard]] HttpAnswer Answer(const Admission& admission, const HttpRequest& request) const;

  [[nodiscard]] const std::vector<HttpRoute>& routes() const { return routes_; }

 private:
  [[nodiscard]] bool IsOwnOrigin(const HttpRequest& request) const;
  [[nodiscard]] std::optional<HttpAnswer> Authenticate(const HttpRequest& request,
                                                       const HttpRoute& route,
                                                       Caller* caller) const;
  [[nodiscard]] std::optional<HttpAnswer> CheckCaller(const HttpRoute& route,
                                                      const Caller& caller) const;

  Options options_;
  std::vector<HttpRoute> routes_;
};

/// {"error": {"code", "text"}} with this status.
HttpAnswer HttpFailure(int status, const std::string& code, const std::string& text);

}  // namespace focalfleet
