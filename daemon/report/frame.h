// Frame is what surrounds the data of a plot: title, legend, axes with their ticks, reference
// lines, notes. Everything is placed by an estimate of the width of text, because only the viewer
// knows its font. The estimate errs on the wide side. Places are in pixels of the drawing.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "daemon/report/plot.h"
#include "daemon/report/ticks.h"

namespace focalfleet::report {

/// Scale maps values to pixels of the drawing area; y grows upwards there.
struct Scale {
  bool log = false;
  Range range;  // of log10(value) where log
  double length_px = 0;

  /// The pixel of `value`. Pre: value is plottable, positive where log.
  [[nodiscard]] double At(double value) const;
  [[nodiscard]] Ticks TicksOf(int count_max) const;
};

/// The values that an axis has to show.
struct Extent {
  void Add(double value);
  double low = 0;
  double high = 0;
  bool empty = true;
};

/// The scale with the ends that are given. Other ends are those of the data, moved out by `margin`
/// times the span, but not across zero. The range is never degenerate, also for no or equal values.
/// `length_px` is still 0.
Scale ScaleFor(const Axis& axis, const Extent& extent, double margin);

struct Mark {
  double px = 0;  // from the left, or from the top
  std::string label;
};

enum class Key { kLine, kDot, kBox };

struct LegendEntry {
  std::string name;
  std::size_t series = 0;  // sets its colour
  Key key = Key::kLine;
};

struct Frame {
  std::string title;
  std::string x_title;
  std::string y_title;
  std::vector<Mark> x_marks;
  std::vector<Mark> y_marks;
  bool x_marks_are_categories = false;  // no grid lines; slanted where they are too wide
  std::vector<LegendEntry> legend;
  std::vector<Mark> horizontal;
  std::vector<Mark> vertical;
  std::vector<std::string> notes;
  std::string drawing;  // markup, clipped to the area
  double whole_width_px = kPlotWidth_px;
  double left_px = 0;
  double width_px = 0;
  double height_px = 0;
};

/// Sets the left margin by the widths of labels (`y_marks` and, slanted, categories), and thereby
/// `width_px`.
void PlaceArea(const std::vector<std::string>& categories, Frame* frame);

/// The text "label (unit)", with a shared factor before the unit.
std::string AxisTitle(const Axis& axis, int exponent);

/// Sets the marks along x and the title. Fewer marks are set where their labels would touch.
void MarkX(const Axis& axis, const Scale& scale, Frame* frame);
/// Sets the same along y. Pre: scale.length_px is the area's height.
void MarkY(const Axis& axis, const Scale& scale, Frame* frame);

Svg Assemble(const Frame& frame);

/// CSS classes of a series: its colour, and dashes once the colours begin again.
std::string SeriesClass(std::size_t series);

}  // namespace focalfleet::report
