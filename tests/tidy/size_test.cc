// Rules of size: a file, and a class, that one reader can hold in mind.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <string>
#include <string_view>
#include <vector>

#include "tests/tidy/repository.h"

namespace focalfleet::tidy {
namespace {

constexpr std::size_t kFileLinesMax = 500;
constexpr std::size_t kDataMembersMax = 20;
constexpr std::size_t kFunctionsMax = 25;

Complaints FilesAreShort(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    const std::size_t lines = Lines(file.text).size();
    if (IsCode(file.path) && lines > kFileLinesMax)
      out.push_back(file.path + ": " + std::to_string(lines) + " lines");
  }
  return out;
}

// ---- classes

std::string CodeOf(const File& file) {
  std::string code;
  for (const SplitLine& line : SplitLines(file.text))
    if (line.code.find('#') == std::string::npos) code += line.code + "\n";
  return code;
}

bool WordAt(const std::string& text, std::size_t at, std::string_view word) {
  return text.compare(at, word.size(), word) == 0 && (at == 0 || !IsWordCharacter(text[at - 1])) &&
         (at + word.size() == text.size() || !IsWordCharacter(text[at + word.size()]));
}

// Template arguments hide commas and parentheses that count for nothing.
std::string WithoutTemplateArguments(const std::string& text) {
  std::string out;
  int depth = 0;
  for (const char c : text) {
    if (c == '<') ++depth;
    if (depth == 0) out += c;
    if (c == '>' && depth > 0) --depth;
  }
  return out;
}

std::string WithoutAccess(std::string declaration) {
  for (const std::string_view access : {"public:", "private:", "protected:"})
    for (std::size_t at = declaration.find(access); at != std::string::npos;
         at = declaration.find(access))
      declaration.erase(0, at + access.size());
  const std::size_t first = declaration.find_first_not_of(" \n");
  return first == std::string::npos ? "" : declaration.substr(first);
}

struct Size {
  std::size_t data_members = 0;
  std::size_t functions = 0;
};

bool IsFunction(const std::string& declaration) {
  const std::string plain = WithoutTemplateArguments(declaration);
  return plain.substr(0, plain.find_first_of("={")).find('(') != std::string::npos;
}

void Count(const std::string& text, Size* size) {
  const std::string declaration = WithoutAccess(text);
  if (declaration.empty()) return;
  for (const std::string_view word :
       {"using", "friend", "enum", "class", "struct", "static_assert", "typedef", "union"})
    if (WordAt(declaration, 0, word)) return;
  if (IsFunction(declaration)) {
    ++size->functions;
    return;
  }
  if (StartsWith(declaration, "static const")) return;
  const std::string plain = WithoutTemplateArguments(declaration);
  const std::string names = plain.substr(0, plain.find_first_of("={"));
  size->data_members += 1 + static_cast<std::size_t>(std::count(names.begin(), names.end(), ','));
}

// Sizes of the class whose body begins at `at`, behind its brace. A constructor's initialisers and
// a function's body count for nothing; a class within it counts for itself.
Size SizeOfBody(const std::string& code, std::size_t at) {
  Size size;
  std::string declaration;
  for (int depth = 1; at < code.size() && depth > 0; ++at) {
    const char c = code[at];
    if (c == '{' && ++depth == 2) declaration += c;
    if (c == '}' && --depth == 1 && IsFunction(WithoutAccess(declaration))) {
      Count(declaration, &size);
      declaration.clear();
    }
    if (depth != 1 || c == '}' || c == '{') continue;
    if (c == ';') {
      Count(declaration, &size);
      declaration.clear();
    } else {
      declaration += c;
    }
  }
  return size;
}

// Plain values, structs without functions, may have as many fields as there are things to say.
Complaints ClassesAreSmall(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    if (!IsCode(file.path)) continue;
    const std::string code = CodeOf(file);
    for (std::size_t at = 0; at < code.size(); ++at) {
      const bool is_class = WordAt(code, at, "class");
      if (!is_class && !WordAt(code, at, "struct")) continue;
      const std::size_t begin = code.find_first_of("{;()=>", at);
      if (begin == std::string::npos || code[begin] != '{') continue;
      const Size size = SizeOfBody(code, begin + 1);
      if (!is_class && size.functions == 0) continue;
      if (size.data_members <= kDataMembersMax && size.functions <= kFunctionsMax) continue;
      const auto line = static_cast<std::size_t>(
          std::count(code.begin(), code.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
      out.push_back(At(file, line,
                       code.substr(at, begin - at) + "has " + std::to_string(size.data_members) +
                           " data members and " + std::to_string(size.functions) + " functions"));
    }
  }
  return out;
}

TEST(Tidy, FilesAreShort) { ExpectNone(FilesAreShort(Tree())); }
TEST(Tidy, ClassesAreSmall) { ExpectNone(ClassesAreSmall(Tree())); }

std::string Repeated(const std::string& text, int times) {
  std::string out;
  for (int i = 0; i < times; ++i) out += text;
  return out;
}

TEST(TidyRules, LongFilesAreCaught) {
  EXPECT_EQ(Found(FilesAreShort, "fleet/a.cc", std::string(501, '\n')), 1u);
  EXPECT_EQ(Found(FilesAreShort, "fleet/a.cc", std::string(500, '\n')), 0u);
  EXPECT_EQ(Found(FilesAreShort, "docs/a.md", std::string(501, '\n')), 0u);
}

TEST(TidyRules, LargeClassesAreCaught) {
  const auto found = [](const std::string& body) {
    return Found(ClassesAreSmall, "fleet/a.h", "class A final : public B {\n" + body + "};\n");
  };
  EXPECT_EQ(found(Repeated("  int a_ = 0;\n", 21)), 1u);
  EXPECT_EQ(found(Repeated("  int a_ = 0;\n", 20)), 0u);
  EXPECT_EQ(found(Repeated("  std::map<int, int> a_{1, 2};\n", 20)), 0u);
  EXPECT_EQ(found(Repeated("  int a_, b_;\n", 11)), 1u);
  EXPECT_EQ(found(Repeated("  void F(int a);\n", 26)), 1u);
  EXPECT_EQ(found(Repeated("  void F() { int x; G(); }\n", 26)), 1u);
  EXPECT_EQ(found(Repeated("  void F() const { return a_; }\n", 25)), 0u);
  EXPECT_EQ(found(Repeated("  std::function<void(int)> a_;\n", 21)), 1u);
  EXPECT_EQ(found(Repeated("  using X = int;\n  static constexpr int kX = 1;\n", 30)), 0u);
  EXPECT_EQ(found(Repeated("  struct X { int a; int b; };\n", 21)), 0u) << "classes of their own";
  const std::string fields = Repeated("  int a = 0;\n", 21);
  EXPECT_EQ(Found(ClassesAreSmall, "fleet/a.h", "struct A {\n" + fields + "};\n"), 0u) << "values";
  EXPECT_EQ(Found(ClassesAreSmall, "fleet/a.h", "struct A {\n" + fields + "void F();};\n"), 1u);
  EXPECT_EQ(Found(ClassesAreSmall, "fleet/a.h", "enum class A { a, b };\n"), 0u);
}

}  // namespace
}  // namespace focalfleet::tidy
