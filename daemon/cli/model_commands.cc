// The commands model load, show, unload and rollback manage the model of a campaign through which
// blind commands go.

#include <fmt/format.h>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/confirm.h"
#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "protocol/base/limits.h"

namespace focalfleet::cli {
namespace {

std::string Short(const std::string& sha256) { return sha256.substr(0, 12); }

std::string Micrometres(const Json& row, const char* key) {
  const double um = NumberIn(row, key, -1);
  return um < 0 ? "?" : fmt::format("{:.1f}", um);
}

std::string EffectTable(const Json& model) {
  std::vector<std::vector<std::string>> rows = {
      {"effect", "axis", "units", "median", "+-", "unit", "or"}};
  for (const Json& effect : ListIn(model, "effects")) {
    std::string rivals;
    for (const Json& rival : ListIn(effect, "candidates")) {
      const std::string name = TextOf(rival);
      if (name != TextIn(effect, "cause")) rivals += (rivals.empty() ? "" : ", ") + name;
    }
    rows.push_back({TextIn(effect, "cause"), TextIn(effect, "axis"),
                    std::to_string(CountIn(effect, "units")),
                    fmt::format("{:.4g}", NumberIn(effect, "amplitude_median")),
                    fmt::format("{:.2g}", NumberIn(effect, "sigma_median")),
                    TextIn(effect, "amplitude_unit"), rivals.empty() ? "-" : rivals});
  }
  return (rows.size() == 1 ? "geometry of the units alone" : AlignColumns(rows)) + "\n";
}

std::string ChangeTable(const Json& answer) {
  std::vector<std::vector<std::string>> rows = {
      {"change", "at", "model", "sha256", "um before", "um after", "restores"}};
  for (const Json& change : ListIn(answer, "changes")) {
    const std::string sha256 = TextIn(change, "sha256");
    const std::uint64_t restores = CountIn(change, "restores");
    rows.push_back({std::to_string(CountIn(change, "entry")), TextIn(change, "at"),
                    sha256.empty() ? "none" : TextIn(change, "name"),
                    sha256.empty() ? "-" : Short(sha256), Micrometres(change, "rms_before_um"),
                    Micrometres(change, "rms_after_um"),
                    restores == 0 ? "-" : std::to_string(restores)});
  }
  return AlignColumns(rows) + "\n";
}

// The model's causes that commands cannot compensate; empty: none.
std::string NotCompensated(const Json& in_force) {
  std::string left_out;
  for (const Json& cause : ListIn(in_force, "left_out"))
    if (cause.is_string()) left_out += (left_out.empty() ? "" : ", ") + TextOf(cause);
  return left_out.empty() ? "" : "not compensated: " + left_out;
}

struct NoOptions {};

ExitCode RunShow(const Context& context, const NoOptions&) {
  const auto answer = Ask(context, {.verb = "model"});
  if (!answer) return Report(context, answer.error());
  if (context.json) {
    PrintJson(*answer);
    return ExitCode::kOk;
  }
  const auto in_force = answer->find("in_force");
  if (in_force == answer->end() || !in_force->is_object()) {
    PrintText("no model is in force: commands go as they are\n");
  } else {
    PrintText(fmt::format("{} ({}) of campaign {}: {} of {} um rms remain, {} units\n",
                          TextIn(*in_force, "name"), Short(TextIn(*in_force, "sha256")),
                          TextIn(*in_force, "campaign"), Micrometres(*in_force, "rms_after_um"),
                          Micrometres(*in_force, "rms_before_um"), CountIn(*in_force, "units")));
    PrintText(EffectTable(*in_force));
    if (const std::string left_out = NotCompensated(*in_force); !left_out.empty())
      PrintText(left_out + "\n");
  }
  if (!ListIn(*answer, "changes").empty()) PrintText(ChangeTable(*answer));
  return ExitCode::kOk;
}

ExitCode Change(const Context& context, const char* verb, const Json& args) {
  const auto done = Ask(context, {.verb = verb, .args = args});
  if (!done) return Report(context, done.error());
  const auto answer = Ask(context, {.verb = "model"});
  if (!answer) return Report(context, answer.error());
  if (context.json) PrintJson(*answer);
  const auto in_force = answer->find("in_force");
  const bool any = in_force != answer->end() && in_force->is_object();
  Say(context, any ? fmt::format("{} ({}) is in force, of {} units", TextIn(*in_force, "name"),
                                 Short(TextIn(*in_force, "sha256")), CountIn(*in_force, "units"))
                   : std::string("no model is in force"));
  if (const std::string left_out = any ? NotCompensated(*in_force) : ""; !left_out.empty())
    Say(context, left_out);
  return ExitCode::kOk;
}

struct LoadOptions {
  std::string file;
  bool yes = false;
};

ExitCode RunLoad(const Context& context, const LoadOptions& options) {
  const std::string& file = options.file;
  const auto text = ReadTextFile(file);
  if (!text) return Report(context, text.error());
  // The rest of the line and the escapes of its text must fit, too.
  if (text->size() > limits::kModelLineBytes / 2)
    return Report(context, {ErrorCode::kInvalid,
                            fmt::format("{}: {} bytes; the daemon takes at most {}", file,
                                        text->size(), limits::kModelLineBytes / 2)});
  constexpr const char* kWhat = "from now on blind commands go through another model";
  if (const auto refused = Refused(kWhat, options.yes)) return Report(context, *refused);
  return Change(context, "model_load", {{"model_toml", *text}, {"source", SourceOf(file)}});
}

ExitCode RunUnload(const Context& context, const NoOptions&) {
  return Change(context, "model_unload", Json::object());
}

ExitCode RunRollback(const Context& context, const NoOptions&) {
  return Change(context, "model_rollback", Json::object());
}

}  // namespace

void AddModelCommands(CommandLine* line) {
  CLI::App* model =
      AddCommand(&line->app, "model", "The model of a campaign that blind commands go through",
                 "  focalfleet model load night-12-report/model.toml --yes\n"
                 "  focalfleet model show");
  model->require_subcommand(1);
  CLI::App* load =
      AddCommand(model, "load", "Check a model.toml of `focalfleet diagnose`; from now on it holds",
                 "  focalfleet model load night-12-report/model.toml --yes");
  auto options = std::make_shared<LoadOptions>();
  AddFile(load, "FILE", &options->file, "model.toml")->required();
  load->add_flag("--yes", options->yes, "Do not ask on a terminal");
  OnChosen(line, load, options, RunLoad);
  CLI::App* show =
      AddCommand(model, "show", "What holds, how well it is known, and what held before",
                 "  focalfleet model show --json");
  OnChosen(line, show, std::make_shared<NoOptions>(), RunShow);
  CLI::App* unload = AddCommand(model, "unload", "From now on commands go as they are",
                                "  focalfleet model unload");
  OnChosen(line, unload, std::make_shared<NoOptions>(), RunUnload);
  CLI::App* rollback =
      AddCommand(model, "rollback", "Back to what held before", "  focalfleet model rollback");
  OnChosen(line, rollback, std::make_shared<NoOptions>(), RunRollback);
}

}  // namespace focalfleet::cli
