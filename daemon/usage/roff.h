// Roff is a man page in the making, in the macros of man(7). Text is escaped as it comes in, so
// that a hyphen stays one that can be copied, and a point at the begin of a line is no request.
#pragma once

#include <string>
#include <string_view>

namespace focalfleet::usage {

class Roff {
 public:
  struct Title {
    std::string name;     // "focalfleet-plan"
    int section = 1;      // of the manual
    std::string version;  // "focalfleet 0.1.0"
    std::string manual;   // "focalfleet manual"
  };

  /// The page begins with its title and the section NAME.
  Roff(const Title& title, std::string_view what);

  void Section(std::string_view name);  // in capitals
  void Subsection(std::string_view name);
  void Paragraph(std::string_view text);
  /// A usage line: its first words are bold, as many as `bold_words`.
  void Usage(std::string_view line, std::size_t bold_words);
  /// An item of a list: `tag` in bold and `value` in italics, the text below.
  void Item(std::string_view tag, std::string_view value, std::string_view text);
  /// Lines as they stand.
  void Literal(std::string_view lines);
  /// References, "focalfleet(1), focalfleetd(8)".
  void References(std::string_view list);

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

}  // namespace focalfleet::usage
