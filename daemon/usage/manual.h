// Man pages out of a tree of commands: the page of the program, and one a command, with the same
// words as the help. A command with commands of its own has them as subsections of its page.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

#include "daemon/usage/help.h"

namespace focalfleet::usage {

struct ManualPage {
  std::string file;  // "focalfleet-plan.1"
  std::string roff;
};

struct ManualFrame {
  HelpClosing closing;
  int section = 1;
  std::string version;                   // "0.1.0"
  std::vector<std::string> description;  // of the program, a paragraph each
  std::vector<std::pair<std::string, std::string>> exit_codes;
  std::vector<std::pair<std::string, std::string>> environment;
  std::vector<std::pair<std::string, std::string>> files;
  std::string see_also;  // "focalfleetd(8), focalfleet.toml(5)"
};

/// The pages of the program, its own first.
std::vector<ManualPage> ManualOf(const CLI::App& program, const ManualFrame& frame);

}  // namespace focalfleet::usage
