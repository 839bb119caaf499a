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
    "hidden_score --keys DIR --reports DIR [--json FILE] [--require FIGURE>=NUMBER]...\n"
    "             [--by-interval]\n"
    "  keys/NAME/key.json is held against reports/NAME/report.json. Ends with 1 where a required\n"
    "  figure is not met; --by-interval: where even the near end of its 95 % interval does not.\n";

struct Options {
  std::string keys;
  std::string reports;
  std::string json;
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
      options.keys = value;
    } else if (word == "--reports") {
      options.reports = value;
    } else if (word == "--json") {
      options.json = value;
    } else if (word == "--require") {
      FOCALFLEET_TRY_ASSIGN(Requirement requirement, ParseRequirement(value));
      options.required.push_back(std::move(requirement));
    } else {
      return Fail(ErrorCode::kInvalid, kHelp);
    }
  }
  if (options.keys.empty() || options.reports.empty()) return Fail(ErrorCode::kInvalid, kHelp);
  return options;
}

Result<std::vector<Case>> ReadCases(const Options& options) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(options.keys, error))
    if (fs::exists(entry.path() / "key.json")) names.push_back(entry.path().filename().string());
  if (error) return Fail(ErrorCode::kUnavailable, options.keys + ": " + error.message());
  if (names.empty()) return Fail(ErrorCode::kInvalid, options.keys + ": no keys in it");
  std::sort(names.begin(), names.end());
  std::vector<Case> cases;
  for (const std::string& name : names) {
    FOCALFLEET_TRY_ASSIGN(Case one,
                          ReadCase(name, TextOf(fs::path(options.keys) / name / "key.json"),
                                   TextOf(fs::path(options.reports) / name / "report.json")));
    cases.push_back(std::move(one));
  }
  return cases;
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
  if (!options->json.empty()) {
    std::ofstream out(options->json, std::ios::binary);
    out << JsonOf(score);
    if (!out.flush()) {
      std::fprintf(stderr, "hidden_score: %s: cannot be written\n", options->json.c_str());
      return 2;
    }
  }
  return Judge(*options, score) ? 0 : 1;
}

}  // namespace

}  // namespace focalfleet::hidden

int main(int argc, char** argv) { return focalfleet::hidden::Main(argc, argv); }
