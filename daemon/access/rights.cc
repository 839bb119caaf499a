#include "daemon/access/rights.h"

#include <algorithm>
#include <string>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

// docs/access.md shows this table; a test compares them.
constexpr Right kRights[] = {
    {"access", false, Role::kViewer},
    {"alarms", false, Role::kViewer},
    {"events", false, Role::kViewer},
    {"history", false, Role::kViewer},
    {"measurements", false, Role::kViewer},
    {"model", false, Role::kViewer},
    {"params", false, Role::kViewer},
    {"replay", false, Role::kViewer},
    {"select", false, Role::kViewer},
    {"state", false, Role::kViewer},
    {"status", false, Role::kViewer},
    {"unit", false, Role::kViewer},
    {"wait", false, Role::kViewer},
    {"stop", true, Role::kViewer},
    {"audit", false, Role::kOperator},
    {"audit_check", false, Role::kOperator},
    {"diagnose", false, Role::kOperator},
    // A dry run takes the planner's time.
    {"preview", false, Role::kOperator},
    {"alarms_ack", true, Role::kOperator},
    {"alarms_mute", true, Role::kOperator},
    {"alarms_unmute", true, Role::kOperator},
    {"apply", true, Role::kOperator},
    {"disable", true, Role::kOperator},
    {"enable", true, Role::kOperator},
    {"home", true, Role::kOperator, "unproven", Role::kEngineer},
    {"measure", true, Role::kOperator},
    {"retarget", true, Role::kOperator},
    {"adopt", true, Role::kEngineer},
    {"model_load", true, Role::kEngineer},
    {"model_rollback", true, Role::kEngineer},
    {"model_unload", true, Role::kEngineer},
    {"params_set", true, Role::kEngineer},
};

/// A flag of a wrong type counts as given: the request is refused later for its type.
bool IsGiven(const nlohmann::json& args, const char* flag) {
  const auto at = args.find(flag);
  return at != args.end() && *at != nlohmann::json(false);
}

}  // namespace

std::span<const Right> Rights() { return kRights; }

const Right* RightOf(std::string_view verb) {
  const auto* const right =
      std::ranges::find_if(kRights, [&](const Right& one) { return verb == one.verb; });
  return right == std::end(kRights) ? nullptr : right;
}

Status CheckRight(const Caller& caller, std::string_view verb, const nlohmann::json& args) {
  const Right* const right = RightOf(verb);
  if (right == nullptr)
    return Fail(ErrorCode::kInvalid, "there is no verb '" + std::string(verb) + "'");
  const bool flagged = right->flag_least > right->least && IsGiven(args, right->flag);
  const Role least = flagged ? right->flag_least : right->least;
  if (caller.role >= least) return {};
  return Fail(ErrorCode::kRefused, Describe(caller) + " may not " + right->verb +
                                       (flagged ? std::string(" with ") + right->flag : "") +
                                       ": it takes the role " + Name(least));
}

std::size_t LineBytesMaxOf(Role role) {
  if (role >= RightOf("model_load")->least) return limits::kModelLineBytes;
  return role >= RightOf("apply")->least ? limits::kControlLineBytes : limits::kViewerLineBytes;
}

nlohmann::json AccessJson(const Caller& caller) {
  nlohmann::json verbs = nlohmann::json::array();
  for (const Right& right : kRights) {
    nlohmann::json one{{"verb", right.verb},
                       {"changes", right.changes},
                       {"least", Name(right.least)},
                       {"allowed", caller.role >= right.least}};
    if (right.flag_least > right.least) {
      one["flag"] = right.flag;
      one["flag_least"] = Name(right.flag_least);
      one["flag_allowed"] = caller.role >= right.flag_least;
    }
    verbs.push_back(std::move(one));
  }
  return {{"name", NameOf(caller)},
          {"door", Name(caller.door)},
          {"role", Name(caller.role)},
          {"verbs", std::move(verbs)}};
}

}  // namespace focalfleet
