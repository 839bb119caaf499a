// The repository as its rules see it: the text of every file, and the few questions that all rules
// ask of a text. A rule is a function from files to complaints, so that each is tried on planted
// breaches before it judges the repository.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace focalfleet::tidy {

struct File {
  std::string path;  // from the repository's root, with '/'
  std::string text;
};
using Files = std::vector<File>;
using Complaints = std::vector<std::string>;
using Rule = Complaints (*)(const Files&);

/// Every text file of the repository. Cost: read once, some milliseconds.
const Files& Tree();

/// Each complaint fails the test that is running.
void ExpectNone(const Complaints& complaints);
/// Complaints of a rule about one planted file.
std::size_t Found(Rule rule, std::string path, std::string text);

bool StartsWith(std::string_view text, std::string_view prefix);
bool EndsWith(std::string_view text, std::string_view suffix);
bool IsCode(std::string_view path);
/// The folders without clocks, threads, files and sockets.
inline constexpr std::string_view kPureFolders[] = {"protocol/", "fleet/", "sim/"};
bool IsPure(std::string_view path);

std::vector<std::string> Lines(const std::string& text);
/// "path:line: what"; `line` counts from 0.
std::string At(const File& file, std::size_t line, std::string_view what);
bool IsWordCharacter(char c);
bool ContainsWord(std::string_view line, std::string_view word);

/// A line of code, taken apart.
struct SplitLine {
  std::string code;     // comments and the contents of string literals blanked, except in #include
  std::string comment;  // what follows // or ///, or stands within /* */
  std::size_t comment_column = 0;  // of its first slash; 0 within /* */
  bool has_code = false;
};
std::vector<SplitLine> SplitLines(const std::string& text);

}  // namespace focalfleet::tidy
