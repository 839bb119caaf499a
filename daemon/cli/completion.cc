#include "daemon/cli/completion.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "daemon/cli/command_line.h"

namespace focalfleet::cli {
namespace {

// The type name that help shows gives the kind of value: FILE, {one,of}, TEXT, INT ...
CompletionValue ValueOf(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return {};
  const std::string type = option.get_type_name();
  if (type == "FILE") return {CompletionValue::Kind::kFile, {}};
  if (type.size() >= 2 && type.front() == '{' && type.back() == '}') {
    return {CompletionValue::Kind::kWords,
            CLI::detail::split(type.substr(1, type.size() - 2), ',')};
  }
  return {CompletionValue::Kind::kAny, {}};
}

void AddOptions(const CLI::App& app, CompletionNode* node) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional()) continue;
    CompletionNode::OptionEntry entry{{}, option->get_description(), ValueOf(*option)};
    for (const std::string& name : option->get_lnames()) entry.names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) entry.names.push_back("-" + name);
    const bool known = std::any_of(
        node->options.begin(), node->options.end(),
        [&](const CompletionNode::OptionEntry& other) { return other.names == entry.names; });
    if (!known) node->options.push_back(std::move(entry));
  }
}

void Walk(const CLI::App& app, const std::string& path, std::vector<CompletionNode>* nodes) {
  CompletionNode node;
  node.path = path;
  for (const CLI::App* above = &app; above != nullptr; above = above->get_parent()) {
    AddOptions(*above, &node);
  }
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_positional()) continue;
    node.arguments.push_back(ValueOf(*option));
    node.last_repeats = option->get_items_expected_max() > 1;
  }
  const auto children = app.get_subcommands([](const CLI::App*) { return true; });
  for (const CLI::App* child : children) {
    node.commands.push_back({child->get_name(), child->get_description()});
  }
  nodes->push_back(std::move(node));
  for (const CLI::App* child : children) {
    Walk(*child, path.empty() ? child->get_name() : path + " " + child->get_name(), nodes);
  }
}

std::string ShellQuote(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

std::string FirstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

// The text `word:what` as zsh's _describe reads it; bash has no place for the description.
std::string Described(const std::string& word, const std::string& what, bool with_descriptions) {
  if (!with_descriptions) return word;
  std::string escaped;
  for (const char c : FirstLine(what)) {
    if (c == ':' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return word + ":" + escaped;
}

struct Table {
  const char* name;
  std::string bash;  // assignments
  std::string zsh;   // key value pairs: zsh takes the quotes of a subscript literally
};

void Put(Table* table, const std::string& key, const std::string& value) {
  table->bash += fmt::format("{}[{}]={}\n", table->name, ShellQuote(key), ShellQuote(value));
  table->zsh += fmt::format("  {} {}\n", ShellQuote(key), ShellQuote(value));
}

std::string Tables(const std::vector<CompletionNode>& nodes, bool zsh) {
  Table commands{"_focalfleet_commands", "", ""};
  Table options{"_focalfleet_options", "", ""};
  Table values{"_focalfleet_values", "", ""};
  Table arguments{"_focalfleet_arguments", "", ""};
  for (const CompletionNode& node : nodes) {
    const std::string key = "/" + node.path;
    std::vector<std::string> words;
    for (const auto& child : node.commands) words.push_back(Described(child.word, child.what, zsh));
    Put(&commands, key, fmt::format("{}", fmt::join(words, "\n")));
    words.clear();
    for (const auto& option : node.options) {
      for (const std::string& name : option.names) {
        words.push_back(Described(name, option.what, zsh));
        if (option.value.kind == CompletionValue::Kind::kNone) continue;
        Put(&values, key + " " + name, Spell(option.value));
      }
    }
    Put(&options, key, fmt::format("{}", fmt::join(words, "\n")));
    words.clear();
    for (const CompletionValue& argument : node.arguments) words.push_back(Spell(argument));
    if (node.last_repeats) words.emplace_back("@repeat");
    Put(&arguments, key, fmt::format("{}", fmt::join(words, " ")));
  }
  std::string script;
  for (const Table* table : {&commands, &options, &values, &arguments}) {
    script += zsh ? fmt::format("typeset -gA {}\n{}=(\n{})\n", table->name, table->name, table->zsh)
                  : fmt::format("declare -gA {}\n{}", table->name, table->bash);
  }
  return script;
}

// Finds the cursor's place in the tree: walks the words before it, skips the values of options, and
// counts arguments.
constexpr const char* kBashLogic = R"bash(
_focalfleet() {
  local IFS=$' \t\n'
  local current=${COMP_WORDS[COMP_CWORD]} path=/ given=0 expect='' word i
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; ++i)); do
    word=${COMP_WORDS[i]}
    if [[ -n $expect ]]; then
      expect=''
    elif [[ $word == -* ]]; then
      expect=${_focalfleet_values["$path $word"]-}
    elif [[ $'\n'"${_focalfleet_commands[$path]-}"$'\n' == *$'\n'"$word"$'\n'* ]]; then
      if [[ $path == / ]]; then path=/$word; else path="$path $word"; fi
      given=0
    else
      given=$((given + 1))
    fi
  done
  if [[ -z $expect && $current == -* ]]; then
    COMPREPLY=($(compgen -W "${_focalfleet_options[$path]-}" -- "$current"))
    return
  fi
  if [[ -z $expect ]]; then
    COMPREPLY=($(compgen -W "${_focalfleet_commands[$path]-}" -- "$current"))
    local arguments=(${_focalfleet_arguments[$path]-}) last
    last=$((${#arguments[@]} - 1))
    if ((last >= 0)) && [[ ${arguments[last]} == @repeat ]]; then
      last=$((last - 1))
      ((given > last)) && given=$last
    fi
    ((given <= last)) && expect=${arguments[given]}
  fi
  case $expect in
    '' | @any) ;;
    @file)
      compopt -o filenames 2>/dev/null
      local IFS=$'\n'
      COMPREPLY+=($(compgen -f -- "$current"))
      ;;
    *) COMPREPLY+=($(compgen -W "${expect//,/ }" -- "$current")) ;;
  esac
}
complete -F _focalfleet focalfleet
)bash";

