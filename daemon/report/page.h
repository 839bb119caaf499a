// Page is one report as one file of HTML5: text, tables and plots in the order in which they are
// added. The file needs no script, no network and no second file, so it can be mailed, archived and
// printed. The page is light or dark as the reader's system is, and light on paper.
//
// Everything but a plot is text and is escaped, so the name of a file or unit cannot change the
// page. Elements are closed as in XML, so a strict parser reads the page too. The page adds no time
// and no name of a machine by itself: the same calls give the same bytes.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/report/plot.h"

namespace focalfleet::report {

enum class Align { kLeft, kRight };

/// Card is one finding among several: what it is called, what is to be known, its numbers by name.
struct Card {
  std::string heading;
  std::vector<std::string> paragraphs;
  std::vector<std::pair<std::string, std::string>> facts;
};

class Page {
 public:
  /// A page whose title is also its first heading.
  explicit Page(std::string_view title);

  Page& Heading(std::string_view text);
  Page& Paragraph(std::string_view text);
  /// Adds the sentence that a reader takes along who reads no other.
  Page& Lead(std::string_view text);
  /// Adds a pale small paragraph.
  Page& Hint(std::string_view text);
  Page& Cards(const std::vector<Card>& cards);

  /// Adds a table. Columns without an alignment are left-aligned; numbers read best right-aligned.
  /// Pre: every row is as long as the header; no more alignments than columns.
  Page& Table(const std::vector<std::string>& header,
              const std::vector<std::vector<std::string>>& rows,
              const std::vector<Align>& alignments = {});

  /// Adds a plot. Empty caption: none.
  Page& Plot(const Svg& svg, std::string_view caption = "");
  /// Adds small plots, as many beside each other as the reader's window has room for.
  Page& Figures(const std::vector<Svg>& figures);
  /// The page takes the width that its figures can use.
  Page& Wide();

  /// The whole document so far.
  [[nodiscard]] std::string Html() const;

 private:
  std::string title_;  // escaped
  std::string body_;
  bool wide_ = false;
};

}  // namespace focalfleet::report
