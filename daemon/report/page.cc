#include "daemon/report/page.h"

#include <algorithm>
#include <cstddef>

#include "daemon/report/escape.h"
#include "protocol/base/check.h"

namespace focalfleet::report {
namespace {

constexpr std::string_view kPageStyle =
    R"(:root{color-scheme:light dark;--paper:#fff;--ink:#1b1f23;--muted:#5f6870;--grid:#e3e6e9}
:root{--blue:#0072b2}
@media screen and (prefers-color-scheme:dark){
:root{--paper:#15181c;--ink:#e4e7ea;--muted:#98a1aa;--grid:#2d3339;--blue:#1f8fd6}}
body{margin:0 auto;padding:1.5rem;max-width:50.5rem;box-sizing:border-box}
body{background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,"DejaVu Sans",sans-serif}
h1{font-size:1.6rem;line-height:1.25;margin:0 0 1rem}
h2{font-size:1.2rem;margin:2rem 0 .6rem;break-after:avoid}
p{max-width:46rem;margin:.6rem 0}
body{overflow-wrap:break-word}
.table{overflow-x:auto;margin:1rem 0}
table{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums}
th,td{padding:.3rem .7rem;text-align:left;vertical-align:top;min-width:3rem}
th{border-bottom:2px solid var(--muted)}
td{border-bottom:1px solid var(--grid)}
.right{text-align:right}
tr,figure{break-inside:avoid}
figure{margin:1.2rem 0}
figcaption{color:var(--muted);font-size:.9rem;max-width:46rem;margin-top:.3rem}
@media print{body{max-width:none;padding:0}.table{overflow:visible}}
)";

std::string Element(std::string_view name, std::string_view text) {
  std::string out = "<";
  out.append(name).append(">").append(EscapeMarkup(text));
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
  out.append(kPageStyle).append(PlotStyle()).append("</style>\n</head>\n<body>\n");
  out.append("<h1>").append(title_).append("</h1>\n");
  return out.append(body_).append("</body>\n</html>\n");
}

}  // namespace focalfleet::report
