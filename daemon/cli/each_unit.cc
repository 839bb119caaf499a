#include "daemon/cli/each_unit.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

namespace focalfleet::cli {

ExitCode AskForEach(const Context& context, const std::vector<std::uint32_t>& units,
                    const UnitQuestion& question) {
  const bool single = units.size() == 1;
  Json served = Json::array();
  Json refused = Json::array();
  const auto so_far = [&] { return Json{{"units", served}, {"refused", refused}}; };
  std::optional<ExitCode> worst;  // of the first that was refused
  for (const std::uint32_t id : units) {
    Json args = question.args;
    args["unit_id"] = id;
    auto answer = Ask(
        context,
        {.verb = question.verb, .args = std::move(args), .long_lasting = question.long_lasting});
    if (!answer) {
      const Failure& failure = answer.error();
      if (!failure.answered && !single && context.json) PrintJson(so_far());
      if (single || !failure.answered) return Report(context, failure);
      // Many texts begin with their unit; all others need it here.
      const std::string name = fmt::format("unit {}", id);
      const std::string& text = failure.error.text;
      Complain(fmt::format("focalfleet: {}{}\n", text.starts_with(name) ? "" : name + ": ", text));
      refused.push_back({{"unit_id", id}, {"code", CodeName(failure.error.code)}, {"text", text}});
      worst = worst.value_or(failure.exit);
      continue;
    }
    if (!question.tell(id, &*answer)) worst = worst.value_or(ExitCode::kSomeUnserved);
    if (!single) (*answer)["unit_id"] = id;
    served.push_back(std::move(*answer));
  }
  if (context.json) PrintJson(single ? served.front() : so_far());
  if (!worst) return ExitCode::kOk;
  if (single) return *worst;
  if (!refused.empty())
    Complain(fmt::format("focalfleet: {} of {} refused\n", refused.size(),
                         Count(units.size(), "unit", "units")));
  return served.empty() ? *worst : ExitCode::kSomeUnserved;
}

}  // namespace focalfleet::cli
