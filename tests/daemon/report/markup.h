// A strict reader of markup for tests: every tag is closed in order, every attribute is quoted and
// unique, every entity is one of five. Returns what it read as a flat list of elements.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace focalfleet::report::test {

struct MarkupElement {
  std::string name;
  std::map<std::string, std::string> attributes;
  std::string text;  // directly inside, entities resolved
};

/// In document order; nothing where it is not well-formed.
std::optional<std::vector<MarkupElement>> ReadMarkup(std::string_view markup);

/// The elements of that name whose class attribute has that word; empty: any.
std::vector<MarkupElement> Select(const std::vector<MarkupElement>& elements, std::string_view name,
                                  std::string_view class_word = "");

/// The texts of all elements, one a line.
std::string TextOf(const std::vector<MarkupElement>& elements);

}  // namespace focalfleet::report::test
