// OptionText is an option or argument in words: help and man pages show the same ones. CLI11 has
// the value as one text of type and checks, such as `UINT:INT in [0 - 10]`; here it becomes a
// placeholder, `N`, and a remark, `N from 0 to 10`.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace focalfleet::usage {

struct OptionText {
  std::string names;                 // "-q, --quiet"; of an argument its name, "UNIT..."
  std::string value;                 // "FILE", "N", "get|set"; empty: a flag or an argument
  std::string description;           // the effect, as the command states it
  std::vector<std::string> remarks;  // "required", "N from 0 to 10", "default 1"
};

OptionText TextOf(const CLI::Option& option);

/// The description with its remarks in parentheses.
std::string Described(const OptionText& text);

/// Options in the order of the command: those with a name, or the arguments.
std::vector<const CLI::Option*> OptionsOf(const CLI::App& app);
std::vector<const CLI::Option*> ArgumentsOf(const CLI::App& app);

/// The words of a command from the program on: "focalfleet layout hex".
std::string PathOf(const CLI::App& app);
/// Whether the command does something by itself, beside what its subcommands do.
bool RunsByItself(const CLI::App& app);

/// The usage line: path, required options, [OPTIONS], arguments or COMMAND.
std::string SynopsisOf(const CLI::App& app);

}  // namespace focalfleet::usage
