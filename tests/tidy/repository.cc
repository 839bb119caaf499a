#include "tests/tidy/repository.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <utility>

namespace focalfleet::tidy {
namespace {

namespace fs = std::filesystem;

Files Repository() {
  Files files;
  const fs::path root = FOCALFLEET_SOURCE_DIR;
  const std::set<std::string> folders = {"protocol", "fleet",  "sim",  "daemon",
                                         "tests",    "deploy", "docs", ".ci"};
  const auto read = [&](const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::string text((std::istreambuf_iterator<char>(in)), {});
    if (text.find('\0') != std::string::npos) return;  // a picture, a corpus file
    files.push_back({fs::relative(path, root).generic_string(), std::move(text)});
  };
  for (const auto& top : fs::directory_iterator(root)) {
    const std::string name = top.path().filename().string();
    // In a worktree, .git is a file with a path of the machine.
    if (top.is_regular_file() && name != ".git") read(top.path());
    if (!top.is_directory() || folders.count(name) == 0) continue;
    for (const auto& entry : fs::recursive_directory_iterator(top.path())) {
      const std::string path = entry.path().string();
      const auto is_in = [&](const char* part) { return path.find(part) != std::string::npos; };
      // Files of others follow their rules; what this project says about them follows its own.
      const bool foreign = is_in("/third_party/") && !EndsWith(path, "/README.md");
      const bool data = is_in("/corpus/") || is_in("/data/") || foreign;
      if (entry.is_regular_file() && !data) read(entry.path());
    }
  }
  return files;
}

}  // namespace

const Files& Tree() {
  static const Files files = Repository();
  return files;
}

void ExpectNone(const Complaints& complaints) {
  for (const std::string& complaint : complaints) ADD_FAILURE() << complaint;
}

std::size_t Found(Rule rule, std::string path, std::string text) {
  return rule({{std::move(path), std::move(text)}}).size();
}

bool StartsWith(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}
bool EndsWith(std::string_view text, std::string_view suffix) {
  return text.size() >= suffix.size() && text.substr(text.size() - suffix.size()) == suffix;
}
bool IsCode(std::string_view path) {
  return EndsWith(path, ".h") || EndsWith(path, ".cc") || EndsWith(path, ".c");
}
bool IsPure(std::string_view path) {
  return std::any_of(std::begin(kPureFolders), std::end(kPureFolders),
                     [&](std::string_view folder) { return StartsWith(path, folder); });
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::string At(const File& file, std::size_t line, std::string_view what) {
  return file.path + ":" + std::to_string(line + 1) + ": " + std::string(what);
}

bool IsWordCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}
bool ContainsWord(std::string_view line, std::string_view word) {
  for (std::size_t at = line.find(word); at != std::string_view::npos;
       at = line.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    const bool begins = at == 0 || !IsWordCharacter(line[at - 1]) || !IsWordCharacter(word.front());
    const bool ends =
        end == line.size() || !IsWordCharacter(line[end]) || !IsWordCharacter(word.back());
    if (begins && ends) return true;
  }
  return false;
}

std::vector<SplitLine> SplitLines(const std::string& text) {
  std::vector<SplitLine> out;
  bool in_block = false;
  std::string raw_end;  // of a raw string that is open
  for (const std::string& line : Lines(text)) {
    SplitLine split;
    char quote = 0;
    const bool include = line.find("#include") != std::string::npos;
    for (std::size_t i = 0; i < line.size(); ++i) {
      const std::string_view rest{line.data() + i, line.size() - i};
      if (!raw_end.empty()) {
        if (StartsWith(rest, raw_end)) i += raw_end.size() - 1, raw_end.clear();
      } else if (in_block) {
        if (StartsWith(rest, "*/"))
          in_block = false, ++i;
        else
          split.comment += line[i];
      } else if (quote != 0) {
        if (line[i] == '\\')
          ++i;
        else if (line[i] == quote)
          quote = 0;
      } else if (StartsWith(rest, "//")) {
        split.comment_column = i;
        split.comment = rest.substr(StartsWith(rest, "///") ? 3 : 2);
        break;
      } else if (StartsWith(rest, "/*")) {
        in_block = true, ++i;
      } else if (StartsWith(rest, "R\"")) {
        const std::size_t open = rest.find('(');
        raw_end = ")" + std::string(rest.substr(2, open - 2)) + "\"";
        i += open;
      } else if (!include && (line[i] == '"' ||
                              (line[i] == '\'' && (i == 0 || !IsWordCharacter(line[i - 1]))))) {
        quote = line[i];
      } else {
        split.code += line[i];
        split.has_code = split.has_code || line[i] != ' ';
      }
    }
    out.push_back(std::move(split));
  }
  return out;
}

}  // namespace focalfleet::tidy
