#include "daemon/usage/roff.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

namespace focalfleet::usage {
namespace {

/// Within a line: hyphens and backslashes.
std::string Escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '\\':
        out += "\\e";
        break;
      case '-':
        out += "\\-";
        break;
      case '~':
        out += "\\(ti";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '\'':
        out += "\\(aq";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// A line that begins with a point would be a request.
std::string Line(std::string_view text) {
  const std::string escaped = Escaped(text);
  return (escaped.starts_with('.') ? "\\&" : "") + escaped + "\n";
}

std::string Quoted(std::string_view text) {
  return "\"" + CLI::detail::find_and_replace(Escaped(text), "\"", "\\(dq") + "\"";
}

}  // namespace

Roff::Roff(const Title& title, std::string_view what) {
  std::string upper = title.name;
  for (char& c : upper) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  text_ = fmt::format(".TH {} {} \"\" {} {}\n", Quoted(upper), title.section, Quoted(title.version),
                      Quoted(title.manual));
  Section("NAME");
  text_ += Escaped(title.name) + " \\- " + Escaped(what) + "\n";
}

void Roff::Section(std::string_view name) { text_ += ".SH " + Quoted(name) + "\n"; }

void Roff::Subsection(std::string_view name) { text_ += ".SS " + Quoted(name) + "\n"; }

void Roff::Paragraph(std::string_view text) { text_ += ".PP\n" + Line(text); }

void Roff::Usage(std::string_view line, std::size_t bold_words) {
  std::size_t end = 0;
  for (std::size_t i = 0; i < bold_words && end != std::string_view::npos; ++i)
    end = line.find(' ', end == 0 ? 0 : end + 1);
  end = std::min(end, line.size());
  text_ += ".PP\n\\fB" + Escaped(line.substr(0, end)) + "\\fR" + Escaped(line.substr(end)) + "\n";
}

void Roff::Item(std::string_view tag, std::string_view value, std::string_view text) {
  text_ += ".TP\n\\fB" + Escaped(tag) + "\\fR";
  if (!value.empty()) text_ += " \\fI" + Escaped(value) + "\\fR";
  text_ += "\n" + Line(text);
}

void Roff::Literal(std::string_view lines) {
  text_ += ".PP\n.nf\n";
  for (const std::string& line : CLI::detail::split(std::string(lines), '\n')) text_ += Line(line);
  text_ += ".fi\n";
}

void Roff::References(std::string_view list) {
  std::string line;
  for (const std::string& one : CLI::detail::split(std::string(list), ',')) {
    const std::string name = one.substr(one.find_first_not_of(' '));
    const std::size_t open = name.find('(');
    line += (line.empty() ? "\\fB" : ", \\fB") + Escaped(name.substr(0, open)) + "\\fR" +
            name.substr(open);
  }
  text_ += ".PP\n" + line + "\n";
}

}  // namespace focalfleet::usage
