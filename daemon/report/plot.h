// These functions draw plots as SVG for a page (page.h): no script, nothing fetched, sharp on
// paper. Colours come from the page's style sheet, so they follow light and dark. The colours are
// Okabe and Ito's, which are distinct for colour-blind readers (their blue is lighter on dark). The
// eighth series begins them again, lines with dashes, and after 21 they repeat.
//
// Data are shown as they are, or the plot names what it leaves out. Omissions that could mislead
// are named under the plot: values <= 0 on a logarithmic axis, infinite values, reference lines
// outside the axes. The legend marks a series without points. Long series are thinned to the
// extremes of each pixel column (trace.h).
//
// The same input gives the same bytes. Text is escaped here; text that is too long for its place is
// cut with an ellipsis.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/report/trace.h"

namespace focalfleet::report {

/// Markup that needs no further escaping; only plots make it.
struct Svg {
  std::string text;
};

/// Axis describes one axis. An end that is not given follows the data. Ticks beyond 1e5 or all
/// below 1e-2 share a power of ten in the title: "time (10⁻⁶ s)".
/// Pre: min < max where both are given; on a logarithmic axis both are > 0.
struct Axis {
  std::string label;
  std::string unit;  // empty: none
  bool log = false;
  std::optional<double> min;
  std::optional<double> max;
};

/// A dashed line across the whole plot at one value, with its label beside it. The line does not
/// widen an axis whose ends are given.
struct Reference {
  double value = 0;
  std::string label;
};

/// The width of a plot that has a line of the page to itself, and of one that has others beside it.
inline constexpr int kPlotWidth_px = 760;
inline constexpr int kSmallPlotWidth_px = 380;

/// Series is one line. NaN in x or y breaks the line there.
/// Pre: x and y are equally long.
/// Lifetime: DrawLines alone reads the numbers.
struct Series {
  std::string name;  // empty: not in the legend
  std::span<const double> x;
  std::span<const double> y;
  Style style = Style::kLine;
  std::optional<std::size_t> colour;  // of the palette; none: by the place in the plot
  bool faint = false;                 // behind what the plot is about: small and pale
};

struct LinePlot {
  std::string title;
  Axis x;
  Axis y;
  std::vector<Series> series;
  std::vector<Reference> horizontal;  // at values of y
  std::vector<Reference> vertical;    // at values of x
  int height_px = 240;                // of the area inside the axes
  int width_px = kPlotWidth_px;       // of the whole plot; the area inside is some 120 less
};

/// The plot as SVG. Cost: O(points); memory for about 4 points a pixel column.
Svg DrawLines(const LinePlot& plot);

/// BarGroup has one value for each category; NaN: no bar.
/// Pre: values are as many as the plot's categories.
struct BarGroup {
  std::string name;  // empty: not in the legend
  std::vector<double> values;
};

/// The groups' bars stand side by side in each category and begin at zero.
/// Pre: not y.log: the length of a bar means nothing there.
struct BarPlot {
  std::string title;
  std::string categories_label;
  std::vector<std::string> categories;
  Axis y;
  std::vector<BarGroup> groups;
  std::vector<Reference> horizontal;
  int height_px = 240;
};
Svg DrawBars(const BarPlot& plot);

/// Histogram shows counts of given bins: bin i reaches from edges[i] to edges[i + 1]. NaN: no bar.
/// Pre: edges ascend, one more than counts (or both empty); not y.log.
struct Histogram {
  std::string title;
  Axis x;
  Axis y{.label = "count"};
  std::vector<double> edges;
  std::vector<double> counts;
  std::vector<Reference> vertical;
  int height_px = 240;
};
Svg DrawHistogram(const Histogram& plot);

/// The style sheet that the plots need; Page contains it.
std::string_view PlotStyle();

}  // namespace focalfleet::report
