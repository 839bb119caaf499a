#include <fmt/format.h>

#include <string_view>

#include "daemon/cli/completion.h"

namespace focalfleet::cli {
namespace {

std::string Quote(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "'";
}

/// A function that prints the entry of a table: a case for each key.
class FishTable {
 public:
  explicit FishTable(std::string_view name)
      : text_(fmt::format("function {}\n  switch \"$argv[1]\"\n", name)) {}
  void Put(const std::string& key, const std::vector<std::string>& lines) {
    if (lines.empty()) return;
    text_ += fmt::format("    case {}\n      printf '%b\\n'", Quote(key));
    for (const std::string& line : lines) text_ += " " + Quote(line);
    text_ += "\n";
  }
  [[nodiscard]] std::string End() const { return text_ + "  end\nend\n"; }

 private:
  std::string text_;
};

/// The word and its description; printf makes the tab between them from an escape.
std::string WithDescription(const std::string& word, const std::string& what) {
  std::string text = word + "\\t";
  for (const char c : what.substr(0, what.find('\n')))
    text += c == '\\' ? "\\\\" : std::string(1, c);
  return text;
}

std::string Tables(const std::vector<CompletionNode>& nodes) {
  FishTable commands("__focalfleet_commands"), options("__focalfleet_options");
  FishTable values("__focalfleet_values"), arguments("__focalfleet_arguments");
  for (const CompletionNode& node : nodes) {
    const std::string key = "/" + node.path;
    std::vector<std::string> lines;
    for (const auto& child : node.commands)
      lines.push_back(WithDescription(child.word, child.what));
    commands.Put(key, lines);
    lines.clear();
    for (const auto& option : node.options) {
      for (const std::string& name : option.names) {
        lines.push_back(WithDescription(name, option.what));
        if (option.value.kind != CompletionValue::Kind::kNone)
          values.Put(key + " " + name, {Spell(option.value)});
      }
    }
    options.Put(key, lines);
    lines.clear();
    for (const CompletionValue& argument : node.arguments) lines.push_back(Spell(argument));
    if (node.last_repeats) lines.emplace_back("@repeat");
    arguments.Put(key, lines);
  }
  return commands.End() + options.End() + values.End() + arguments.End();
}

// Finds the cursor's place in the tree as the scripts of the other shells do.
constexpr const char* kLogic = R"fish(
function __focalfleet
  set -l words (commandline -opc)
  set -l current (commandline -ct)
  set -l path /
  set -l given 0
  set -l expect ''
  for word in $words[2..-1]
    if test -n "$expect"
      set expect ''
    else if string match -q -- '-*' $word
      set expect (__focalfleet_values "$path $word")
    else if contains -- $word (__focalfleet_commands $path | string replace -r '\t.*' '')
      test $path = /; and set path /$word; or set path "$path $word"
      set given 0
    else
      set given (math $given + 1)
    end
  end
  if test -z "$expect"
    if string match -q -- '-*' $current
      __focalfleet_options $path
      return
    end
    __focalfleet_commands $path
    set -l arguments (__focalfleet_arguments $path)
    set -l last (count $arguments)
    if test $last -gt 0; and test $arguments[$last] = @repeat
      set last (math $last - 1)
      test $given -ge $last; and set given (math $last - 1)
    end
    test $given -lt $last; and set expect $arguments[(math $given + 1)]
  end
  switch "$expect"
    case '' @any
    case @file
      __fish_complete_path $current
    case '*'
      string split , -- $expect
  end
end
complete -c focalfleet -f -a '(__focalfleet)'
)fish";

}  // namespace

std::string FishCompletion(const CLI::App& app) {
  return "# fish completion for focalfleet, written by `focalfleet completion fish`\n" +
         Tables(WalkCommands(app)) + kLogic;
}

}  // namespace focalfleet::cli
