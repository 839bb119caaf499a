// hall as a process: its files and columns, its answers, and bad input.
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <sstream>

#include "daemon/control/messages.h"
#include "tests/daemon/cli/program.h"
#include "tests/sim/hall/planted_rig.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ScratchFolder;
using test::Slurp;
using ::testing::HasSubstr;

constexpr double kDeg = 3.14159265358979323846 / 180;

std::string FieldText(double width_deg) {
  const auto law = test::OfSurface(0.08, width_deg);
  std::string text = "theta_deg,phi_deg,b_T\n";
  char line[96];
  for (int theta = 0; theta <= 180; theta += 6)
    for (int phi = 0; phi < 360; phi += 6) {
      const double s = std::sin(theta * kDeg);
      const test::Vec u = {s * std::cos(phi * kDeg), s * std::sin(phi * kDeg),
                           std::cos(theta * kDeg)};
      std::snprintf(line, sizeof line, "%d,%d,%.9g\n", theta, phi,
                    law({59 * u[0], 59 * u[1], 59 * u[2]}, u));
      text += line;
    }
  return text;
}

test::PlantedCampaign Campaign(const test::Planted& planted, double noise_T) {
  const auto law = test::OfSurface(0.08, 21);
  return test::MakeCampaign({.rows = 60, .noise_T = noise_T, .seed = 5}, law, law, planted);
}

// Returns the campaign's CSV with the voltages alone.
std::string VoltsText(const test::PlantedCampaign& campaign) {
  std::istringstream in(test::CampaignText(campaign, false));
  std::string out;
  for (std::string line; std::getline(in, line);) {
    std::size_t at = 0;
    for (int k = 0; k < 3; ++k) at = line.find(',', at) + 1;
    out += line.substr(at) + "\n";
  }
  return out;
}

std::vector<std::vector<std::string>> Cells(const std::string& text) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    rows.emplace_back();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

