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
    code += (line.code.find('#') == std::string::npos ? line.code : "") + "\n";
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
  std::size_t bodies = 0;  // functions that are neither pure virtual nor left to the compiler
};

bool IsFunction(const std::string& declaration) {
  if (ContainsWord(declaration.substr(0, declaration.find('(')), "operator")) return true;
  const std::string plain = WithoutTemplateArguments(declaration);
  return plain.substr(0, plain.find_first_of("={")).find('(') != std::string::npos;
}

bool IsPureOrDefault(const std::string& declaration) {
  return EndsWith(declaration, "= 0") || EndsWith(declaration, "= default");
}

void Count(const std::string& text, Size* size) {
  const std::string declaration = WithoutAccess(text);
  if (declaration.empty()) return;
  for (const std::string_view word :
       {"using", "friend", "enum", "class", "struct", "static_assert", "typedef", "union"})
    if (WordAt(declaration, 0, word)) return;
  if (IsFunction(declaration)) {
    if (EndsWith(declaration, "= delete")) return;
    ++size->functions;
    if (!IsPureOrDefault(declaration)) ++size->bodies;
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

struct Class {
  std::string head;  // from `class` to its brace
  std::string name;
  std::vector<std::string> bases;  // without namespaces and template arguments
  std::size_t file = 0;            // index in the files
  std::size_t line = 0;
  bool is_class = false;
  Size own;
};

// The brace of the class whose keyword stands at `at`; npos: no class is defined there.
std::size_t BraceOf(const std::string& code, std::size_t at) {
  int depth = 0;
  for (; at < code.size(); ++at) {
    const char c = code[at];
    if (c == '{') return at;
    if (c == '<') ++depth;
    if (std::string_view(";()=").find(c) != std::string_view::npos || (c == '>' && --depth < 0))
      break;
  }
  return std::string::npos;
}

// The last word of a text that names a type, without `final`.
std::string LastWord(std::string text) {
  std::string word;
  for (const char c : text + " ") {
    if (IsWordCharacter(c)) {
      word += c;
    } else if (!word.empty()) {
      text = word == "final" ? text : word;
      word.clear();
    }
  }
  return text;
}

void SplitHead(const std::string& head, Class* it) {
  const std::string plain = WithoutTemplateArguments(head);
  std::size_t colon = plain.find(':');
  while (colon != std::string::npos && colon + 1 < plain.size() && plain[colon + 1] == ':')
    colon = plain.find(':', colon + 2);
  it->name = LastWord(plain.substr(0, colon));
  for (std::size_t at = colon; at != std::string::npos;) {
    const std::size_t comma = plain.find(',', at);
    const std::size_t count = comma == std::string::npos ? comma : comma - at;
    it->bases.push_back(LastWord(plain.substr(at, count)));
    at = comma == std::string::npos ? comma : comma + 1;
  }
}

std::vector<Class> ClassesOf(const Files& files) {
  std::vector<Class> out;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (!IsCode(files[i].path)) continue;
    const std::string code = CodeOf(files[i]);
    for (std::size_t at = 0; at < code.size(); ++at) {
      const bool is_class = WordAt(code, at, "class");
      if (!is_class && !WordAt(code, at, "struct")) continue;
      const std::size_t begin = BraceOf(code, at);
      if (begin == std::string::npos) continue;
      Class it;
      it.head = code.substr(at, begin - at);
      it.file = i;
      it.is_class = is_class;
      it.line = static_cast<std::size_t>(
          std::count(code.begin(), code.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
      it.own = SizeOfBody(code, begin + 1);
      SplitHead(it.head, &it);
      out.push_back(std::move(it));
    }
  }
  return out;
}

// The class of the tree that `name` means in the file of `user`: one of that file or of a header
// that it includes, or the only one of that name. Null: a class of a library, or unclear.
const Class* Meant(const std::string& name, const Class& user, const std::vector<Class>& classes,
                   const Files& files) {
  const Class* included = nullptr;
  const Class* any = nullptr;
  std::size_t count = 0;
  for (const Class& it : classes) {
    if (it.name != name || &it == &user) continue;
    if (it.file == user.file) return &it;
    if (files[user.file].text.find("\"" + files[it.file].path + "\"") != std::string::npos)
      included = &it;
    any = &it;
    ++count;
  }
  if (included != nullptr) return included;
  return count == 1 ? any : nullptr;
}

// A base gives its members to the class; a base without data and bodies is an interface and gives
// none.
Size WithBases(const Class& it, const std::vector<Class>& classes, const Files& files, int depth) {
  Size size = it.own;
  for (const std::string& name : it.bases) {
    const Class* base = Meant(name, it, classes, files);
    if (base == nullptr || depth == 0) continue;
    const Size more = WithBases(*base, classes, files, depth - 1);
    if (more.data_members == 0 && more.bodies == 0) continue;
    size.data_members += more.data_members;
    size.functions += more.functions;
    size.bodies += more.bodies;
  }
  return size;
}

// Plain values, structs without functions, may have as many fields as there are things to say.
Complaints ClassesAreSmall(const Files& files) {
  constexpr int kBasesDeep = 8;
  Complaints out;
  const std::vector<Class> classes = ClassesOf(files);
  for (const Class& it : classes) {
    const Size size = WithBases(it, classes, files, kBasesDeep);
    if (!it.is_class && size.functions == 0) continue;
    if (size.data_members <= kDataMembersMax && size.functions <= kFunctionsMax) continue;
    out.push_back(At(files[it.file], it.line,
                     it.head + "has " + std::to_string(size.data_members) + " data members and " +
                         std::to_string(size.functions) + " functions"));
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
  EXPECT_EQ(found(Repeated("  bool operator<(const A& other) const;\n", 26)), 1u);
  EXPECT_EQ(found(Repeated("  A& operator=(const A&) = delete;\n", 26)), 0u) << "absent";
  EXPECT_EQ(found(Repeated("  std::function<void(int)> a_;\n", 21)), 1u);
  EXPECT_EQ(found(Repeated("  using X = int;\n  static constexpr int kX = 1;\n", 30)), 0u);
  EXPECT_EQ(found(Repeated("  struct X { int a; int b; };\n", 21)), 0u) << "classes of their own";
  const std::string fields = Repeated("  int a = 0;\n", 21);
  EXPECT_EQ(Found(ClassesAreSmall, "fleet/a.h", "struct A {\n" + fields + "};\n"), 0u) << "values";
  EXPECT_EQ(Found(ClassesAreSmall, "fleet/a.h", "struct A {\n" + fields + "void F();};\n"), 1u);
  EXPECT_EQ(Found(ClassesAreSmall, "fleet/a.h", "enum class A { a, b };\n"), 0u);
}

TEST(TidyRules, BasesCountAsPartsOfAClass) {
  const std::string functions = Repeated("  void F() { G(); }\n", 13);
  const auto found = [](const std::string& base, const std::string& derived) {
    return ClassesAreSmall({{"sim/b.h", base}, {"sim/a.h", "#include \"sim/b.h\"\n" + derived}})
        .size();
  };
  const auto base = [](const std::string& body) { return "class B {\n" + body + "};\n"; };
  const auto derived = [](const std::string& body) {
    return "class A final : public x::B {\n" + body + "};\n";
  };
  EXPECT_EQ(found(base(functions), derived(functions)), 1u);
  EXPECT_EQ(found(base(functions), derived(Repeated("  void F();\n", 12))), 0u);
  EXPECT_EQ(found(base(Repeated("  int a_ = 0;\n", 11)), derived(Repeated("  int b_;\n", 10))), 1u);
  EXPECT_EQ(found(base(functions), "class M : B {};\nclass A : M {\n" + functions + "};\n"), 1u);
  EXPECT_EQ(found(base(functions), "class A : C<D>, B {\n" + functions + "};\n"), 1u);
  EXPECT_EQ(found(base(functions), "struct A : B {\n" + functions + "};\n"), 1u);
  const std::string pure = Repeated("  virtual void F(int a) const = 0;\n", 13);
  const std::string pinned = "  B& operator=(const B&) = delete;\n  virtual ~B() = default;\n";
  EXPECT_EQ(found(base(pure + pinned), derived(functions)), 0u);
  EXPECT_EQ(found(base(pure + "  void F();\n"), derived(functions)), 1u);
  // Two classes of one name: the included one is meant.
  const std::string other = "class B {\n" + functions + "};\n";
  EXPECT_EQ(ClassesAreSmall({{"fleet/b.h", other},
                             {"sim/b.h", base("")},
                             {"sim/a.h", "#include \"sim/b.h\"\n" + derived(functions)}})
                .size(),
            0u);
  const auto line = ClassesAreSmall(
      {{"sim/b.h", base(functions)}, {"sim/a.h", "#include \"sim/b.h\"\n" + derived(functions)}});
  ASSERT_EQ(line.size(), 1u);
  EXPECT_EQ(line[0].find("sim/a.h:2: class A final : public x::B has 0 data members and 26"), 0u)
      << line[0];
  EXPECT_EQ(Found(ClassesAreSmall, "fleet/a.h", "template <class A>\nvoid F() {\n}\n"), 0u);
}

}  // namespace
}  // namespace focalfleet::tidy
