#include "daemon/report/page.h"

#include <algorithm>
#include <cstddef>

#include "daemon/report/embedded.h"
#include "daemon/report/escape.h"
#include "protocol/base/check.h"

namespace focalfleet::report {
namespace {

/// `classes`: of the style sheet; empty: none.
std::string Element(std::string_view name, std::string_view text, std::string_view classes = "") {
  std::string out = "<";
  out.append(name);
  if (!classes.empty()) out.append(" class=\"").append(classes).append("\"");
  out.append(">").append(EscapeMarkup(text));
  return out.append("</").append(name).append(">\n");
}

std::string Row(std::string_view cell, const std::vector<std::string>& texts,
                const std::vector<Align>& alignments) {
  std::string out = "<tr>";
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const bool right = i < alignments.size() && alignments[i] == Align::kRight;
    out.append("<").append(cell).append(right ? R"( class="right">)" : ">");
    out.append(EscapeMarkup(texts[i])).append("</").append(cell).append(">");
  }
  return out + "</tr>\n";
}

}  // namespace

Page::Page(std::string_view title) : title_(EscapeMarkup(title)) {}

Page& Page::Heading(std::string_view text) {
  body_ += Element("h2", text);
  return *this;
}

Page& Page::Paragraph(std::string_view text) {
  body_ += Element("p", text);
  return *this;
}

Page& Page::Lead(std::string_view text) {
  body_ += Element("p", text, "lead");
  return *this;
}

Page& Page::Hint(std::string_view text) {
  body_ += Element("p", text, "hint");
  return *this;
}

Page& Page::Cards(const std::vector<Card>& cards) {
  body_ += "<div class=\"cards\">\n";
  for (const Card& card : cards) {
    body_ += "<div class=\"card\">\n" + Element("h3", card.heading);
    for (const std::string& text : card.paragraphs) body_ += Element("p", text);
    if (!card.facts.empty()) body_ += "<dl>\n";
    for (const auto& [name, value] : card.facts)
      body_ += Element("dt", name) + Element("dd", value);
    if (!card.facts.empty()) body_ += "</dl>\n";
    body_ += "</div>\n";
  }
  body_ += "</div>\n";
  return *this;
}

Page& Page::Figures(const std::vector<Svg>& figures) {
  body_ += "<div class=\"figures\">\n";
  for (const Svg& figure : figures) body_ += figure.text;
  body_ += "</div>\n";
  return *this;
}

Page& Page::Wide() {
  wide_ = true;
  return *this;
}

Page& Page::Table(const std::vector<std::string>& header,
                  const std::vector<std::vector<std::string>>& rows,
                  const std::vector<Align>& alignments) {
  FOCALFLEET_CHECK(alignments.size() <= header.size());
  FOCALFLEET_CHECK(std::all_of(rows.begin(), rows.end(),
                               [&](const auto& row) { return row.size() == header.size(); }));
  body_ += "<div class=\"table\"><table>\n<thead>" + Row("th", header, alignments) +
           "</thead>\n<tbody>\n";
  for (const auto& row : rows) body_ += Row("td", row, alignments);
  body_ += "</tbody>\n</table></div>\n";
  return *this;
}

Page& Page::Plot(const Svg& svg, std::string_view caption) {
  body_ += "<figure>\n" + svg.text;
  if (!caption.empty()) body_ += Element("figcaption", caption);
  body_ += "</figure>\n";
  return *this;
}

std::string Page::Html() const {
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      // Texts of a campaign's files are on the page, which runs no script and fetches nothing.
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
      "style-src 'unsafe-inline'\"/>\n";
  out.append("<title>").append(title_).append("</title>\n<style>\n");
  out.append(kPageStyle).append(PlotStyle()).append("</style>\n</head>\n");
  out.append(wide_ ? "<body class=\"report wide\">\n" : "<body class=\"report\">\n");
  out.append("<h1>").append(title_).append("</h1>\n");
  return out.append(body_).append("</body>\n</html>\n");
}

}  // namespace focalfleet::report
