// The marks of a JSON text that are outside of its strings, in one pass and without memory: enough
// to bound depth and number of values before a parser makes any of them.
#pragma once

#include <cstddef>
#include <string_view>

namespace focalfleet {

/// Calls `each(mark, at, depth)` for each of `[ ] { } ,` outside of strings, until it returns
/// false. `depth` counts the lists and objects that are open after the mark. A text that is no JSON
/// has marks, too.
template <class Each>
void ForEachJsonMark(std::string_view text, const Each& each) {
  std::size_t depth = 0;
  bool in_string = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (in_string) {
      if (c == '\\') ++at;  // the next character does not end the string
      if (c == '"') in_string = false;
      continue;
    }
    in_string = c == '"';
    if (c == '[' || c == '{') ++depth;
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if (std::string_view("[]{},").find(c) == std::string_view::npos) continue;
    if (!each(c, at, depth)) return;
  }
}

}  // namespace focalfleet
