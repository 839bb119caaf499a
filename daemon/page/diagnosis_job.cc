#include "daemon/page/diagnosis_job.h"

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

#include "daemon/files/text_file.h"

namespace focalfleet {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kStageBytes = 200;
constexpr std::size_t kLogTailBytes = 4096;

/// Attributes and files of a child process, freed at the end.
class SpawnTerms {
 public:
  explicit SpawnTerms(const std::string& log) {
    posix_spawnattr_init(&attributes_);
    posix_spawn_file_actions_init(&actions_);
    sigset_t none;
    sigset_t all;
    sigemptyset(&none);
    sigfillset(&all);
    // The daemon's threads block signals and ignore SIGPIPE; the child does neither. Its group is
    // its own, so that all that it starts ends with it.
    posix_spawnattr_setsigmask(&attributes_, &none);
    posix_spawnattr_setsigdefault(&attributes_, &all);
    posix_spawnattr_setpgroup(&attributes_, 0);
    posix_spawnattr_setflags(
        &attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
    posix_spawn_file_actions_addopen(&actions_, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions_, 1, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&actions_, 2, log.c_str(), O_WRONLY | O_CREAT | O_APPEND,
                                     0640);
    posix_spawn_file_actions_addclosefrom_np(&actions_, 3);
  }
  SpawnTerms(const SpawnTerms&) = delete;
  SpawnTerms& operator=(const SpawnTerms&) = delete;
  ~SpawnTerms() {
    posix_spawnattr_destroy(&attributes_);
    posix_spawn_file_actions_destroy(&actions_);
  }
  /// 0, or the reason.
  int Spawn(const std::string& program, std::vector<std::string> words, pid_t* child) const {
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    return posix_spawn(child, program.c_str(), &actions_, &attributes_, arguments.data(), environ);
  }

 private:
  posix_spawnattr_t attributes_{};
  posix_spawn_file_actions_t actions_{};
};

void Limit(pid_t child, __rlimit_resource which, std::uint64_t most) {
  const rlimit limit{.rlim_cur = most, .rlim_max = most};
  ::prlimit(child, which, &limit, nullptr);
}

}  // namespace

const char* DiagnosisJob::Name(State state) {
  constexpr const char* kNames[] = {"none", "running", "done", "failed", "cancelled"};
  return kNames[static_cast<std::size_t>(state)];
}

DiagnosisJob::~DiagnosisJob() {
  const std::lock_guard lock(mutex_);
  if (state_ == State::kRunning) End(State::kCancelled);
}

Status DiagnosisJob::WriteCampaign(const Campaign& campaign) const {
  std::error_code failed;
  const fs::path folder(options_.folder);
  fs::remove_all(folder, failed);
  if (!failed) fs::create_directories(folder / "campaign", failed);
  if (failed) return Fail(ErrorCode::kUnavailable, options_.folder + ": " + failed.message());
  FOCALFLEET_TRY(WriteFileAtomically(folder / "campaign" / "moves.csv", campaign.moves_csv));
  return WriteFileAtomically(folder / "campaign" / "units.csv", campaign.units_csv);
}

Status DiagnosisJob::Spawn() {
  const fs::path folder(options_.folder);
  int reason = ENOENT;
  for (const std::string& program : options_.programs) {
    const std::vector<std::string> words = {
        program, "diagnose", folder / "campaign", "--out", folder / "report", "--threads", "1"};
    const int failed = SpawnTerms(folder / "log.txt").Spawn(program, words, &child_);
    if (failed != 0) {
      if (failed != ENOENT) reason = failed;
      continue;
    }
    Limit(child_, RLIMIT_CPU, static_cast<std::uint64_t>(options_.cpu_max.count()));
    Limit(child_, RLIMIT_AS, options_.memory_max_bytes);
    // A sandbox may forbid another priority; then one thread at the usual one it is.
    const sched_param lowest{};
    ::sched_setscheduler(child_, SCHED_IDLE, &lowest);
    // The daemon itself is spared where memory ends; this process is not.
    std::ofstream("/proc/" + std::to_string(child_) + "/oom_score_adj") << 500;
    return {};
  }
  return Fail(ErrorCode::kUnavailable,
              std::string("the program focalfleet-study cannot be run: ") + std::strerror(reason));
}

Status DiagnosisJob::Begin(const Campaign& campaign) {
  const std::lock_guard lock(mutex_);
  Look();
  if (state_ == State::kRunning)
    return Fail(ErrorCode::kRefused, "the diagnosis of " + campaign_.name + " by " + campaign_.by +
                                         " runs; cancel it first");
  FOCALFLEET_TRY(WriteCampaign(campaign));
  state_ = State::kNone;
  FOCALFLEET_TRY(Spawn());
  state_ = State::kRunning;
  campaign_ = {.name = campaign.name, .moves_csv = {}, .units_csv = {}, .by = campaign.by};
  began_ = WallTime::Now();
  why_.clear();
  return {};
}

/// The child has ended, or has to.
void DiagnosisJob::Look() {
  if (state_ != State::kRunning) return;
  int status = 0;
  const pid_t ended = ::waitpid(child_, &status, WNOHANG);
  if (ended == child_) {
    child_ = -1;
    ended_ = WallTime::Now();
    const bool well = WIFEXITED(status) && WEXITSTATUS(status) == 0;
    state_ = well ? State::kDone : State::kFailed;
    if (WIFSIGNALED(status))
      why_ = std::string("it was ended by ") + ::strsignal(WTERMSIG(status)) +
             (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL
                  ? ", as by its limit of CPU or memory"
                  : "");
    return;
  }
  const auto took_s = (WallTime::Now().ns - began_.ns) / 1'000'000'000;
  if (took_s <= options_.wall_max.count()) return;
  End(State::kFailed);
  why_ = "it took longer than " + std::to_string(options_.wall_max.count() / 3600) + " hours";
}

void DiagnosisJob::End(State state) {
  ::kill(-child_, SIGKILL);
  ::waitpid(child_, nullptr, 0);
  child_ = -1;
  state_ = state;
  ended_ = WallTime::Now();
}

Status DiagnosisJob::Cancel() {
  const std::lock_guard lock(mutex_);
  Look();
  if (state_ != State::kRunning) return Fail(ErrorCode::kRefused, "no diagnosis runs");
  End(State::kCancelled);
  return {};
}

std::string DiagnosisJob::LastLine() const {
  std::ifstream log(fs::path(options_.folder) / "log.txt", std::ios::binary | std::ios::ate);
  if (!log) return "";
  const auto size = static_cast<std::size_t>(log.tellg());
  const std::size_t from = size > kLogTailBytes ? size - kLogTailBytes : 0;
  log.seekg(static_cast<std::streamoff>(from));
  std::string tail(size - from, '\0');
  log.read(tail.data(), static_cast<std::streamsize>(tail.size()));
  while (!tail.empty() && tail.back() == '\n') tail.pop_back();
  tail = tail.substr(tail.rfind('\n') + 1);
  return tail.substr(0, kStageBytes);
}

nlohmann::json DiagnosisJob::Show() {
  const std::lock_guard lock(mutex_);
  Look();
  if (state_ == State::kNone) return {{"state", Name(state_)}};
  const WallTime until = state_ == State::kRunning ? WallTime::Now() : ended_;
  return {{"state", Name(state_)},
          {"name", campaign_.name},
          {"by", campaign_.by},
          {"began_ms", began_.ns / 1'000'000},
          {"took_s", static_cast<double>((until.ns - began_.ns) / 1'000'000) / 1000},
          {"stage", LastLine()},
          {"why", why_}};
}

Result<std::string> DiagnosisJob::ReportFile(const char* name) {
  const std::lock_guard lock(mutex_);
  Look();
  if (state_ != State::kDone) return Fail(ErrorCode::kRefused, "there is no report");
  return ReadTextFile(fs::path(options_.folder) / "report" / name);
}

std::vector<std::string> StudyPrograms() {
  std::error_code failed;
  const auto folder = fs::read_symlink("/proc/self/exe", failed).parent_path();
  if (failed) return {};
  return {folder / "focalfleet-study",
          folder.parent_path() / "libexec" / "focalfleet" / "focalfleet-study"};
}

}  // namespace focalfleet
