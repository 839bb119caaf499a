// The command access shows what its caller may do.

#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "daemon/cli/client.h"
#include "daemon/cli/operator_commands.h"

namespace focalfleet::cli {
namespace {

struct AccessOptions {};

std::string DescribeAccess(const Json& access) {
  std::string may;
  std::string may_not;
  for (const Json& verb : ListIn(access, "verbs")) {
    std::string* const list = verb.value("allowed", false) ? &may : &may_not;
    *list += (list->empty() ? "" : ", ") + TextIn(verb, "verb");
    if (list == &may && verb.contains("flag") && !verb.value("flag_allowed", false))
      may_not += (may_not.empty() ? "" : ", ") + TextIn(verb, "verb") + " " + TextIn(verb, "flag");
  }
  return fmt::format("{} is {}, by the {}\nmay      {}\nmay not  {}", TextIn(access, "name"),
                     TextIn(access, "role"), TextIn(access, "door"), may,
                     may_not.empty() ? "-" : may_not);
}

ExitCode RunAccess(const Context& context, const AccessOptions& /*options*/) {
  const auto answer = Ask(context, {.verb = "access"});
  if (!answer) return Report(context, answer.error());
  if (context.json) PrintJson(*answer);
  Say(context, DescribeAccess(*answer));
  return ExitCode::kOk;
}

}  // namespace

void AddAccessCommands(CommandLine* line) {
  CLI::App* access =
      AddCommand(&line->app, "access", "Show your role at the daemon, and what it may do",
                 "  focalfleet access");
  OnChosen(line, access, std::make_shared<AccessOptions>(), RunAccess);
  AddAuditCommand(line);
  AddTokenCommands(line);
}

}  // namespace focalfleet::cli
