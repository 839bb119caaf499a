#include "daemon/simulator/simulator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "daemon/simulator/interface_names.h"
#include "daemon/simulator/memory_file.h"
#include "daemon/simulator/truth_report.h"
#include "fleet/files/targets_file.h"
#include "tests/daemon/simulator/running_simulation.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::simulator {
namespace {

using test::BusClient;
using test::RunningSimulation;
using test::RunToEnd;
using test::ScratchFolder;

constexpr const char* kUnits =
    "unit_id,base_x_mm,base_y_mm,arm_theta_mm,arm_phi_mm,theta_zero_deg,phi_zero_deg,theta_gear,"
    "phi_gear,"
    "theta_min_deg,theta_max_deg,phi_min_deg,phi_max_deg,bus_id,node_id\n"
    "11,0,0,8.25,8.25,0,0,892,892,-190,190,0,180,3,1\n"
    "12,30,0,8.25,8.25,0,0,892,892,-190,190,0,180,3,2\n"
    "13,60,0,8.25,8.25,0,0,892,892,-190,190,0,180,8,1\n";

void Put(const std::string& path, const std::string& text) { std::ofstream(path) << text; }
std::string Slurp(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(SimulatorCommandLine, ReadsInterfacesAndRanges) {
  using Names = std::vector<std::string>;
  EXPECT_EQ(*ParseInterfaces("vcan0"), Names({"vcan0"}));
  EXPECT_EQ(*ParseInterfaces("can1,can0"), Names({"can1", "can0"}));
  EXPECT_EQ(*ParseInterfaces("vcan9...vcan11,x"), Names({"vcan9", "vcan10", "vcan11", "x"}));
  for (const char* bad :
       {"", "vcan0,", "vcan2...vcan1", "vcan0...can3", "a...b", "...", "vcan0...vcan99999999999"})
    EXPECT_FALSE(ParseInterfaces(bad)) << bad;
}

MemoryFile SomeMemory() {
  sim::WorldConfig config;
  for (std::uint32_t id = 1; id <= 3; ++id) {
    sim::UnitDescription unit;
    unit.id = {id};
    unit.node = {static_cast<std::uint8_t>(id)};
    for (sim::AxisDescription& axis : unit.axis) axis = {8, 0, 892.0588235294117, -100, 170, 33.3};
    config.units.push_back(unit);
  }
  config.spread = sim::Spread::kReal;
  sim::World world(config);
  return {4711, sim::Spread::kReal, world.Memory()};
}

TEST(SimulatorMemory, ReadsBackEqualToTheBit) {
  const MemoryFile memory = SomeMemory();
  const auto again = ReadMemory(WriteMemory(memory), "flash.json");
  ASSERT_TRUE(again) << again.error().text;
  EXPECT_EQ(again->seed, memory.seed);
  EXPECT_EQ(again->spread, memory.spread);
  ASSERT_EQ(again->units.size(), memory.units.size());
  for (std::size_t i = 0; i < memory.units.size(); ++i) {
    EXPECT_EQ(again->units[i].id, memory.units[i].id);
    EXPECT_EQ(again->units[i].flash, memory.units[i].flash);
    EXPECT_EQ(again->units[i].axis, memory.units[i].axis);
  }
}

TEST(SimulatorMemory, RefusesWhatIsCutOrSpoilt) {
  const std::string whole = WriteMemory(SomeMemory());
  for (std::size_t length = 0; length + 2 < whole.size(); length += 37)
    EXPECT_FALSE(ReadMemory(whole.substr(0, length), "flash.json")) << length;
  const auto spoil = [&](const std::string& from, const std::string& to) {
    std::string text = whole;
    text.replace(text.find(from), from.size(), to);
    const auto memory = ReadMemory(text, "flash.json");
    return memory ? std::string("taken") : memory.error().text;
  };
  EXPECT_EQ(spoil("\"repeat\": 108", "\"repeat\": 0"),
            "flash.json: unit number 1 in it: 'phi.repeat' is missing or out of range");
  EXPECT_EQ(spoil("\"version\": 1", "\"version\": 2"),
            "flash.json: was written by a later version of focalfleet-sim");
  EXPECT_NE(spoil("\"serial\"", "\"sorial\""), "taken");
  EXPECT_NE(spoil("\"moving\": false", "\"moving\": 0"), "taken");
}

TEST(SimulatorTruth, ComparesFibresWithWhatWasAskedFor) {
  sim::WorldConfig config;
  for (std::uint32_t id = 1; id <= 3; ++id) {
    sim::UnitDescription unit;
    unit.id = {id};
    unit.node = {static_cast<std::uint8_t>(id)};
    unit.enabled = id != 3;
    unit.base_x_mm = 100.0 * id;
    unit.axis[0] = {3, 0, 400, -190, 190, 0.0};
    unit.axis[1] = {4, 0, 400, 0, 180, 90.0};
    config.units.push_back(unit);
  }
  const sim::World world(config);
  const auto compare = [&](const std::string& text) {
    return CompareWithTargets(world, *ReadTargets(text, "t.csv"));
  };
  // The fibres are at (103, 4) and (203, 4), so these places are 30 um and 40 um off.
  auto errors = compare("unit_id,x_mm,y_mm\n1,103.03,4\n2,203,4.04\n3,0,0\n");
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->units, 2u);
  EXPECT_EQ(errors->disabled, 1u);
  EXPECT_NEAR(errors->rms_um, std::sqrt((900.0 + 1600.0) / 2), 1e-6);
  EXPECT_NEAR(errors->max_um, 40, 1e-6);
  EXPECT_EQ(errors->worst, UnitId{2});
  errors = compare("unit_id,theta_deg,phi_deg\n1,360,90\n");
  ASSERT_TRUE(errors);
  EXPECT_NEAR(errors->rms_um, 0, 1e-9);
  errors = compare("unit_id,x_mm,y_mm\n9,1,1\n");
  ASSERT_FALSE(errors);
  EXPECT_EQ(errors.error().text, "t.csv:2: no unit 9 in this fleet");
}

class Simulation : public ::testing::Test {
 protected:
  Simulation() { Put(units(), kUnits); }
  [[nodiscard]] std::string units() const { return scratch_ / "units.csv"; }
  [[nodiscard]] std::string control() const { return scratch_ / "c"; }
  [[nodiscard]] std::vector<std::string> Arguments(std::vector<std::string> more = {},
                                                   const char* speed = "20") const {
    std::vector<std::string> all = {"--units",   units(),   "--unix-directory", scratch_.path(),
                                    "--control", control(), "--speed",          speed};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  ScratchFolder scratch_;
};

TEST_F(Simulation, AnswersOnEachBusAndEndsCleanly) {
  RunningSimulation simulation(Arguments());
  ASSERT_TRUE(simulation.ready());
  BusClient three(scratch_ / "bus3.sock");
  BusClient eight(scratch_ / "bus8.sock");
  ASSERT_TRUE(three.connected() && eight.connected());
  three.Send(255, IdentifyRequest{});
  EXPECT_EQ(three.ReceiveFromUnit<IdentifyReply>()->serial, SerialNumber{1'000'011});
  EXPECT_EQ(three.ReceiveFromUnit<IdentifyReply>()->serial, SerialNumber{1'000'012});
  eight.Send(1, IdentifyRequest{});
  EXPECT_EQ(eight.ReceiveFromUnit<IdentifyReply>()->serial, SerialNumber{1'000'013});
  EXPECT_EQ(simulation.Terminate(), 0);
  BusClient late(scratch_ / "bus3.sock");
  EXPECT_FALSE(late.connected());
}

TEST_F(Simulation, ClocksRunAsTheCommandLineSays) {
  RunningSimulation simulation(
      Arguments({"--clock-error", "11=0.01", "--clock-error", "12-13=-0.02"}));
  ASSERT_TRUE(simulation.ready());
  const std::string out = scratch_ / "truth.csv";
  ASSERT_EQ(RunToEnd({"truth", "--out", out, "--control", control()}).exit, 0);
  const std::string truth = Slurp(out);
  EXPECT_NE(truth.find(",,0.01"), std::string::npos) << truth;
  EXPECT_NE(truth.find(",,-0.02"), std::string::npos) << truth;
  for (const char* wrong : {"11", "11=fast", "11=0.2", "eleven=0.01"})
    EXPECT_EQ(RunToEnd(Arguments({"--clock-error", wrong})).exit, 2) << wrong;
  const auto nobody = RunToEnd(Arguments({"--clock-error", "99=0.01"}));
  EXPECT_EQ(nobody.exit, 1);
  EXPECT_NE(nobody.err.find("--clock-error: there is no unit 99"), std::string::npos);
}

TEST_F(Simulation, OneClientHearsTheOthersFramesAndNotItsOwn) {
  RunningSimulation simulation(Arguments());
  ASSERT_TRUE(simulation.ready());
  BusClient speaker(scratch_ / "bus8.sock");
  BusClient listener(scratch_ / "bus8.sock");
  // The simulation has accepted both clients once both have received something.
  listener.Send(1, StatusRequest{}, 4);
  ASSERT_TRUE(listener.ReceiveFromUnit<StatusReply>());
  speaker.Send(1, ProgressRequest{}, 5);
  const CanFrame request = Encode(ProgressRequest{}, {{1}, 5});
  auto heard = listener.Receive();
  ASSERT_TRUE(heard);
  EXPECT_EQ(*heard, request);
  EXPECT_TRUE(listener.ReceiveFromUnit<ProgressReply>());
  // The speaker may have received the listener's exchange before, but it never receives its own
  // request.
  for (;;) {
    heard = speaker.Receive();
    ASSERT_TRUE(heard);
    EXPECT_NE(*heard, request);
    const auto decoded = DecodeUnit(*heard);
    if (decoded && std::holds_alternative<ProgressReply>(decoded->message)) break;
  }
}

TEST_F(Simulation, FlashSurvivesItsEnd) {
  const std::string flash = scratch_ / "flash.json";
  {
    // Homing takes most of a minute at real speed, so it is still under way at the end.
    RunningSimulation simulation(Arguments({"--flash", flash}, "1"));
    ASSERT_TRUE(simulation.ready());
    BusClient bus(scratch_ / "bus3.sock");
    bus.Send(2, StatusRequest{true});
    ASSERT_TRUE(bus.ReceiveFromUnit<StatusReply>());
    bus.Send(2, Home{{77}}, 9);
    EXPECT_EQ(bus.ReceiveFromUnit<HomeReply>()->answer, Answer::kOk);
    EXPECT_EQ(simulation.Terminate(), 0);
  }
  RunningSimulation again(Arguments({"--flash", flash}));
  ASSERT_TRUE(again.ready());
  BusClient bus(scratch_ / "bus3.sock");
  bus.Send(2, StatusRequest{}, 1);
  const auto status = bus.ReceiveFromUnit<StatusReply>();
  ASSERT_TRUE(status);
  EXPECT_TRUE(status->interrupted);
  EXPECT_EQ(status->move, MoveId{77});
  EXPECT_EQ(status->moves_begun, 1);
  const auto other = RunToEnd({"--units", units(), "--unix-directory", scratch_ / "other",
                               "--flash", flash, "--seed", "2"});
  EXPECT_EQ(other.exit, 1);
  EXPECT_NE(other.err.find("was written with --seed 1 --spread nominal"), std::string::npos);
}

TEST_F(Simulation, TellsTheTruthAndPlantsMisfortune) {
  RunningSimulation simulation(Arguments());
  ASSERT_TRUE(simulation.ready());
  const auto ask = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--control", control()});
    return RunToEnd(std::move(arguments));
  };
  const std::string out = scratch_ / "truth.csv";
  Put(scratch_ / "targets.csv", "unit_id,theta_deg,phi_deg\n11,0,180\n13,0,180\n");
  auto said = ask({"truth", "--out", out, "--targets", scratch_ / "targets.csv"});
  EXPECT_EQ(said.exit, 0) << said.err;
  EXPECT_NE(said.out.find("true position 0.0 um rms"), std::string::npos) << said.out;
  EXPECT_EQ(Slurp(out).substr(0, Slurp(out).find('\n')),
            "unit_id,theta_true_deg,phi_true_deg,theta_vectors,phi_vectors,theta_true_vectors,"
            "phi_true_vectors,x_mm,y_mm,state,moves_begun,last_move,powered,interrupted,begun_"
            "twice,began_s,clock_error");
  said = ask({"truth", "--json"});
  EXPECT_EQ(said.out.find("csv"), std::string::npos);
  EXPECT_NE(said.out.find("\"begun_twice\":0"), std::string::npos);

