// A diagnosis of a campaign that a page asks for. The work is done by the program focalfleet-study
// in a process of its own, which gets the lowest priority where the system allows it, one thread,
// and limits of CPU, memory and time. There is at most one at a time. Neither the core nor any
// thread of the daemon waits for it: its state is looked at when somebody asks.
//
// Files lie in one folder beside the store and have fixed names. The folder is emptied for each
// diagnosis, so that it holds one campaign and one report.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "protocol/base/result.h"

namespace focalfleet {

class DiagnosisJob {
 public:
  struct Options {
    std::vector<std::string> programs;  // places of focalfleet-study; the first that runs is taken
    std::string folder;
    std::chrono::seconds cpu_max{2 * 3600};
    std::chrono::seconds wall_max{12 * 3600};
    std::uint64_t memory_max_bytes = std::uint64_t{4} << 30;
  };
  /// The tables of a campaign, and its name for people.
  struct Campaign {
    std::string name;
    std::string moves_csv;
    std::string units_csv;
    std::string by;  // the caller's name
  };

  explicit DiagnosisJob(Options options) : options_(std::move(options)) {}
  DiagnosisJob(const DiagnosisJob&) = delete;
  DiagnosisJob& operator=(const DiagnosisJob&) = delete;
  /// A diagnosis that runs is ended.
  ~DiagnosisJob();

  /// The diagnosis runs. Errors: kRefused: one runs already; kUnavailable: the folder cannot be
  /// written, or there is no program.
  Status Begin(const Campaign& campaign);
  /// The diagnosis is ended. Errors: kRefused: none runs.
  Status Cancel();
  /// {state: none, running, done, failed or cancelled; name, by, began_ms, took_s, stage}. `stage`
  /// is the last line that the program wrote.
  nlohmann::json Show();
  /// A file of the report. Errors: kRefused: there is no report.
  Result<std::string> ReportFile(const char* name);

 private:
  enum class State : std::uint8_t { kNone, kRunning, kDone, kFailed, kCancelled };
  static const char* Name(State state);

  void Look();
  void End(State state);
  Status WriteCampaign(const Campaign& campaign) const;
  Status Spawn();
  [[nodiscard]] std::string LastLine() const;

  const Options options_;
  std::mutex mutex_;
  // ---- under the mutex
  State state_ = State::kNone;
  pid_t child_ = -1;
  Campaign campaign_;  // without its tables
  WallTime began_;
  WallTime ended_;
  std::string why_;  // it failed, beside what the program wrote
};

/// The places of focalfleet-study beside the program of this process.
std::vector<std::string> StudyPrograms();

}  // namespace focalfleet
