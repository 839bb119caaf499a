#include "daemon/cli/unit_choice.h"

#include <fmt/format.h>

#include <utility>

#include "daemon/control/id_ranges.h"

namespace focalfleet::cli {
namespace {

CLI::Validator Ranges() {
  return {[](const std::string& text) {
            const auto numbers = ParseRanges(text);
            return numbers ? std::string() : numbers.error().text;
          },
          ""};
}

}  // namespace

CLI::Option* AddUnitNumbers(CLI::App* command, UnitChoice* choice, const std::string& help) {
  return command->add_option("UNIT", choice->units, help)->check(Ranges());
}

void AddUnitChoice(CLI::App* command, UnitChoice* choice) {
  AddUnitNumbers(command, choice, "Their unit_ids: 7 9, or 7,20-25");
  command->add_option("--bus", choice->buses, "Only units on these buses: 3,5-7")->check(Ranges());
  command
      ->add_option("--state", choice->states,
                   "Only units in this state: a phase such as fault or silent, disabled, or "
                   "unknown (its place)")
      ->allow_extra_args(false);
}

tl::expected<std::vector<std::uint32_t>, Failure> ChosenUnits(const Context& context,
                                                              const UnitChoice& choice) {
  if (choice.empty())
    return tl::unexpected<Failure>(
        Failure{ExitCode::kUsage,
                {ErrorCode::kInvalid, "name units, such as 7,20-25, or say --bus or --state"}});
  std::vector<std::uint32_t> ids;
  for (const std::string& text : choice.units) {
    const auto numbers = ParseRanges(text);
    if (!numbers) return tl::unexpected<Failure>(Failure{ExitCode::kUsage, numbers.error()});
    ids.insert(ids.end(), numbers->begin(), numbers->end());
  }
  if (choice.buses.empty() && choice.states.empty()) return ids;
  Json args = Json::object();
  if (!ids.empty()) args["unit_ids"] = ids;
  if (!choice.states.empty()) args["states"] = choice.states;
  if (!choice.buses.empty()) {
    const auto buses = ParseRanges(choice.buses);
    if (!buses) return tl::unexpected<Failure>(Failure{ExitCode::kUsage, buses.error()});
    args["bus_ids"] = *buses;
  }
  const auto answer = Ask(context, {.verb = "select", .args = args});
  if (!answer) return tl::unexpected<Failure>(answer.error());
  ids.clear();
  for (const Json& id : ListIn(*answer, "unit_ids"))
    if (id.is_number_unsigned()) ids.push_back(id.get<std::uint32_t>());
  return ids;
}

}  // namespace focalfleet::cli