TEST(HallCommand, FitsAndOrients) {
  const ScratchFolder scratch;
  const std::string field = scratch.Put("field.csv", FieldText(21));
  for (const std::string kind : {"spherical", "surface", "harmonic"}) {
    const auto fit = Focalfleet({"hall", "fit", "--data", field, "--kind", kind, "--out",
                                 scratch / (kind + ".toml"), "--json"});
    ASSERT_EQ(fit.exit, 0) << fit.err;
    EXPECT_EQ(Json::parse(fit.out)["kind"], kind);
  }
  const auto campaign = Campaign({}, 0);
  const std::string volts = scratch.Put("volts.csv", VoltsText(campaign));
  const auto result = Focalfleet({"hall", "orient", "--model", scratch / "surface.toml", "--data",
                                  volts, "--out", scratch / "est.csv", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const auto rows = Cells(Slurp(scratch / "est.csv"));
  EXPECT_THAT(rows[0], ::testing::ElementsAre("alpha_deg", "beta_deg", "gamma_deg", "sd_alpha_deg",
                                              "sd_beta_deg", "sd_gamma_deg", "status"));
  ASSERT_EQ(rows.size(), campaign.poses.size() + 1);
  for (std::size_t k = 0; k < campaign.poses.size(); ++k) {
    EXPECT_NEAR(std::stod(rows[k + 1][0]), campaign.poses[k].alpha_deg, 1e-5);
    EXPECT_NEAR(std::stod(rows[k + 1][1]), campaign.poses[k].beta_deg, 1e-5);
    EXPECT_NEAR(std::stod(rows[k + 1][2]), campaign.poses[k].gamma_deg, 1e-5);
    EXPECT_EQ(rows[k + 1][6], "ok");
  }
  const auto out = Focalfleet(
      {"hall", "orient", "--model", scratch / "surface.toml", "--data", volts, "--out", "-"});
  EXPECT_EQ(out.out, Slurp(scratch / "est.csv"));
}

TEST(HallCommand, SensorsByFileAndByAnglesAreTheSame) {
  const ScratchFolder scratch;
  const std::string field = scratch.Put("field.csv", FieldText(21));
  ASSERT_EQ(
      Focalfleet({"hall", "fit", "--data", field, "--kind", "surface", "--out", scratch / "m.toml"})
          .exit,
      0);
  const std::string volts = scratch.Put("volts.csv", VoltsText(Campaign({}, 5e-4)));
  std::string sensors = "sensor,x,y,z\n";
  char line[128];
  int number = 0;
  for (const auto& u : test::PlantedSensors()) {
    std::snprintf(line, sizeof line, "%d,%.15g,%.15g,%.15g\n", ++number, u[0], u[1], u[2]);
    sensors += line;
  }
  const std::string file = scratch.Put("sensors.csv", sensors);
  const std::vector<std::string> common = {"hall",   "orient", "--model", scratch / "m.toml",
                                           "--data", volts,    "--out",   "-"};
  auto by_file = common, by_angles = common;
  by_file.insert(by_file.end(), {"--sensors", file});
  by_angles.insert(by_angles.end(), {"--sensor-angles-deg", "11.25,75,15"});
  const auto one = Cells(Focalfleet(by_file).out), two = Cells(Focalfleet(by_angles).out);
  const auto none = Cells(Focalfleet(common).out);
  ASSERT_EQ(one.size(), 61u);
  for (std::size_t k = 1; k < one.size(); ++k) {
    EXPECT_NEAR(std::stod(one[k][0]), std::stod(two[k][0]), 1e-9);
    EXPECT_EQ(two[k], none[k]);
  }
  by_file.insert(by_file.end(), {"--sensor-angles-deg", "11.25,75,15"});
  EXPECT_EQ(Focalfleet(by_file).exit, 1) << "both";
}

TEST(HallCommand, DiagnosesIntoItsReport) {
  const ScratchFolder scratch;
  const std::string poses =
      scratch.Put("poses.csv", test::CampaignText(Campaign({"sensor_gain", 0.05, 2}, 5e-4), true));
  const auto result =
      Focalfleet({"hall", "diagnose", "--data", poses, "--out", scratch / "report", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json report = Json::parse(Slurp(scratch / "report/report.json"));
  Json printed = Json::parse(result.out);
  EXPECT_EQ(printed["schema"], 1) << "of the answer; the file has none";
  printed.erase("schema");
  EXPECT_EQ(report, printed);
  EXPECT_EQ(report["verdict"], "explained");
  ASSERT_EQ(report["causes"].size(), 1u);
  const Json& cause = report["causes"][0];
  EXPECT_EQ(cause["cause"], "sensor_gain");
  EXPECT_EQ(cause["candidates"], Json::array({"sensor_gain"}));
  EXPECT_EQ(cause["units"], Json::array({3}));
  for (const char* key : {"axis", "scope", "amplitude", "amplitude_unit", "ci95", "rms_um",
                          "delta_log_likelihood", "predicted_gain_um"})
    EXPECT_TRUE(cause.contains(key)) << key;
  for (const char* key : {"rms_before_um", "rms_after_um", "noise_floor_um", "explained_fraction",
                          "mad_before_um", "mad_after_um", "held_out"})
    EXPECT_TRUE(report["gain"].contains(key)) << key;
  EXPECT_EQ(report["data"]["rows"], 60);
  EXPECT_THAT(Slurp(scratch / "report/report.html"), HasSubstr("Explained: sensor_gain"));
  // The extended model orients with the corrected gain.
  const std::string volts =
      scratch.Put("volts.csv", VoltsText(Campaign({"sensor_gain", 0.05, 2}, 5e-4)));
  const auto orient = Focalfleet({"hall", "orient", "--model", scratch / "report/model.toml",
                                  "--data", volts, "--out", scratch / "est.csv", "--json"});
  ASSERT_EQ(orient.exit, 0) << orient.err;
  EXPECT_EQ(Json::parse(orient.out)["sensors"], Json::array());
  const auto again = Focalfleet({"hall", "diagnose", "--model", scratch / "report/model.toml",
                                 "--data", poses, "--out", scratch / "again", "--json"});
  ASSERT_EQ(again.exit, 0) << again.err;
  EXPECT_EQ(Json::parse(again.out)["verdict"], "consistent");
}

// Returns the largest error of an angle over the rows that `orient` finished.
double WorstError(const std::string& estimates, const test::PlantedCampaign& campaign) {
  const auto rows = Cells(estimates);
  double worst_deg = 0;
  for (std::size_t k = 0; k < campaign.poses.size(); ++k) {
    const test::PlantedPose& pose = campaign.poses[k];
    const double truly_deg[] = {pose.alpha_deg, pose.beta_deg, pose.gamma_deg};
    for (std::size_t angle = 0; angle < 3; ++angle)
      worst_deg = std::max(worst_deg, std::abs(std::stod(rows[k + 1][angle]) - truly_deg[angle]));
  }
  return worst_deg;
}

TEST(HallCommand, CalibratesSensorsThatOrientTakes) {
  const ScratchFolder scratch;
  const std::string model = scratch.Put(
      "m.toml", "[field]\nkind = \"surface\"\namplitude_T = 0.08\nwidth_deg = 21\nphase_deg = 0\n");
  const auto law = test::OfSurface(0.08, 21);
  const std::vector<test::Planted> also = {{"sensor_offset", -0.05, 1},
                                           {"sensor_position", 1.5, 3}};
  const auto planted = [&](double noise_T, std::uint64_t seed) {
    return test::MakeCampaign({.rows = 120, .noise_T = noise_T, .also = also, .seed = seed}, law,
                              law, {"sensor_gain", 0.04, 6});
  };
  const std::string poses = scratch.Put("poses.csv", test::CampaignText(planted(1e-4, 7), true));
  const auto result = Focalfleet({"hall", "calibrate", "--model", model, "--data", poses, "--out",
                                  scratch / "sensors.csv", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json said = Json::parse(result.out);
  EXPECT_EQ(said["calibrated"], 8);
  EXPECT_NEAR(said["sensors"][6]["gain"], 1.04, 0.004);
  EXPECT_LT(said["sensors"][6]["sd_gain"], 0.004);
  EXPECT_NEAR(said["sensors"][1]["offset_V"], -0.05, 0.002);
  EXPECT_NEAR(said["rms_held_out_mV"], 2.5, 0.4) << "0.1 mT";
  EXPECT_THAT(
      Cells(Slurp(scratch / "sensors.csv"))[0],
      ::testing::ElementsAre("sensor", "x", "y", "z", "gain", "offset_V", "sd_gain", "sd_offset_V",
                             "sd_east_deg", "sd_north_deg", "readings", "rms_V", "status"));

  const auto again = planted(1e-4, 7);
  const std::string volts = scratch.Put("volts.csv", VoltsText(again));
  std::vector<std::string> orient = {"hall",   "orient", "--model", model,
                                     "--data", volts,    "--out",   "-"};
  const double before_deg = WorstError(Focalfleet(orient).out, again);
  orient.insert(orient.end(), {"--sensors", scratch / "sensors.csv"});
  const double after_deg = WorstError(Focalfleet(orient).out, again);
  EXPECT_GT(before_deg, 0.4);
  EXPECT_LT(after_deg, 0.15);

  const auto refused = [&](const std::string& with_model, const std::string& text) {
    const auto bad = Focalfleet({"hall", "calibrate", "--model", with_model, "--data",
                                 scratch.Put("bad.csv", text), "--out", scratch / "none.csv"});
    EXPECT_EQ(bad.exit, 1);
    return bad.err;
  };
  const std::string head = "alpha_deg,beta_deg,gamma_deg,v1_V,v2_V,v3_V,v4_V,v5_V,v6_V,v7_V,v8_V\n";
  EXPECT_THAT(refused(model, head + "1,2,3,1,2,3,4,1,2,3\n"), HasSubstr("bad.csv:2: 10 cells"));
  EXPECT_THAT(refused(model, head + "1,x,3,1,2,3,4,1,2,3,4\n"),
              HasSubstr("bad.csv:2: column beta_deg: 'x' is not a number"));
  EXPECT_THAT(refused(model, head + "1,2,3,1,2,3,4,1,2,3,4\n"),
              HasSubstr("no sensor can be calibrated"));
  const std::string known = scratch.Put("known.toml", Slurp(model) + "[[sensor]]\nsensor = 1\n");
  EXPECT_THAT(refused(known, head), HasSubstr("has [[sensor]]"));
  EXPECT_FALSE(std::filesystem::exists(scratch / "none.csv"));
  orient.back() = scratch.Put("s.csv", "sensor,x,y,z,gain\n1,1,0,0,0\n");
  EXPECT_THAT(Focalfleet(orient).err, HasSubstr("s.csv:2: column gain: 0 is no gain"));
}

TEST(HallCommand, BadInputIsRefusedByFileRowAndColumn) {
  const ScratchFolder scratch;
  const auto fit_error = [&](const std::string& text) {
    const auto result = Focalfleet(
        {"hall", "fit", "--data", scratch.Put("f.csv", text), "--out", scratch / "out.toml"});
    EXPECT_EQ(result.exit, 1) << text;
    return result.err;
  };
  EXPECT_THAT(fit_error("theta_deg,phi_deg\n1,2\n"), HasSubstr("f.csv:1: column b_T is missing"));
  EXPECT_THAT(fit_error("theta_deg,phi_deg,b_T\n10,0,0.1\n20,x,0.1\n"),
              HasSubstr("f.csv:3: column phi_deg: 'x' is not a number"));
  EXPECT_THAT(fit_error("theta_deg,phi_deg,b_T\n190,0,0.1\n"),
              HasSubstr("f.csv:2: column theta_deg: 190 is not between"));
  EXPECT_THAT(fit_error("theta_deg,phi_deg,b_T\n90,0,700\n"), HasSubstr("in tesla?"));
  EXPECT_THAT(fit_error("theta_deg,phi_deg,b_T\n90,0,\n"), HasSubstr("column b_T: the value is"));
  EXPECT_THAT(fit_error("theta_deg,phi_deg,b_T\n"), HasSubstr("no rows"));
  EXPECT_THAT(fit_error("theta_deg,phi_deg,b_T\n90,0,0.1\n"), HasSubstr("at least 12 points"));
  EXPECT_THAT(scratch.List(), ::testing::ElementsAre("f.csv")) << "nothing is written";

  const std::string model = scratch.Put(
      "m.toml", "[field]\nkind = \"surface\"\namplitude_T = 0.08\nwidth_deg = 21\nphase_deg = 0\n");
  const auto orient_error = [&](const std::string& text, const std::string& with = "") {
    std::vector<std::string> line = {"hall",  "orient",           "--model",
                                     model,   "--data",           scratch.Put("v.csv", text),
                                     "--out", scratch / "est.csv"};
    if (!with.empty()) line.insert(line.end(), {"--sensors", scratch.Put("s.csv", with)});
    const auto result = Focalfleet(line);
    EXPECT_EQ(result.exit, 1) << text;
    return result.err;
  };
  EXPECT_THAT(orient_error("v1_V,v2_V\n1,2\n"), HasSubstr("v.csv:1: column v3_V is missing"));
  const std::string head = "v1_V,v2_V,v3_V,v4_V,v5_V,v6_V,v7_V,v8_V\n";
  EXPECT_THAT(orient_error(head + "1,2,3,4,5,6,7,eight\n"),
              HasSubstr("v.csv:2: column v8_V: 'eight' is not a number"));
  EXPECT_THAT(orient_error(head + "1,2,3,4,5,6,7\n"), HasSubstr("v.csv:2: 7 cells"));
  EXPECT_THAT(orient_error(head + "1,2,3,4,5,6,7,inf\n"), HasSubstr("not finite"));
  const std::string row = head + "1,2,3,4,5,6,7,8\n";
  EXPECT_THAT(orient_error(row, "sensor,x,y,z\n1,1,0,0\n1,0,1,0\n"), HasSubstr("there twice"));
  EXPECT_THAT(orient_error(row, "sensor,x,y,z\n1,59,0,0\n"), HasSubstr("a unit vector"));

  const auto model_error = [&](const std::string& text) {
    return Focalfleet({"hall", "orient", "--model", scratch.Put("bad.toml", text), "--data",
                       scratch.Put("v.csv", row), "--out", scratch / "est.csv"})
        .err;
  };
  EXPECT_THAT(model_error("x = [\n"), HasSubstr("bad.toml:"));
  EXPECT_THAT(model_error("[field]\nkind = \"square\"\n"), HasSubstr("kind must be"));
  EXPECT_THAT(model_error("[field]\nkind = \"surface\"\namplitude_T = 1\nphase_deg = 0\n"),
              HasSubstr("width_deg is missing"));
  EXPECT_THAT(model_error("[field]\nkind = \"spherical\"\nterms = [[4, 5, 0, 0, 0, 0]]\n"),
              HasSubstr("bad.toml:3: order must be between 0 and 4"));
  EXPECT_THAT(model_error("name = \"x\"\n"), HasSubstr("not a model of a Hall rig"));
  EXPECT_EQ(Focalfleet({"hall"}).exit, 2);
  EXPECT_EQ(Focalfleet({"hall", "orient", "--model", model}).exit, 2);
}

TEST(HallCommand, ReproducesThePaper) {
  const ScratchFolder scratch;
  const auto result = Focalfleet({"hall", "reproduce", "--out", scratch / "claims", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json claims = Json::parse(Slurp(scratch / "claims/claims.json"));
  const auto find = [&](const std::string& id) -> Json {
    for (const Json& claim : claims)
      if (claim["id"] == id) return claim;
    ADD_FAILURE() << id;
    return {};
  };
  EXPECT_EQ(find("steepest_theta")["status"], "reproduced");
  EXPECT_NEAR(find("steepest_theta")["simulated"][0], 75.1508, 5e-5);
  EXPECT_NEAR(find("steepest_theta")["simulated"][1], 73.0294, 5e-5);
  EXPECT_NEAR(find("slope_ratio")["simulated"], 2, 0.1);
  EXPECT_NEAR(find("precision_ratio")["simulated"][0], 2.03, 0.01);
  EXPECT_EQ(find("precision_ratio")["status"], "disagrees");
  EXPECT_EQ(find("sensor_range")["status"], "disagrees");
  EXPECT_NEAR(find("sensor_range")["simulated"][0], 0.1, 1e-12);
  EXPECT_EQ(find("inversion")["status"], "reproduced");
  EXPECT_EQ(find("models")["status"], "ordering");
  EXPECT_LT(find("models")["simulated"][2], 0.05);
  const std::string page = Slurp(scratch / "claims/report.html");
  for (const char* figure : {"figure 4: alpha", "figure 5: beta", "figure 6", "figure 8",
                             "seen obliquely, 2D", "seen obliquely, 3D"})
    EXPECT_THAT(page, HasSubstr(figure));
}

}  // namespace
}  // namespace focalfleet
