// A strict reader of markup for tests. Every tag is closed in order, every attribute is quoted and
// unique, and every entity is one of five. The reader returns a flat list of elements.
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

/// Returns the elements in document order, or nothing where the markup is not well-formed.
std::optional<std::vector<MarkupElement>> ReadMarkup(std::string_view markup);

/// The elements with that name and with that word in their class attribute; empty: any.
std::vector<MarkupElement> Select(const std::vector<MarkupElement>& elements, std::string_view name,
                                  std::string_view class_word = "");

/// The texts of all elements, one a line.
std::string TextOf(const std::vector<MarkupElement>& elements);

}  // namespace focalfleet::report::test
