#include "tests/daemon/cli/daemon_commands.h"

#include <utility>

namespace focalfleet::test {

Json ConfigurationAnswer(const std::string& state, std::uint64_t arrived, std::uint64_t failed) {
  Json c{{"id", 7},
         {"source", "t.csv"},
         {"state", state},
         {"round", 1},
         {"targeted", 2},
         {"arrived", arrived},
         {"refused", 0},
         {"failed", failed},
         {"makespan_predicted_s", 12.5},
         {"makespan_s", 12.75},
         {"energy_J", 3.5},
         {"peak_power_W", 0.5},
         {"frames", 420},
         {"upload_bits_predicted", 1800},
         {"upload_bits", 1900},
         {"upload_predicted_s", 0.0018},
         {"upload_s", 0.002},
         {"starts", 2},
         {"starts_known", 2},
         {"start_skew_s", 0.0021},
         {"start_skew_bound_s", 0.0006},
         {"start_skew_least_s", 0.0017},
         {"start_skew_most_s", 0.0027},
         {"start_skew_allowed_s", 0.04},
         {"start_first", {{"unit_id", 1}, {"bus_id", 0}}},
         {"start_last", {{"unit_id", 2}, {"bus_id", 1}}},
         {"unserved", Json::array()}};
  if (failed != 0) {
    c["unserved"].push_back(
        {{"unit_id", 2}, {"outcome", "failed"}, {"reason", "no answer"}, {"state", "silent"}});
  }
  return c;
}

Json StatusAnswer() {
  return {{"version", "0.1.0"},
          {"units", 2},
          {"enabled", 2},
          {"phases", {{"ready", 2}}},
          {"positions", {{"reported", 2}}},
          {"busy", false},
          {"store", {{"path", "fleet.db"}, {"failing", false}}},
          {"configuration", ConfigurationAnswer("done", 2, 0)},
          {"buses",
           {{{"bus_id", 0}, {"link", "up"}, {"load", 0.1}, {"load_max", 0.2}},
            {{"bus_id", 1},
             {"link", "off"},
             {"port", "can1"},
             {"trouble", "the controller is bus-off"},
             {"load", 0.0},
             {"load_max", 0.375}}}},
          {"bus_load_max", 0.375}};
}

ProgramResult DaemonCommands::Ask(std::vector<std::string> words,
                                  std::map<std::string, FakeAnswer> answers) {
  FakeDaemon daemon(scratch_ / "sock", std::move(answers));
  words.insert(words.end(), {"--socket", daemon.path()});
  ProgramResult result = Focalfleet(words);
  requests_ = daemon.requests();
  return result;
}

ProgramResult DaemonCommands::AskAtTerminal(const std::string& line, std::vector<std::string> words,
                                            std::map<std::string, FakeAnswer> answers) {
  FakeDaemon daemon(scratch_ / "sock", std::move(answers));
  words.insert(words.end(), {"--socket", daemon.path()});
  ProgramResult result = FocalfleetAtTerminal(line, words);
  requests_ = daemon.requests();
  return result;
}

ProgramResult DaemonCommands::Apply(const std::vector<std::string>& more, FakeAnswer answer) {
  std::vector<std::string> words = {"apply", scratch_.Put("t.csv", kTargets)};
  words.insert(words.end(), more.begin(), more.end());
  return Ask(words, {{"apply", std::move(answer)}, {"status", {.result = StatusAnswer()}}});
}

}  // namespace focalfleet::test
