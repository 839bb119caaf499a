// The real focalfleetd in a folder of its own, started and asked by a test.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/control/line_client.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::test {

inline constexpr int kPatienceMs = 30'000;  // limit for a hang; nothing is timed

class FocalfleetdTest : public ::testing::Test {
 protected:
  FocalfleetdTest() {
    std::ofstream(scratch_ / "units.csv")
        << "unit_id,base_x_mm,base_y_mm,arm_theta_mm,arm_phi_mm,theta_zero_deg,phi_zero_deg,theta_"
           "gear,"
           "phi_gear,theta_min_deg,theta_max_deg,phi_min_deg,phi_max_deg,bus_id,node_id\n"
           "1,0,0,7.4,7.4,0,0,890,890,-190,190,0,190,0,1\n"
           "2,25.6,0,7.4,7.4,0,0,890,890,-190,190,0,190,1,1\n";
    Configure("[bus]\nport = \"simulated\"\n");
  }
  void Configure(const std::string& text) const {
    std::ofstream(scratch_ / "f.toml") << "[dds]\nenabled = false\n" << text;
  }
  [[nodiscard]] test::Process Start(const std::string& log = "log") const {
    return test::Process({FOCALFLEETD, "--config", scratch_ / "f.toml"}, scratch_ / log);
  }
  [[nodiscard]] int Run(const std::vector<std::string>& arguments) const {
    std::vector<std::string> all{FOCALFLEETD};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return test::Process(all, scratch_ / "log").Wait();
  }
  [[nodiscard]] std::string Log(const std::string& log = "log") const {
    std::ifstream file(scratch_ / log);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }
  [[nodiscard]] Result<Json> Ask(const std::string& verb, const Json& args = Json::object()) const {
    FOCALFLEET_TRY_ASSIGN(LineClient client, LineClient::Connect(scratch_ / "control.sock"));
    return client.Call(verb, args);
  }
  [[nodiscard]] bool Answers() const {
    return test::WaitUntil([&] { return Ask("status").has_value(); }, kPatienceMs);
  }
  [[nodiscard]] bool Ready() const {
    return test::WaitUntil(
        [&] {
          const auto status = Ask("status");
          return status && (*status)["phases"]["ready"] == 2;
        },
        kPatienceMs);
  }

  const test::ScratchFolder scratch_;
};

}  // namespace focalfleet::test
