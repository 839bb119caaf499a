#include "daemon/usage/complaint.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "daemon/usage/option_text.h"

namespace focalfleet::usage {
namespace {

constexpr std::size_t kPrefixMin = 3;  // letters
constexpr std::size_t kWordMax = 64;   // letters; a longer word is no misspelling of a short one

std::string Question(const std::string& nearest) {
  return nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest);
}

/// Whether the word looks like an option; -1.5 is a number.
bool IsOption(const std::string& word) {
  return word.size() > 1 && word[0] == '-' &&
         (word[1] == '-' ? word.size() > 2
                         : std::isalpha(static_cast<unsigned char>(word[1])) != 0);
}

/// The options that may stand behind the command: its own, and those of the commands above.
std::vector<std::string> OptionNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* above = &app; above != nullptr; above = above->get_parent()) {
    for (const CLI::Option* option : OptionsOf(*above)) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  return names;
}

std::string NoSuchOption(const CLI::App& chosen, const std::string& word) {
  const std::string name = word.substr(0, word.find('='));
  return fmt::format("there is no option '{}'{}", name,
                     Question(Nearest(name, OptionNames(chosen))));
}

}  // namespace

std::size_t Distance(std::string_view a, std::string_view b) {
  const auto row = [&] { return std::vector<std::size_t>(b.size() + 1); };
  std::vector<std::size_t> before = row(), last = row(), now = row();
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    now[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      now[j] = std::min({changed, last[j] + 1, now[j - 1] + 1});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) now[j] = std::min(now[j], before[j - 2] + 1);
    }
    std::swap(before, last);
    std::swap(last, now);
  }
  return last[b.size()];
}

std::string Nearest(std::string_view word, const std::vector<std::string>& candidates) {
  if (word.size() > kWordMax) return "";
  std::string nearest;
  std::size_t least = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = Distance(word, candidate);
    if (distance >= least) continue;
    least = distance;
    nearest = candidate;
  }
  if (!nearest.empty() || word.size() < kPrefixMin) return nearest;
  const auto begins = [&](const std::string& candidate) { return candidate.starts_with(word); };
  return std::ranges::count_if(candidates, begins) == 1 ? *std::ranges::find_if(candidates, begins)
                                                        : "";
}

const CLI::App& Chosen(const CLI::App& program) {
  const CLI::App* chosen = &program;
  while (!chosen->get_subcommands().empty()) chosen = chosen->get_subcommands().front();
  return *chosen;
}

std::string NoSuchCommand(const CLI::App& app, const std::string& word) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  const std::string nearest = Nearest(word, names);
  const std::string above = app.get_parent() == nullptr ? "" : app.get_name() + " ";
  return fmt::format("there is no command '{}{}'{}", above, word,
                     Question(nearest.empty() ? "" : above + nearest));
}

std::string Complaint(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App& chosen = Chosen(program);
  const std::vector<std::string> words = program.remaining(true);
  // The first word that is not understood is the reason of the rest: a required option is missing
  // because it was misspelt.
  for (const std::string& word : words) {
    if (IsOption(word)) return NoSuchOption(chosen, word);
    if (!chosen.get_subcommands({}).empty()) return NoSuchCommand(chosen, word);
  }
  if (words.empty() && chosen.get_require_subcommand_min() > 0 &&
      dynamic_cast<const CLI::RequiredError*>(&error) != nullptr)
    return fmt::format("{}: a command is required", PathOf(chosen));
  return error.what();
}

}  // namespace focalfleet::usage