  EXPECT_EQ(ask({"power-cut", "--units", "11"}).exit, 0);
  EXPECT_EQ(ask({"silence", "--units", "12"}).exit, 0);
  EXPECT_EQ(ask({"fault", "--units", "13", "--code", "driver"}).exit, 0);
  BusClient eight(scratch_ / "bus8.sock");
  eight.Send(1, StatusRequest{});
  EXPECT_EQ(eight.ReceiveFromUnit<StatusReply>()->fault, FaultCode::kDriver);
  EXPECT_EQ(ask({"power-on", "--units", "11-11"}).exit, 0);
  BusClient three(scratch_ / "bus3.sock");
  three.Send(255, IdentifyRequest{});
  EXPECT_EQ(three.ReceiveFromUnit<IdentifyReply>()->serial, SerialNumber{1'000'011});
  EXPECT_EQ(ask({"silence", "--units", "12", "--off"}).exit, 0);
  three.Send(255, IdentifyRequest{});
  EXPECT_EQ(three.ReceiveFromUnit<IdentifyReply>()->serial, SerialNumber{1'000'011});
  EXPECT_EQ(three.ReceiveFromUnit<IdentifyReply>()->serial, SerialNumber{1'000'012});

  EXPECT_EQ(ask({"power-cut", "--units", "99"}).err, "focalfleet-sim: no unit 99 in this fleet\n");
  EXPECT_EQ(ask({"fault", "--units", "11", "--code", "bad_mood"}).exit, 1);
  EXPECT_EQ(ask({"power-cut", "--units", "eleven"}).exit, 2);
  EXPECT_EQ(ask({"kill-bus", "--buses", "5"}).exit, 1);
  EXPECT_EQ(ask({"kill-bus", "--buses", "3,8"}).exit, 0);
  EXPECT_NE(ask({"status"}).out.find("\"dead\":true"), std::string::npos);
  EXPECT_EQ(ask({"quit"}).exit, 0);
  EXPECT_EQ(simulation.Wait(), 0);
  EXPECT_EQ(ask({"quit"}).exit, 4);
}

TEST_F(Simulation, UnitsMisbehaveAsAskedUntilTheyBehaveAgain) {
  RunningSimulation simulation(Arguments());
  ASSERT_TRUE(simulation.ready());
  const auto misbehave = [&](const std::string& units, std::vector<std::string> how) {
    std::vector<std::string> all = {"misbehave", "--units", units, "--control", control()};
    all.insert(all.end(), how.begin(), how.end());
    return RunToEnd(std::move(all));
  };
  BusClient eight(scratch_ / "bus8.sock");
  BusClient three(scratch_ / "bus3.sock");
  EXPECT_EQ(misbehave("13", {"--copies", "3", "--foreign", "77"}).exit, 0);
  eight.Send(1, IdentifyRequest{});
  for (int copy = 0; copy < 3; ++copy)
    EXPECT_EQ(eight.ReceiveFromUnit<IdentifyReply>()->serial, SerialNumber{77});

  EXPECT_EQ(misbehave("13", {"--off", "--late", "2"}).exit, 0);
  eight.Send(1, StatusRequest{}, 1);
  // Unit 13 is late by two seconds of the fleet's time, in which unit 11 answers.
  three.Send(1, StatusRequest{}, 3);
  EXPECT_TRUE(three.ReceiveFromUnit<StatusReply>());
  EXPECT_TRUE(eight.ReceiveFromUnit<StatusReply>());
  eight.Send(1, ProgressRequest{}, 2);
  EXPECT_TRUE(eight.ReceiveFromUnit<ProgressReply>()) << "one copy again";

  EXPECT_EQ(misbehave("11-12", {"--deaf"}).exit, 0);
  three.Send(255, IdentifyRequest{});
  EXPECT_EQ(misbehave("12", {"--off"}).exit, 0);
  three.Send(255, IdentifyRequest{});
  EXPECT_EQ(three.ReceiveFromUnit<IdentifyReply>()->serial, SerialNumber{1'000'012});

  EXPECT_EQ(misbehave("13", {"--wrong-digest", "--mute-done"}).exit, 0);
  EXPECT_EQ(misbehave("13", {}).exit, 2);
  EXPECT_EQ(misbehave("13", {"--late", "nan"}).exit, 2);
  EXPECT_EQ(misbehave("13", {"--copies", "0"}).exit, 2);
  EXPECT_EQ(misbehave("13", {"--foreign", "-1"}).exit, 2);
  const auto two = misbehave("11-12", {"--foreign", "5"});
  EXPECT_EQ(two.exit, 1);
  EXPECT_EQ(two.err, "focalfleet-sim: one serial number is one unit's; 2 are named\n");
}

TEST_F(Simulation, PowerComesBackAfterItsTime) {
  RunningSimulation simulation(Arguments());
  ASSERT_TRUE(simulation.ready());
  BusClient bus(scratch_ / "bus8.sock");
  bus.Send(1, StatusRequest{true}, 1);
  ASSERT_TRUE(bus.ReceiveFromUnit<StatusReply>());
  ASSERT_EQ(
      RunToEnd({"power-cut", "--units", "13", "--seconds", "0.5", "--control", control()}).exit, 0);
  const auto powered = [&] {
    const std::string csv = RunToEnd({"truth", "--control", control()}).out;
    const std::size_t row = csv.find("\n13,");
    return row == std::string::npos || csv.find(",1,0,0,", row) != std::string::npos;
  };
  while (!powered()) {
  }
  bus.Send(1, StatusRequest{}, 2);
  const auto status = bus.ReceiveFromUnit<StatusReply>();
  ASSERT_TRUE(status);
  EXPECT_TRUE(status->restarted);
}

TEST_F(Simulation, SaysWhatIsWrongAndEnds) {
  const auto run = [&](std::vector<std::string> arguments) {
    return RunToEnd(std::move(arguments));
  };
  EXPECT_EQ(run({}).exit, 2);
  EXPECT_EQ(run({"--units", units()}).exit, 2);
  EXPECT_EQ(run({"--units", units(), "--unix-directory", "a", "--bus", "vcan0"}).exit, 2);
  EXPECT_EQ(run({"--units", units(), "--unix-directory", "a", "--spread", "wild"}).exit, 2);
  EXPECT_EQ(run({"--units", units(), "--unix-directory", "a", "--speed", "0"}).exit, 2);
  EXPECT_EQ(run({"dance"}).exit, 2);
  auto said = run({"--units", scratch_ / "none.csv", "--unix-directory", scratch_.path()});
  EXPECT_EQ(said.exit, 1);
  EXPECT_NE(said.err.find("none.csv"), std::string::npos);
  Put(scratch_ / "bad.csv", "unit_id,base_x_mm\n1,\n");
  said = run({"--units", scratch_ / "bad.csv", "--unix-directory", scratch_.path()});
  EXPECT_EQ(said.exit, 1);
  EXPECT_NE(said.err.find("bad.csv"), std::string::npos);
  said = run({"--units", units(), "--bus", "nocan0"});
  EXPECT_EQ(said.exit, 1);
  EXPECT_NE(said.err.find("1 interfaces are given for 2 buses"), std::string::npos) << said.err;
  said = run({"--units", units(), "--bus", "nocan0,nocan1"});
  EXPECT_EQ(said.exit, 1);
  EXPECT_NE(said.err.find("nocan0"), std::string::npos) << said.err;

  RunningSimulation first(Arguments());
  ASSERT_TRUE(first.ready());
  said = run({"--units", units(), "--unix-directory", scratch_.path()});
  EXPECT_EQ(said.exit, 1);
  EXPECT_NE(said.err.find("is in use"), std::string::npos) << said.err;
  // The first program is still there.
  BusClient bus(scratch_ / "bus8.sock");
  bus.Send(1, IdentifyRequest{});
  EXPECT_TRUE(bus.ReceiveFromUnit<IdentifyReply>());
}

TEST_F(Simulation, AStateFilePlacesTheUnits) {
  Put(scratch_ / "state.csv", "unit_id,theta_deg,phi_deg\n12,30,60\n");
  const auto lacks = RunToEnd(
      {"--units", units(), "--state", scratch_ / "state.csv", "--unix-directory", scratch_.path()});
  EXPECT_EQ(lacks.exit, 1);
  EXPECT_NE(lacks.err.find("state.csv: no row for units 11, 13"), std::string::npos) << lacks.err;
  Put(scratch_ / "state.csv", "unit_id,theta_deg,phi_deg\n12,30,60\n11,0,180\n13,0,180\n");
  RunningSimulation simulation(Arguments({"--state", scratch_ / "state.csv"}));
  ASSERT_TRUE(simulation.ready());
  Put(scratch_ / "targets.csv", "unit_id,theta_deg,phi_deg\n12,30,60\n");
  const auto said =
      RunToEnd({"truth", "--json", "--targets", scratch_ / "targets.csv", "--control", control()});
  EXPECT_EQ(said.exit, 0) << said.err;
  // The bound is half a vector of 4.2 mdeg at 16.5 mm.
  const auto at = said.out.find("\"rms_um\":");
  ASSERT_NE(at, std::string::npos) << said.out;
  EXPECT_LT(std::stod(said.out.substr(at + 9)), 1.3);
}

}  // namespace
}  // namespace focalfleet::simulator
