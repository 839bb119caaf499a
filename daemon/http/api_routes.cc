#include "daemon/http/api_routes.h"

#include "daemon/access/rights.h"
#include "daemon/control/line_client.h"

namespace focalfleet {
namespace {

/// The core answers within milliseconds; a dry run shows progress meanwhile.
constexpr DurationNs kSilenceMax = Seconds(10);

int StatusOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalid:
      return 400;
    case ErrorCode::kRefused:
      return 409;
    case ErrorCode::kFull:
      return 429;
    case ErrorCode::kUnavailable:
    case ErrorCode::kNewer:
      break;
  }
  return 503;
}

HttpAnswer AnswerOf(const Error& error, int status) {
  return HttpFailure(status, CodeName(error.code), error.text);
}

/// The arguments of a body. Errors: kInvalid.
Result<Json> ArgumentsIn(const std::string& body) {
  if (body.empty()) return Json::object();
  FOCALFLEET_TRY_ASSIGN(Json args, DecodeObject(body));
  if (args.contains("wait"))
    return Fail(ErrorCode::kInvalid, "nothing waits over HTTP: ask for the status");
  return args;
}

HttpAnswer Ask(const std::string& socket, const std::string& verb, const HttpRequest& request,
               const Caller& caller) {
  const auto args = ArgumentsIn(request.body);
  if (!args) return AnswerOf(args.error(), 400);
  if (const Status right = CheckRight(caller, verb, *args); !right)
    return AnswerOf(right.error(), 403);
  auto client = LineClient::Connect(socket);
  if (!client) return AnswerOf({ErrorCode::kUnavailable, "the daemon does not answer"}, 503);
  const auto answer =
      client->Call(verb, *args, {.silence_max = kSilenceMax, .on_progress = {}, .caller = caller});
  if (!answer) return AnswerOf(answer.error(), StatusOf(answer.error().code));
  return {.content_type = "application/json",
          .body = answer->dump(-1, ' ', false, Json::error_handler_t::replace) + "\n"};
}

}  // namespace

void AddApiRoutes(const std::string& socket, HttpRouter* router) {
  for (const Right& right : Rights()) {
    const std::string verb = right.verb;
    if (verb == "wait" || verb == "diagnose") continue;
    router->Add({.method = "POST",
                 .path = "/api/" + verb,
                 .verb = verb,
                 .answer = [socket, verb](const HttpRequest& request, const Caller& caller) {
                   return Ask(socket, verb, request, caller);
                 }});
  }
}

}  // namespace focalfleet
