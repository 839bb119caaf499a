// hidden_generate plants one campaign of a suite. Its caller decides what it writes: a campaign's
// folder for the diagnosis, or the key, in another call after the verdict.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "tests/hidden/generator/planted.h"

namespace focalfleet::hidden {

namespace {

constexpr const char* kHelp =
    "hidden_generate --seed S --index I [--campaign DIR] [--key DIR]\n"
    "  plants campaign I of suite S. --campaign writes moves.csv and units.csv, --key writes\n"
    "  key.json and contribution.csv. To fix what else is drawn: --kind null|single|composite|\n"
    "  unknown, --cause ID, --lambda L, --design survey|diagnostic|arcs, --class clean|dirty,\n"
    "  --units N, --moves M. --physics mechanisms|curves: the laws by which causes act.\n"
    "hidden_generate --causes   lists what can be planted\n";

Status MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) return Fail(ErrorCode::kUnavailable, path + ": " + error.message());
  return {};
}

Status Run(std::map<std::string, std::string> arguments) {
  Wishes wishes;
  wishes.kind = arguments["kind"];
  wishes.cause = arguments["cause"];
  wishes.design = arguments["design"];
  wishes.purity = arguments["class"];
  wishes.lambda = std::atof(arguments["lambda"].c_str());
  wishes.units = std::strtoull(arguments["units"].c_str(), nullptr, 10);
  wishes.moves = std::strtoull(arguments["moves"].c_str(), nullptr, 10);
  const std::string physics = arguments["physics"];
  if (!physics.empty() && physics != "mechanisms" && physics != "curves")
    return Fail(ErrorCode::kInvalid, "--physics is mechanisms or curves");
  wishes.physics = physics == "curves" ? Physics::kCurves : Physics::kMechanisms;
  if (!arguments["units"].empty() && (wishes.units < 2 || wishes.units > 5000))
    return Fail(ErrorCode::kInvalid, "--units is 2 to 5000");
  if (!arguments["moves"].empty() && (wishes.moves < 10 || wishes.moves > 2000))
    return Fail(ErrorCode::kInvalid, "--moves is 10 to 2000");
  FOCALFLEET_TRY_ASSIGN(const Spec spec,
                        DrawSpec(std::strtoull(arguments["seed"].c_str(), nullptr, 10),
                                 std::strtoull(arguments["index"].c_str(), nullptr, 10), wishes));
  const Planted planted = Plant(spec);
  const CampaignText text = Write(spec, planted.campaign, planted.measured);
  if (const std::string folder = arguments["campaign"]; !folder.empty()) {
    FOCALFLEET_TRY(MakeFolder(folder));
    FOCALFLEET_TRY(Save(folder + "/moves.csv", text.moves));
    FOCALFLEET_TRY(Save(folder + "/units.csv", text.units));
  }
  if (const std::string folder = arguments["key"]; !folder.empty()) {
    const Key key = MakeKey(planted);
    FOCALFLEET_TRY(MakeFolder(folder));
    FOCALFLEET_TRY(Save(folder + "/key.json", key.json));
    FOCALFLEET_TRY(Save(folder + "/contribution.csv", key.contribution_csv));
  }
  return {};
}

int Main(int argc, char** argv) {
  static const std::string kKnown =
      " seed index campaign key kind cause lambda design class units moves physics ";
  std::map<std::string, std::string> arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--causes") {
      for (const EffectKind& kind : Catalogue())
        std::printf("%s\n", std::string(kind.cause).c_str());
      return 0;
    }
    const std::string name{word.substr(std::min<std::size_t>(2, word.size()))};
    const bool known = word.substr(0, 2) == "--" && !name.empty() &&
                       kKnown.find(" " + name + " ") != std::string::npos && i + 1 < argc;
    if (!known) {
      std::fputs(kHelp, stderr);
      return 2;
    }
    arguments[name] = argv[++i];
  }
  if (arguments["seed"].empty() || arguments["index"].empty()) {
    std::fputs(kHelp, stderr);
    return 2;
  }
  const Status status = Run(std::move(arguments));
  if (!status) std::fprintf(stderr, "hidden_generate: %s\n", status.error().text.c_str());
  return status ? 0 : 1;
}

}  // namespace

}  // namespace focalfleet::hidden

int main(int argc, char** argv) { return focalfleet::hidden::Main(argc, argv); }
