#include "daemon/usage/option_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace focalfleet::usage {
namespace {

// A longer list of words is a remark, and the placeholder stands for it.
constexpr std::size_t kPlaceholderMax = 40;

std::string Placeholder(std::string_view type) {
  if (type == "UINT" || type == "INT") return "N";
  if (type == "FLOAT") return "NUMBER";
  return std::string(type);
}

/// " to 10", " to 1000000" of 1e+06; empty for a limit that only the type sets.
std::string UpTo(const std::string& limit) {
  constexpr double kNoLimit = 1e15;
  double value = 0;
  if (!CLI::detail::lexical_cast(limit, value)) return " to " + limit;
  return value < kNoLimit ? fmt::format(" to {:.12g}", value) : "";
}

/// The check in words: `INT in [0 - 10]` as CLI11 has it becomes `N from 0 to 10`.
std::string InWords(const std::string& check, const std::string& placeholder) {
  const std::size_t open = check.find(" in [");
  const std::size_t to = check.find(" - ", open);
  if (open != std::string::npos && to != std::string::npos && check.back() == ']') {
    const std::size_t low = open + 5;
    return fmt::format("{} from {}{}", placeholder, check.substr(low, to - low),
                       UpTo(check.substr(to + 3, check.size() - to - 4)));
  }
  if (check == "POSITIVE") return placeholder + " above 0";
  if (check.front() == '{') return "one of " + check.substr(1, check.size() - 2);
  return placeholder + " " + check;
}

std::vector<std::string> NamesOf(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options) names.push_back(option->get_name());
  std::ranges::sort(names);  // the set is in the order of addresses
  return names;
}

/// The type and each check of the option.
std::vector<std::string> PartsOf(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t end = type.front() == '{' ? type.find('}') : type.find(':');
  std::vector<std::string> parts = {type.substr(0, type.front() == '{' ? end + 1 : end)};
  const std::size_t rest = type.find(':', parts.front().size());
  if (rest != std::string::npos) parts.push_back(type.substr(rest + 1));
  return parts;
}

void TakeValue(const CLI::Option& option, OptionText* text) {
  if (option.get_type_name().empty()) return;
  std::vector<std::string> parts = PartsOf(option);
  text->value = Placeholder(parts.front());
  if (text->value.front() == '{') {
    std::string words = text->value.substr(1, text->value.size() - 2);
    std::ranges::replace(words, ',', '|');
    text->value = words.size() > kPlaceholderMax ? "WORD" : words;
    if (words.size() > kPlaceholderMax) {
      text->remarks.push_back("one of " + CLI::detail::find_and_replace(words, "|", ", "));
    }
  }
  if (parts.size() > 1) text->remarks.push_back(InWords(parts[1], text->value));
}

}  // namespace

OptionText TextOf(const CLI::Option& option) {
  OptionText text{.description = option.get_description()};
  if (option.get_items_expected_max() != 0 && option.get_option_text().empty())
    TakeValue(option, &text);
  const bool repeats = option.get_items_expected_max() > 1;
  if (option.get_positional()) {
    text.names = option.get_name(true) + (repeats ? "..." : "");
    // The name says it already, unless it is a choice.
    if (text.value.find('|') != std::string::npos)
      text.remarks.insert(text.remarks.begin(), text.value);
    text.value.clear();
  } else {
    std::vector<std::string> names;
    for (const std::string& name : option.get_snames()) names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
    text.names = fmt::format("{}", fmt::join(names, ", "));
    if (repeats && !text.value.empty()) text.value += "...";
  }
  if (!option.get_default_str().empty())
    text.remarks.push_back("default " + option.get_default_str());
  if (option.get_required()) text.remarks.insert(text.remarks.begin(), "required");
  if (!option.get_needs().empty())
    text.remarks.push_back(fmt::format("with {}", fmt::join(NamesOf(option.get_needs()), ", ")));
  if (!option.get_excludes().empty())
    text.remarks.push_back(
        fmt::format("not with {}", fmt::join(NamesOf(option.get_excludes()), ", ")));
  return text;
}

std::string Described(const OptionText& text) {
  if (text.remarks.empty()) return text.description;
  const std::string remarks = fmt::format("{})", fmt::join(text.remarks, "; "));
  // A description that ends with a parenthesis gets no second one.
  if (!text.description.ends_with(')')) return text.description + " (" + remarks;
  return text.description.substr(0, text.description.size() - 1) + "; " + remarks;
}

std::vector<const CLI::Option*> OptionsOf(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) { return option->nonpositional(); });
}

std::vector<const CLI::Option*> ArgumentsOf(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) { return option->get_positional(); });
}

std::string PathOf(const CLI::App& app) {
  const CLI::App* parent = app.get_parent();
  return parent == nullptr ? app.get_name() : PathOf(*parent) + " " + app.get_name();
}

bool RunsByItself(const CLI::App& app) {
  return app.get_subcommands({}).empty() || app.get_require_subcommand_min() == 0;
}

std::string SynopsisOf(const CLI::App& app) {
  std::string line = PathOf(app);
  for (const CLI::Option* option : OptionsOf(app)) {
    if (!option->get_required()) continue;
    line += fmt::format(" --{} {}", option->get_lnames().front(), TextOf(*option).value);
  }
  line += " [OPTIONS]";
  const bool has_commands = !app.get_subcommands({}).empty();
  if (has_commands) line += app.get_require_subcommand_min() > 0 ? " COMMAND" : " [COMMAND]";
  for (const CLI::Option* argument : ArgumentsOf(app)) {
    const std::string name = TextOf(*argument).names;
    line += argument->get_required() ? " " + name : " [" + name + "]";
  }
  return line;
}

}  // namespace focalfleet::usage
