// Tab completion for bash, zsh and fish is generated from the tree of commands itself. A new
// command or option is therefore completed as soon as it exists. The script holds three tables, by
// the path of a command ("params", "layout hex"). They list its subcommands, its options, and what
// may follow an option or stand as an argument.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace focalfleet::cli {

/// The permitted values of the word after an option, or of an argument.
struct CompletionValue {
  enum class Kind { kNone, kFile, kWords, kAny } kind = Kind::kNone;
  std::vector<std::string> words;
};

struct CompletionNode {
  struct Word {
    std::string word;
    std::string what;
  };
  struct OptionEntry {
    std::vector<std::string> names;  // such as "--out", "-q"
    std::string what;
    CompletionValue value;  // kNone: a flag
  };
  std::string path;  // "" for the program, or such as "layout hex"
  std::vector<Word> commands;
  std::vector<OptionEntry> options;        // its own, then those of the commands above it
  std::vector<CompletionValue> arguments;  // in order
  bool last_repeats = false;               // the last argument takes any number of words
};

/// All commands in order: the program first, children after their parent.
std::vector<CompletionNode> WalkCommands(const CLI::App& app);

std::string BashCompletion(const CLI::App& app);
std::string ZshCompletion(const CLI::App& app);
std::string FishCompletion(const CLI::App& app);

/// The value as one word for the tables of a script: @file, @any, or the words with commas.
std::string Spell(const CompletionValue& value);

}  // namespace focalfleet::cli
