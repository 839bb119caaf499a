// HelpFormatter writes the help of every program and command in one form: the description, the
// usage line, arguments, options and commands in columns, examples, and where to read on. The
// footer of a program is its exit codes; the footer of a command is its examples.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>

namespace focalfleet::usage {

struct HelpClosing {
  std::string of_commands;      // the last lines of each command's help
  std::string manual;           // the man page of the program, such as "focalfleet"
  bool page_a_command = false;  // a command has a page of its own: focalfleet-plan
};

class HelpFormatter : public CLI::Formatter {
 public:
  explicit HelpFormatter(HelpClosing closing) : closing_(std::move(closing)) {}
  [[nodiscard]] std::string make_help(const CLI::App* app, std::string name,
                                      CLI::AppFormatMode mode) const override;

 private:
  HelpClosing closing_;
};

/// A short help for a command line that names no command: the usage line and the commands.
std::string ShortHelp(const CLI::App& app);

/// The text in lines of at most `width` columns, each after the first behind `indent` blanks.
std::string Wrapped(std::string_view text, std::size_t indent, std::size_t width);

/// The man page that describes the command, such as "focalfleet-layout".
std::string ManualPageOf(const CLI::App& app, const HelpClosing& closing);

}  // namespace focalfleet::usage
