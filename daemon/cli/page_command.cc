// The command page shows where the operators' page is, and opens it in a browser.

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <memory>
#include <string>

#include "daemon/cli/client.h"
#include "daemon/cli/operator_commands.h"

namespace focalfleet::cli {
namespace {

struct PageOptions {
  bool open = false;
};

/// The desktop's program for addresses has taken the address.
bool OpenInBrowser(std::string address) {
  std::string program = "xdg-open";
  char* const arguments[] = {program.data(), address.data(), nullptr};
  pid_t child = 0;
  if (::posix_spawnp(&child, program.c_str(), nullptr, nullptr, arguments, environ) != 0)
    return false;
  int status = 0;
  return ::waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

ExitCode RunPage(const Context& context, const PageOptions& options) {
  const auto status = Ask(context, {.verb = "status"});
  if (!status) return Report(context, status.error());
  const std::string address = TextIn(*status, "page");
  if (address.empty())
    return Report(context, {ErrorCode::kRefused,
                            "the daemon has no HTTP door: give [http] a port (docs/page.md)"});
  if (context.json) PrintJson({{"page", address}});
  Say(context, address);
  if (options.open && !OpenInBrowser(address))
    return Report(context, {ErrorCode::kUnavailable, "no browser opened " + address});
  return ExitCode::kOk;
}

}  // namespace

void AddPageCommand(CommandLine* line) {
  CLI::App* page = AddCommand(&line->app, "page", "Show the address of the operators' page",
                              "  focalfleet page\n"
                              "  focalfleet page --open");
  const auto options = std::make_shared<PageOptions>();
  page->add_flag("--open", options->open, "Open it in this desktop's browser");
  OnChosen(line, page, options, RunPage);
}

}  // namespace focalfleet::cli