constexpr const char* kZshLogic = R"zsh(
_focalfleet() {
  local current=${words[CURRENT]} path_of=/ expect='' word
  integer given=0 i last
  local -a commands options arguments
  for ((i = 2; i < CURRENT; ++i)); do
    word=${words[i]}
    commands=("${(@f)_focalfleet_commands[$path_of]}")
    if [[ -n $expect ]]; then
      expect=''
    elif [[ $word == -* ]]; then
      expect=${_focalfleet_values[$path_of $word]}
    elif (( ${commands[(I)$word:*]} )); then
      if [[ $path_of == / ]]; then path_of=/$word; else path_of="$path_of $word"; fi
      given=0
    else
      given=$((given + 1))
    fi
  done
  if [[ -z $expect && $current == -* ]]; then
    options=("${(@f)_focalfleet_options[$path_of]}")
    _describe -o option options
    return
  fi
  if [[ -z $expect ]]; then
    commands=("${(@f)_focalfleet_commands[$path_of]}")
    [[ -n ${commands[1]} ]] && _describe command commands
    arguments=(${=_focalfleet_arguments[$path_of]})
    last=${#arguments}
    if (( last > 0 )) && [[ ${arguments[last]} == @repeat ]]; then
      last=$((last - 1))
      (( given >= last )) && given=$((last - 1))
    fi
    (( given < last )) && expect=${arguments[given + 1]}
  fi
  case $expect in
    '' | @any) ;;
    @file) _files ;;
    *) compadd -- ${(s:,:)expect} ;;
  esac
}
if (( ${funcstack[(I)_focalfleet]} )); then
  _focalfleet "$@"  # loaded by the first tab, which still waits for its answer
elif (( $+functions[compdef] )); then
  compdef _focalfleet focalfleet
fi
)zsh";

struct CompletionOptions {
  AddStudy add_study = nullptr;
  std::string shell;
};

ExitCode RunCompletion(const Context& context, const CompletionOptions& options) {
  const std::unique_ptr<CommandLine> line = MakeCommandLine(options.add_study);
  const std::string script = options.shell == "fish"  ? FishCompletion(line->app)
                             : options.shell == "zsh" ? ZshCompletion(line->app)
                                                      : BashCompletion(line->app);
  if (context.json) {
    PrintJson({{"shell", options.shell}, {"script", script}});
  } else {
    PrintText(script);
  }
  return ExitCode::kOk;
}

}  // namespace

std::string Spell(const CompletionValue& value) {
  switch (value.kind) {
    case CompletionValue::Kind::kNone:
      return "";
    case CompletionValue::Kind::kFile:
      return "@file";
    case CompletionValue::Kind::kAny:
      return "@any";
    case CompletionValue::Kind::kWords:
      return fmt::format("{}", fmt::join(value.words, ","));
  }
  return "";
}

std::vector<CompletionNode> WalkCommands(const CLI::App& app) {
  std::vector<CompletionNode> nodes;
  Walk(app, "", &nodes);
  return nodes;
}

std::string BashCompletion(const CLI::App& app) {
  return "# bash completion for focalfleet, written by `focalfleet completion bash`\n" +
         Tables(WalkCommands(app), false) + kBashLogic;
}

std::string ZshCompletion(const CLI::App& app) {
  return "#compdef focalfleet\n"
         "# zsh completion for focalfleet, written by `focalfleet completion zsh`\n" +
         Tables(WalkCommands(app), true) + kZshLogic;
}

void AddCompletionCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "completion", "Print the tab completion script of a shell",
                 "  source <(focalfleet completion bash)\n"
                 "  focalfleet completion zsh > ~/.zfunc/_focalfleet\n"
                 "  focalfleet completion fish > ~/.config/fish/completions/focalfleet.fish");
  auto options = std::make_shared<CompletionOptions>();
  options->add_study = line->add_study;
  OneOf(command->add_option("shell", options->shell, "Which shell"), {"bash", "zsh", "fish"})
      ->required();
  OnChosen(line, command, options, RunCompletion);
}

}  // namespace focalfleet::cli
