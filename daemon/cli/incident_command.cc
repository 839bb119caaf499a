// The command incident packs what a report of a fault needs into one file: journal, log, a copy of
// the store, configuration, and how machine and daemon stand. Keys and tokens stay out.

#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "daemon/cli/child_program.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/time_text.h"
#include "daemon/cli/versions.h"
#include "daemon/files/text_file.h"
#include "daemon/process/config.h"
#include "daemon/store/store_copy.h"

namespace focalfleet::cli {
namespace {

namespace fs = std::filesystem;

struct IncidentOptions {
  std::string config = kDefaultConfig;
  std::string since = "12h";
  std::string out;
};

struct Part {
  std::string name;
  std::uintmax_t bytes = 0;
};

/// The folder that becomes the file. The folder goes with this object.
class Collection {
 public:
  explicit Collection(fs::path folder) : folder_(std::move(folder)) {}
  Collection(const Collection&) = delete;
  Collection& operator=(const Collection&) = delete;
  ~Collection() {
    std::error_code error;
    fs::remove_all(folder_.parent_path(), error);
  }

  [[nodiscard]] const fs::path& folder() const { return folder_; }
  [[nodiscard]] const Json& missing() const { return missing_; }
  void Miss(const std::string& part, const std::string& why) {
    missing_.push_back({{"part", part}, {"why", why}});
  }
  void Note(const std::string& part, const Status& done) {
    if (!done) Miss(part, done.error().text);
  }
  void Copy(const fs::path& from, const std::string& part) {
    std::error_code error;
    fs::create_directories((folder_ / part).parent_path(), error);
    if (!fs::copy_file(from, folder_ / part, error) || error)
      Miss(part, from.string() + ": " + error.message());
  }
  /// Adds what a program prints. `exits`: the greatest exit code with which it has done its work.
  void Ask(const std::vector<std::string>& arguments, const std::string& part, int exits = 0) {
    const auto code = RunChild(arguments, folder_ / part, folder_ / "errors.txt");
    if (!code) return Miss(part, code.error().text);
    if (*code > exits) Miss(part, fmt::format("{} ended with {}", arguments.front(), *code));
  }
  [[nodiscard]] std::vector<Part> parts() const {
    std::vector<Part> parts;
    std::error_code error;
    for (const auto& entry : fs::recursive_directory_iterator(folder_, error))
      if (entry.is_regular_file(error))
        parts.push_back({entry.path().lexically_relative(folder_), entry.file_size(error)});
    std::ranges::sort(parts, {}, &Part::name);
    return parts;
  }

 private:
  fs::path folder_;
  Json missing_ = Json::array();
};

/// All files of each life of the journal that was written since then, and of the newest one.
void TakeJournal(const fs::path& folder, WallTime since, Collection* collection) {
  std::error_code error;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder, error)) files.push_back(entry.path());
  if (files.empty())
    return collection->Miss(
        "journal", folder.string() + ": " + (error ? error.message() : "nothing is in it"));
  std::ranges::sort(files);
  const auto life = [](const fs::path& file) { return file.stem().stem().string(); };
  std::set<std::string> wanted{life(files.back())};
  for (const fs::path& file : files) {
    const auto written = fs::last_write_time(file, error);
    const auto at = std::chrono::file_clock::to_sys(written).time_since_epoch();
    if (!error && std::chrono::nanoseconds(at).count() >= since.ns) wanted.insert(life(file));
  }
  for (const fs::path& file : files)
    if (wanted.contains(life(file))) collection->Copy(file, "journal/" + file.filename().string());
}

