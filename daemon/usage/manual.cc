#include "daemon/usage/manual.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "daemon/usage/option_text.h"
#include "daemon/usage/roff.h"

namespace focalfleet::usage {
namespace {

using Items = std::vector<std::pair<std::string, std::string>>;

std::string Reference(const std::string& page, int section) {
  return fmt::format("{}({})", page, section);
}

/// The text without the indent of help's examples.
std::string Unindented(const std::string& text) {
  return CLI::detail::find_and_replace(text.starts_with("  ") ? text.substr(2) : text, "\n  ",
                                       "\n");
}

std::size_t WordsIn(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count(text, ' ')) + 1;
}

void PutItems(const char* section, const Items& items, Roff* page) {
  if (items.empty()) return;
  page->Section(section);
  for (const auto& [tag, text] : items) page->Item(tag, "", text);
}

void PutOptions(const std::vector<const CLI::Option*>& options, Roff* page) {
  for (const CLI::Option* option : options) {
    const OptionText text = TextOf(*option);
    page->Item(text.names, text.value, Described(text) + ".");
  }
}

void PutCommands(const CLI::App& app, const ManualFrame& frame, Roff* page) {
  for (const CLI::App* command : app.get_subcommands({})) {
    const std::string name = frame.closing.page_a_command
                                 ? Reference(ManualPageOf(*command, frame.closing), frame.section)
                                 : command->get_name();
    page->Item(name, "", command->get_description() + ".");
  }
}

/// Arguments, options and examples of a command below another, under its own heading.
void PutSubsection(const CLI::App& command, Roff* page) {
  page->Subsection(PathOf(command));
  page->Paragraph(command.get_description() + ".");
  page->Usage(SynopsisOf(command), WordsIn(PathOf(command)));
  PutOptions(ArgumentsOf(command), page);
  PutOptions(OptionsOf(command), page);
  if (!command.get_footer().empty()) page->Literal(Unindented(command.get_footer()));
}

void PutSynopsis(const CLI::App& app, Roff* page) {
  page->Section("SYNOPSIS");
  const auto commands = app.get_subcommands({});
  const bool is_program = app.get_parent() == nullptr;
  if (is_program || RunsByItself(app)) page->Usage(SynopsisOf(app), WordsIn(PathOf(app)));
  if (is_program) return;
  for (const CLI::App* command : commands)
    page->Usage(SynopsisOf(*command), WordsIn(PathOf(*command)));
}

ManualPage PageOf(const CLI::App& command, const ManualFrame& frame) {
  const std::string name = ManualPageOf(command, frame.closing);
  Roff page({name, frame.section, frame.closing.manual + " " + frame.version, "focalfleet manual"},
            command.get_description());
  PutSynopsis(command, &page);
  page.Section("DESCRIPTION");
  page.Paragraph(command.get_description() + ".");
  page.Paragraph(frame.closing.of_commands);
  const auto below = command.get_subcommands({});
  if (RunsByItself(command)) {
    if (!ArgumentsOf(command).empty()) page.Section("ARGUMENTS");
    PutOptions(ArgumentsOf(command), &page);
    page.Section("OPTIONS");
    PutOptions(OptionsOf(command), &page);
    page.Section("EXAMPLES");
    page.Literal(Unindented(command.get_footer()));
  }
  if (!below.empty()) page.Section("COMMANDS");
  for (const CLI::App* child : below) PutSubsection(*child, &page);
  PutItems("EXIT STATUS", frame.exit_codes, &page);
  page.Section("SEE ALSO");
  page.References(Reference(frame.closing.manual, frame.section) + ", " + frame.see_also);
  return {fmt::format("{}.{}", name, frame.section), page.text()};
}

ManualPage ProgramPage(const CLI::App& program, const ManualFrame& frame) {
  Roff page({frame.closing.manual, frame.section, frame.closing.manual + " " + frame.version,
             "focalfleet manual"},
            program.get_description());
  PutSynopsis(program, &page);
  page.Section("DESCRIPTION");
  for (const std::string& paragraph : frame.description) page.Paragraph(paragraph);
  page.Section("OPTIONS");
  PutOptions(OptionsOf(program), &page);
  const auto commands = program.get_subcommands({});
  if (!commands.empty()) page.Section("COMMANDS");
  if (frame.closing.page_a_command) {
    PutCommands(program, frame, &page);
  } else {
    for (const CLI::App* command : commands) PutSubsection(*command, &page);
  }
  PutItems("EXIT STATUS", frame.exit_codes, &page);
  PutItems("ENVIRONMENT", frame.environment, &page);
  PutItems("FILES", frame.files, &page);
  page.Section("SEE ALSO");
  page.References(frame.see_also);
  return {fmt::format("{}.{}", frame.closing.manual, frame.section), page.text()};
}

}  // namespace

std::vector<ManualPage> ManualOf(const CLI::App& program, const ManualFrame& frame) {
  std::vector<ManualPage> pages = {ProgramPage(program, frame)};
  if (!frame.closing.page_a_command) return pages;
  for (const CLI::App* command : program.get_subcommands({}))
    pages.push_back(PageOf(*command, frame));
  return pages;
}

}  // namespace focalfleet::usage
