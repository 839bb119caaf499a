// The commands store check, store backup and store restore. They work on files, also while a daemon
// writes the store.

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "daemon/cli/command_line.h"
#include "daemon/store/store_copy.h"

namespace focalfleet::cli {
namespace {

struct CheckOptions {
  std::string file;
};

struct CopyOptions {
  std::string from;
  std::string to;
};

ExitCode RunCheck(const Context& context, const CheckOptions& options) {
  const auto health = CheckStore(options.file);
  if (!health) return Report(context, health.error());
  if (context.json)
    PrintJson({{"file", options.file},
               {"version", health->version},
               {"bytes", health->bytes},
               {"configurations", health->configurations},
               {"motions", health->motions}});
  Say(context,
      fmt::format("{}: sound, version {}, {} bytes, {}, {}", options.file, health->version,
                  health->bytes, Count(health->configurations, "configuration", "configurations"),
                  Count(health->motions, "motion", "motions")));
  return ExitCode::kOk;
}

ExitCode Answer(const Context& context, const CopyOptions& options, const char* what,
                const Status& done) {
  if (!done) return Report(context, done.error());
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(options.to, error);
  if (error) return Report(context, {ErrorCode::kUnavailable, options.to + ": " + error.message()});
  if (context.json) PrintJson({{"from", options.from}, {"to", options.to}, {"bytes", bytes}});
  Say(context,
      fmt::format("{}: {} of {}, checked, {} bytes", options.to, what, options.from, bytes));
  return ExitCode::kOk;
}

ExitCode RunBackup(const Context& context, const CopyOptions& options) {
  return Answer(context, options, "backup", BackUpStore(options.from, options.to));
}

ExitCode RunRestore(const Context& context, const CopyOptions& options) {
  return Answer(context, options, "store", RestoreStore(options.from, options.to));
}

}  // namespace

void AddStoreCommands(CommandLine* line) {
  CLI::App* store = AddCommand(&line->app, "store", "Check, back up and restore the daemon's store",
                               "  focalfleet store check /var/lib/focalfleet/focalfleet.db");
  store->require_subcommand(1);

  CLI::App* check = AddCommand(store, "check",
                               "Check a store: pages, and the checksums of all rows that the "
                               "daemon loads. The daemon may have it",
                               "  focalfleet store check /var/lib/focalfleet/focalfleet.db");
  auto checked = std::make_shared<CheckOptions>();
  AddFile(check, "store", &checked->file, "The store")->required();
  OnChosen(line, check, checked, RunCheck);

  CLI::App* backup = AddCommand(
      store, "backup", "Copy a store into one file that is then checked. The daemon may have it",
      "  focalfleet store backup /var/lib/focalfleet/focalfleet.db /backup/focalfleet.db");
  auto copied = std::make_shared<CopyOptions>();
  AddFile(backup, "store", &copied->from, "The store")->required();
  AddFile(backup, "backup", &copied->to, "The new file; nothing may be there")->required();
  OnChosen(line, backup, copied, RunBackup);

  CLI::App* restore = AddCommand(
      store, "restore",
      "Make a store of a backup, at a place where no file is. Units that moved since the backup "
      "are of unknown place afterwards",
      "  focalfleet store restore /backup/focalfleet.db /var/lib/focalfleet/focalfleet.db");
  auto restored = std::make_shared<CopyOptions>();
  AddFile(restore, "backup", &restored->from, "The backup")->required();
  AddFile(restore, "store", &restored->to, "The store; move the damaged one aside first")
      ->required();
  OnChosen(line, restore, restored, RunRestore);
}

}  // namespace focalfleet::cli
