// hidden_score scores the verdicts on a suite by its keys.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "tests/hidden/score/score.h"

namespace focalfleet::hidden {

namespace {

namespace fs = std::filesystem;

constexpr const char* kHelp =
    "hidden_score {--keys DIR --reports DIR}... [--json FILE] [--picture FILE]\n"
    "             [--require FIGURE>=NUMBER]... [--by-interval]\n"
    "  keys/NAME/key.json is held against reports/NAME/report.json; several suites are scored as\n"
    "  one. --picture draws the reliability of the stated probabilities as SVG. Ends with 1 where\n"
    "  a required figure is not met; --by-interval: where even the near end of its 95 % interval\n"
    "  does not.\n";

struct Options {
  std::vector<std::string> keys;     // of each suite
  std::vector<std::string> reports;  // Shape: as keys
  std::string json;
  std::string picture;
  std::vector<Requirement> required;
  bool by_interval = false;
};

std::string TextOf(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

Result<Options> Parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--by-interval") {
      options.by_interval = true;
      continue;
    }
    if (i + 1 >= argc) return Fail(ErrorCode::kInvalid, kHelp);
    const std::string value = argv[++i];
    if (word == "--keys") {
      options.keys.push_back(value);
    } else if (word == "--reports") {
      options.reports.push_back(value);
    } else if (word == "--json") {
      options.json = value;
    } else if (word == "--picture") {
      options.picture = value;
    } else if (word == "--require") {
      FOCALFLEET_TRY_ASSIGN(Requirement requirement, ParseRequirement(value));
      options.required.push_back(std::move(requirement));
    } else {
      return Fail(ErrorCode::kInvalid, kHelp);
    }
  }
  if (options.keys.empty() || options.keys.size() != options.reports.size())
    return Fail(ErrorCode::kInvalid, kHelp);
  return options;
}

Status ReadSuite(const std::string& keys, const std::string& reports, std::vector<Case>* cases) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(keys, error))
    if (fs::exists(entry.path() / "key.json")) names.push_back(entry.path().filename().string());
  if (error) return Fail(ErrorCode::kUnavailable, keys + ": " + error.message());
  if (names.empty()) return Fail(ErrorCode::kInvalid, keys + ": no keys in it");
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) {
    FOCALFLEET_TRY_ASSIGN(Case one, ReadCase(name, TextOf(fs::path(keys) / name / "key.json"),
                                             TextOf(fs::path(reports) / name / "report.json")));
    cases->push_back(std::move(one));
  }
  return {};
}

Result<std::vector<Case>> ReadCases(const Options& options) {
  std::vector<Case> cases;
  for (std::size_t k = 0; k < options.keys.size(); ++k)
    FOCALFLEET_TRY(ReadSuite(options.keys[k], options.reports[k], &cases));
  return cases;
}

bool Write(const std::string& path, const std::string& text) {
  if (path.empty()) return true;
  std::ofstream out(path, std::ios::binary);
  out << text;
  if (out.flush()) return true;
  std::fprintf(stderr, "hidden_score: %s: cannot be written\n", path.c_str());
  return false;
}

bool Judge(const Options& options, const Score& score) {
  bool met = true;
  for (const Requirement& requirement : options.required) {
    const auto figure = std::find_if(score.figures.begin(), score.figures.end(),
                                     [&](const Figure& f) { return f.id == requirement.id; });
    if (figure == score.figures.end()) {
      std::fprintf(stderr, "hidden_score: no figure is called %s\n", requirement.id.c_str());
      met = false;
    } else if (!Meets(*figure, requirement, options.by_interval)) {
      std::fprintf(stderr, "hidden_score: %s is %g of %d, required %s %g\n", requirement.id.c_str(),
                   figure->value, figure->trials,
                   requirement.at_least ? ">=" : "<=", requirement.bound);
      met = false;
    }
  }
  return met;
}

int Main(int argc, char** argv) {
  const auto options = Parse(argc, argv);
  if (!options) {
    std::fprintf(stderr, "%s\n", options.error().text.c_str());
    return 2;
  }
  const auto cases = ReadCases(*options);
  if (!cases) {
    std::fprintf(stderr, "hidden_score: %s\n", cases.error().text.c_str());
    return 2;
  }
  const Score score = ScoreCases(*cases);
  std::fputs(TablesOf(score).c_str(), stdout);
  if (!Write(options->json, JsonOf(score)) ||
      !Write(options->picture, PictureOf(score.reliability)))
    return 2;
  return Judge(*options, score) ? 0 : 1;
}

}  // namespace

}  // namespace focalfleet::hidden

int main(int argc, char** argv) { return focalfleet::hidden::Main(argc, argv); }