void TakeLog(const DaemonConfig& config, WallTime since, Collection* collection) {
  if (!config.log.file.empty()) return collection->Copy(config.log.file, "daemon.log");
  collection->Ask({"journalctl", "--unit=focalfleetd", "--no-pager", "--output=short-iso-precise",
                   fmt::format("--since=@{}", since.ns / 1'000'000'000)},
                  "daemon.log");
}

/// Takes what daemon and doctor say. This program asks them as its user would.
void TakeAnswers(const Context& context, const DaemonConfig& config, const std::string& config_path,
                 WallTime since, Collection* collection) {
  const std::string named = context.NamedSocketPath();
  const std::vector<std::string> own{"/proc/self/exe", "--json", "--socket",
                                     named.empty() ? config.control.socket : named};
  const auto ask = [&](std::vector<std::string> more, const char* part, int exits) {
    more.insert(more.begin(), own.begin(), own.end());
    collection->Ask(more, part, exits);
  };
  ask({"doctor", "--config", config_path}, "doctor.json", 3);
  ask({"status"}, "status.json", 3);
  ask({"alarms"}, "alarms.json", 3);
  ask({"events", "--limit", "1000", "--since", ToIso8601(since)}, "events.json", 3);
}

void TakeFiles(const DaemonConfig& config, const IncidentOptions& options, Collection* collection) {
  collection->Copy(options.config, "focalfleet.toml");
  collection->Note("focalfleet.effective.toml",
                   WriteFileAtomically(collection->folder() / "focalfleet.effective.toml",
                                       EffectiveConfig(config)));
  const std::pair<const char*, const std::string&> files[] = {
      {"units", config.fleet.units},
      {"obstacles", config.fleet.obstacles},
      {"fiducials", config.camera.fiducials},
      {"hall_model", config.hall.model}};
  for (const auto& [name, path] : files)
    if (!path.empty()) collection->Copy(path, name + fs::path(path).extension().string());
  collection->Note("store.db", BackUpStore(config.store.path, collection->folder() / "store.db"));
}

Status Pack(const Collection& collection, const std::string& out) {
  const fs::path folder = collection.folder();
  const std::string errors = folder.parent_path() / "tar.txt";
  const std::string packed = folder.parent_path() / "packed.tar.gz";
  FOCALFLEET_TRY_ASSIGN(
      const int code,
      RunChild({"tar", "--create", "--gzip", "--force-local", "--file", packed, "--owner=0",
                "--group=0", "--directory", folder.parent_path(), folder.filename()},
               folder.parent_path() / "tar.out", errors));
  if (code != 0) {
    const auto why = ReadFile(errors);
    return Fail(ErrorCode::kUnavailable, out + ": tar: " + (why ? *why : std::string()));
  }
  ::chmod(packed.c_str(), 0600);
  std::error_code error;
  fs::rename(packed, out, error);
  if (error) return Fail(ErrorCode::kUnavailable, out + ": " + error.message());
  return {};
}

std::string Describe(const std::vector<Part>& parts, const Json& missing) {
  std::string text;
  for (const Part& part : parts) text += fmt::format("  {:>12}  {}\n", part.bytes, part.name);
  for (const Json& part : missing)
    text += fmt::format("       missing  {}: {}\n", part["part"].get<std::string>(),
                        part["why"].get<std::string>());
  return text;
}

ExitCode RunIncident(const Context& context, const IncidentOptions& options) {
  const WallTime now = WallTime::Now();
  const auto since = InstantOf(options.since, now);
  if (!since) return Report(context, since.error(), ExitCode::kUsage);
  const auto config = LoadConfig(options.config);
  if (!config) return Report(context, config.error());
  std::string stamp = ToIso8601(now).substr(0, 19) + "Z";
  std::erase_if(stamp, [](char letter) { return letter == '-' || letter == ':'; });
  const std::string name = "focalfleet-incident-" + stamp;
  const std::string out = options.out.empty() ? name + ".tar.gz" : options.out;
  std::error_code error;
  if (fs::exists(out, error))
    return Report(context, {ErrorCode::kRefused, out + ": something is there already"});
  std::string place = out + ".XXXXXX";
  if (::mkdtemp(place.data()) == nullptr)
    return Report(context, FailErrno(place, "cannot be made", errno).value());
  Collection collection(fs::path(place) / name);
  fs::create_directory(collection.folder(), error);
  TakeFiles(*config, options, &collection);
  TakeJournal(config->store.path + ".journal", *since, &collection);
  TakeLog(*config, *since, &collection);
  TakeAnswers(context, *config, options.config, *since, &collection);
  const Json about{{"made", ToIso8601(now)},
                   {"since", ToIso8601(*since)},
                   {"version", ClientVersion()},
                   {"missing", collection.missing()},
                   {"replay", "focalfleetd --replay journal"}};
  collection.Note("about.json",
                  WriteFileAtomically(collection.folder() / "about.json", about.dump(2) + "\n"));
  const std::vector<Part> parts = collection.parts();
  if (const Status packed = Pack(collection, out); !packed) return Report(context, packed.error());
  const std::uintmax_t bytes = fs::file_size(out, error);
  if (context.json) {
    Json list = Json::array();
    for (const Part& part : parts) list.push_back({{"part", part.name}, {"bytes", part.bytes}});
    PrintJson({{"file", out},
               {"bytes", bytes},
               {"parts", std::move(list)},
               {"missing", collection.missing()}});
  }
  Say(context, Describe(parts, collection.missing()) +
                   fmt::format("{}: {} bytes. Look through it before you send it: names of users "
                               "and targets are in it; keys and tokens are not",
                               out, bytes));
  return collection.missing().empty() ? ExitCode::kOk : ExitCode::kSomeUnserved;
}

}  // namespace

void AddIncidentCommand(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "incident",
      "Pack what a report of a fault needs into one file: journal, log, a copy of the store, "
      "configuration, and the answers of daemon and doctor. Exit code 3: a part is missing, and "
      "named",
      "  focalfleet incident\n"
      "  focalfleet incident --since 2h --config fleet.toml --out fault.tar.gz");
  auto options = std::make_shared<IncidentOptions>();
  AddFile(command, "--config", &options->config, "The daemon's configuration")
      ->capture_default_str();
  command
      ->add_option("--since", options->since,
                   "Log and journal from this time on, or of this span before now")
      ->type_name("TIME")
      ->capture_default_str();
  command->add_option("--out", options->out, "The new file (otherwise a name with the time)")
      ->type_name("FILE");
  OnChosen(line, command, options, RunIncident);
}

}  // namespace focalfleet::cli
