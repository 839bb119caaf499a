// A diagnosis in a process of its own. The program here is a shell script that stands where
// focalfleet-study does; the one itself is run by the page's tests in a browser.
#include "daemon/page/diagnosis_job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "daemon/files/text_file.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::WaitUntil;
using ::testing::HasSubstr;

constexpr int kPatienceMs = 30'000;  // limit for a hang; nothing is timed

class DiagnosisJobTest : public ::testing::Test {
 protected:
  /// The program: `body` has $2 as the campaign's folder and $4 as that of the report.
  std::string Program(const std::string& body) {
    const std::string path = folder_ / "program";
    std::ofstream(path) << "#!/bin/sh\n" << body << "\n";
    ::chmod(path.c_str(), 0755);
    return path;
  }
  DiagnosisJob::Options Options(const std::string& body) {
    return {.programs = {folder_ / "missing", Program(body)}, .folder = folder_ / "work"};
  }
  static DiagnosisJob::Campaign Campaign(const std::string& name = "night-1") {
    return {.name = name, .moves_csv = "moves\n", .units_csv = "units\n", .by = "olga"};
  }
  static bool Ends(DiagnosisJob* job) {
    return WaitUntil([&] { return job->Show()["state"] != "running"; }, kPatienceMs);
  }

  test::ScratchFolder folder_;
};

TEST_F(DiagnosisJobTest, TheProgramGetsTheCampaignAndItsReportComesBack) {
  DiagnosisJob job(
      Options("echo '40 %  reading' >&2; mkdir -p $4; "
              "cat $2/moves.csv $2/units.csv > $4/report.json"));
  EXPECT_EQ(job.Show()["state"], "none");
  EXPECT_EQ(job.ReportFile("report.json").error().code, ErrorCode::kRefused);
  ASSERT_TRUE(job.Begin(Campaign()));
  ASSERT_TRUE(Ends(&job));
  const auto shown = job.Show();
  EXPECT_EQ(shown["state"], "done");
  EXPECT_EQ(shown["name"], "night-1");
  EXPECT_EQ(shown["by"], "olga");
  EXPECT_EQ(shown["stage"], "40 %  reading");
  EXPECT_EQ(job.ReportFile("report.json").value(), "moves\nunits\n");
}

TEST_F(DiagnosisJobTest, ThereIsOneAtATimeAndItCanBeCancelled) {
  DiagnosisJob job(Options("sleep 1000"));
  ASSERT_TRUE(job.Begin(Campaign()));
  const Status second = job.Begin(Campaign("night-2"));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kRefused);
  EXPECT_THAT(second.error().text, HasSubstr("night-1 by olga"));
  ASSERT_TRUE(job.Cancel());
  EXPECT_EQ(job.Show()["state"], "cancelled");
  EXPECT_EQ(job.Cancel().error().code, ErrorCode::kRefused);
  EXPECT_TRUE(job.Begin(Campaign("night-2"))) << "another may begin";
}

/// The process and all that it started end with the job: the pipe has no writer left.
TEST_F(DiagnosisJobTest, NothingOfItOutlivesTheDaemon) {
  const std::string pid_file = folder_ / "pid";
  {
    DiagnosisJob job(Options("sleep 1000 & echo $! > " + pid_file + ".new; mv " + pid_file +
                             ".new " + pid_file + "; wait"));
    ASSERT_TRUE(job.Begin(Campaign()));
    ASSERT_TRUE(WaitUntil([&] { return std::filesystem::exists(pid_file); }, kPatienceMs));
  }
  pid_t pid = 0;
  std::ifstream(pid_file) >> pid;
  EXPECT_TRUE(WaitUntil(
      [&] {
        std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
        std::string number, name, state;
        return !(stat >> number >> name >> state) || state == "Z";
      },
      kPatienceMs));
}

TEST_F(DiagnosisJobTest, ItHasLimitsOfCpuAndMemoryAndTheLowestPriority) {
  DiagnosisJob::Options options = Options(
      "until [ $(cat /proc/$$/oom_score_adj) = 500 ]; do sleep 0.01; done; mkdir -p $4; "
      "(ulimit -t; ulimit -v; cut -d' ' -f41 /proc/$$/stat) > $4/report.json");
  options.cpu_max = std::chrono::seconds(77);
  options.memory_max_bytes = std::uint64_t{1} << 30;
  DiagnosisJob job(options);
  ASSERT_TRUE(job.Begin(Campaign()));
  ASSERT_TRUE(Ends(&job));
  const std::string found = job.ReportFile("report.json").value();
  EXPECT_EQ(found, "77\n1048576\n5\n") << "the last is SCHED_IDLE";
}

TEST_F(DiagnosisJobTest, AFailureSaysWhy) {
  DiagnosisJob job(Options("echo 'moves.csv:3: x_mm: no number' >&2; exit 1"));
  ASSERT_TRUE(job.Begin(Campaign()));
  ASSERT_TRUE(Ends(&job));
  EXPECT_EQ(job.Show()["state"], "failed");
  EXPECT_EQ(job.Show()["stage"], "moves.csv:3: x_mm: no number");
  DiagnosisJob killed(Options("kill -KILL $$"));
  ASSERT_TRUE(killed.Begin(Campaign()));
  ASSERT_TRUE(Ends(&killed));
  EXPECT_THAT(killed.Show()["why"].get<std::string>(), HasSubstr("limit of CPU or memory"));
}

TEST_F(DiagnosisJobTest, ItTakesNoLongerThanItMay) {
  DiagnosisJob::Options options = Options("sleep 1000");
  options.wall_max = std::chrono::seconds(-1);
  DiagnosisJob job(options);
  ASSERT_TRUE(job.Begin(Campaign()));
  EXPECT_EQ(job.Show()["state"], "failed");
  EXPECT_THAT(job.Show()["why"].get<std::string>(), HasSubstr("longer than"));
}

TEST_F(DiagnosisJobTest, WithoutItsProgramItIsUnavailable) {
  DiagnosisJob job({.programs = {folder_ / "missing"}, .folder = folder_ / "work"});
  const Status begun = job.Begin(Campaign());
  ASSERT_FALSE(begun);
  EXPECT_EQ(begun.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(begun.error().text, HasSubstr("focalfleet-study"));
  EXPECT_EQ(job.Show()["state"], "none");
}

TEST_F(DiagnosisJobTest, ACampaignLeavesNothingOfTheOneBefore) {
  DiagnosisJob job(
      Options("mkdir -p $4; touch $4/report.json; test ! -e $4/old || exit 1; "
              "touch $4/old"));
  for (int round = 0; round < 2; ++round) {
    ASSERT_TRUE(job.Begin(Campaign()));
    ASSERT_TRUE(Ends(&job));
    EXPECT_EQ(job.Show()["state"], "done") << round;
  }
}

}  // namespace
}  // namespace focalfleet
