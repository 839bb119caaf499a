#include "daemon/usage/help.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "daemon/usage/option_text.h"

namespace focalfleet::usage {
namespace {

constexpr std::size_t kWidth = 100;  // columns
constexpr std::size_t kLeft = 28;    // columns of names, before the descriptions

std::string Row(const std::string& left, const std::string& right) {
  std::string row = "  " + left;
  if (row.size() + 2 > kLeft) {
    row += "\n" + std::string(kLeft, ' ');
  } else {
    row.resize(kLeft, ' ');
  }
  return row + Wrapped(right, kLeft, kWidth) + "\n";
}

std::string Rows(const char* title, const std::vector<const CLI::Option*>& options) {
  if (options.empty()) return "";
  std::string text = fmt::format("\n{}:\n", title);
  for (const CLI::Option* option : options) {
    const OptionText words = TextOf(*option);
    text += Row(words.names + (words.value.empty() ? "" : " " + words.value), Described(words));
  }
  return text;
}

/// The commands below, by group in the order of their first member.
std::string Commands(const CLI::App& app) {
  std::vector<std::pair<std::string, std::string>> groups;
  for (const CLI::App* command : app.get_subcommands({})) {
    const std::string name =
        command->get_group() == "Subcommands" ? "Commands" : command->get_group();
    auto group = std::ranges::find(groups, name, &std::pair<std::string, std::string>::first);
    if (group == groups.end()) group = groups.insert(group, {name, ""});
    group->second += Row(command->get_name(), command->get_description());
  }
  std::string text;
  for (const auto& [name, rows] : groups) text += fmt::format("\n{}:\n{}", name, rows);
  return text;
}

}  // namespace

std::string Wrapped(std::string_view text, std::size_t indent, std::size_t width) {
  std::string out;
  std::size_t column = indent;
  for (const std::string& word : CLI::detail::split(std::string(text), ' ')) {
    if (column > indent && column + 1 + word.size() > width) {
      out += "\n" + std::string(indent, ' ');
      column = indent;
    } else if (column > indent) {
      out += " ";
      ++column;
    }
    out += word;
    column += word.size();
  }
  return out;
}

std::string ManualPageOf(const CLI::App& app, const HelpClosing& closing) {
  const CLI::App* command = &app;
  if (!closing.page_a_command || command->get_parent() == nullptr) return closing.manual;
  while (command->get_parent()->get_parent() != nullptr) command = command->get_parent();
  return closing.manual + "-" + command->get_name();
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string /*name*/,
                                     CLI::AppFormatMode /*mode*/) const {
  const bool is_program = app->get_parent() == nullptr;
  std::string text = Wrapped(app->get_description(), 0, kWidth) + "\n\n";
  text += "Usage: " + Wrapped(SynopsisOf(*app), 7, kWidth) + "\n";
  text += Commands(*app);
  text += Rows("Arguments", ArgumentsOf(*app));
  text += Rows("Options", OptionsOf(*app));
  if (!app->get_footer().empty())
    text += fmt::format("\n{}{}\n", is_program ? "" : "Examples:\n", app->get_footer());
  text += "\n";
  if (!is_program && !closing_.of_commands.empty())
    text += Wrapped(closing_.of_commands, 0, kWidth) + "\n";
  return text + fmt::format("Manual: man {}\n", ManualPageOf(*app, closing_));
}

std::string ShortHelp(const CLI::App& app) {
  return "Usage: " + SynopsisOf(app) + "\n" + Commands(app) +
         fmt::format("\n`{} --help` shows the options.\n", PathOf(app));
}

}  // namespace focalfleet::usage
