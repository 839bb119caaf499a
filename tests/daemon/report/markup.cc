#include "tests/daemon/report/markup.h"

#include <cstddef>
#include <utility>

namespace focalfleet::report::test {
namespace {

bool IsNameCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
}

class Reader {
 public:
  explicit Reader(std::string_view rest) : rest_(rest) {}

  bool Read() {
    Take("<!DOCTYPE html>\n");
    while (!rest_.empty()) {
      if (!(rest_[0] == '<' ? ReadTag() : ReadText())) return false;
    }
    return open_.empty() && !elements_.empty();
  }

  std::vector<MarkupElement> Elements() && { return std::move(elements_); }

 private:
  bool Take(std::string_view expected) {
    if (rest_.substr(0, expected.size()) != expected) return false;
    rest_.remove_prefix(expected.size());
    return true;
  }

  std::string Name() {
    std::size_t length = 0;
    while (length < rest_.size() && IsNameCharacter(rest_[length])) ++length;
    std::string name(rest_.substr(0, length));
    rest_.remove_prefix(length);
    return name;
  }

  // Reads up to the first of `ends`; false where '<' or an unknown entity comes before.
  bool Characters(std::string_view ends, std::string* out) {
    static const std::pair<std::string_view, char> kEntities[] = {
        {"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&#39;", '\''}};
    while (!rest_.empty() && ends.find(rest_[0]) == std::string_view::npos) {
      if (rest_[0] == '<') return false;
      bool resolved = false;
      for (const auto& [entity, character] : kEntities) {
        if (resolved || !Take(entity)) continue;
        *out += character;
        resolved = true;
      }
      if (resolved) continue;
      if (rest_[0] == '&') return false;
      *out += rest_[0];
      rest_.remove_prefix(1);
    }
    return true;
  }

  bool ReadText() {
    std::string text;
    if (!Characters("<", &text)) return false;
    if (!open_.empty()) elements_[open_.back()].text += text;
    return !open_.empty() || text.find_first_not_of('\n') == std::string::npos;
  }

  bool ReadTag() {
    if (Take("</")) {
      const std::string name = Name();
      if (open_.empty() || elements_[open_.back()].name != name || !Take(">")) return false;
      open_.pop_back();
      return true;
    }
    if (!Take("<")) return false;
    if (open_.empty() && !elements_.empty()) return false;  // a second root
    MarkupElement element{.name = Name()};
    if (element.name.empty()) return false;
    while (Take(" ")) {
      const std::string attribute = Name();
      std::string value;
      if (attribute.empty() || !Take("=\"") || !Characters("\"", &value) || !Take("\"")) {
        return false;
      }
      if (!element.attributes.emplace(attribute, value).second) return false;
    }
    elements_.push_back(std::move(element));
    if (Take("/>")) return true;
    open_.push_back(elements_.size() - 1);
    return Take(">");
  }

  std::string_view rest_;
  std::vector<std::size_t> open_;
  std::vector<MarkupElement> elements_;
};

}  // namespace

std::optional<std::vector<MarkupElement>> ReadMarkup(std::string_view markup) {
  Reader reader(markup);
  if (!reader.Read()) return std::nullopt;
  return std::move(reader).Elements();
}

std::vector<MarkupElement> Select(const std::vector<MarkupElement>& elements, std::string_view name,
                                  std::string_view class_word) {
  std::vector<MarkupElement> selected;
  for (const MarkupElement& element : elements) {
    const auto classes = element.attributes.find("class");
    const std::string words =
        classes == element.attributes.end() ? " " : " " + classes->second + " ";
    const std::string word = class_word.empty() ? " " : " " + std::string(class_word) + " ";
    if (element.name == name && words.find(word) != std::string::npos) selected.push_back(element);
  }
  return selected;
}

std::string TextOf(const std::vector<MarkupElement>& elements) {
  std::string text;
  for (const MarkupElement& element : elements) text += element.text + "\n";
  return text;
}

}  // namespace focalfleet::report::test
