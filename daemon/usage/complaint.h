// Complaint says in one sentence why a command line is not understood. A misspelt command or option
// comes with the nearest one that exists, by the number of letters to change, add, drop or swap
// (optimal string alignment distance).
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace focalfleet::usage {

/// The candidate nearest to the word; empty if none is near: a third of the letters may be wrong,
/// one at least. A word of three letters or more that begins one candidate alone is near, too.
std::string Nearest(std::string_view word, const std::vector<std::string>& candidates);

/// Letters to change, add, drop or swap with the next. Cost: product of the lengths.
std::size_t Distance(std::string_view a, std::string_view b);

/// The sentence for a line that was not understood, with a suggestion where there is one.
std::string Complaint(const CLI::App& program, const CLI::ParseError& error);

/// The deepest command of the tree that the command line named.
const CLI::App& Chosen(const CLI::App& program);

/// "there is no command 'stauts'; did you mean 'status'?" of the commands below `app`.
std::string NoSuchCommand(const CLI::App& app, const std::string& word);

}  // namespace focalfleet::usage
