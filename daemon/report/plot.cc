#include "daemon/report/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <utility>

#include "daemon/report/embedded.h"
#include "daemon/report/escape.h"
#include "daemon/report/frame.h"
#include "protocol/base/check.h"

namespace focalfleet::report {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

enum class Fate { kShown, kGap, kInfinite, kNotPositive };

Fate FateOf(double value, bool log) {
  if (std::isnan(value)) return Fate::kGap;
  if (std::abs(value) > kPlottableMax) return Fate::kInfinite;
  if (log && value < 1 / kPlottableMax) return Fate::kNotPositive;
  return Fate::kShown;
}

// Counts, for the notes, of points that are left out.
struct LeftOut {
  std::size_t infinite = 0;
  std::size_t not_positive = 0;

  bool Shows(Fate fate) {
    infinite += fate == Fate::kInfinite ? 1 : 0;
    not_positive += fate == Fate::kNotPositive ? 1 : 0;
    return fate == Fate::kShown;
  }
};

// The fate of a point is that of its worse coordinate. A gap is intended and needs no note.
Fate FateOf(const LinePlot& plot, const Series& series, std::size_t i) {
  const Fate x = FateOf(series.x[i], plot.x.log);
  const Fate y = FateOf(series.y[i], plot.y.log);
  if (x == Fate::kGap || y == Fate::kGap) return Fate::kGap;
  return x == Fate::kShown ? y : x;
}

void Note(const LeftOut& left_out, std::string_view things, std::vector<std::string>* notes) {
  if (left_out.not_positive > 0) {
    notes->push_back(fmt::format("Not shown: {} with a value ≤ 0 on a logarithmic axis ({}).",
                                 things, left_out.not_positive));
  }
  if (left_out.infinite > 0) {
    notes->push_back(
        fmt::format("Not shown: {} with an infinite value ({}).", things, left_out.infinite));
  }
}

void CheckAxis(const Axis& axis) {
  FOCALFLEET_CHECK(!axis.min || FateOf(*axis.min, axis.log) == Fate::kShown);
  FOCALFLEET_CHECK(!axis.max || FateOf(*axis.max, axis.log) == Fate::kShown);
  FOCALFLEET_CHECK(!axis.min || !axis.max || *axis.min < *axis.max);
}

double HeightOf(int height_px) { return std::clamp(height_px, 60, 2000); }

bool Inside(const Axis& axis, double value) {
  return (!axis.min || value >= *axis.min) && (!axis.max || value <= *axis.max);
}

void AddReferences(const Axis& axis, const std::vector<Reference>& references, Extent* extent) {
  for (const Reference& reference : references) {
    const double value = reference.value;
    if (FateOf(value, axis.log) == Fate::kShown && Inside(axis, value)) extent->Add(value);
  }
}

// The references' marks, in pixels from the left, or from the top for y.
std::vector<Mark> PlaceReferences(const std::vector<Reference>& references, const Scale& scale,
                                  bool is_y, std::vector<std::string>* notes) {
  std::vector<Mark> marks;
  for (const Reference& reference : references) {
    const bool shown = FateOf(reference.value, scale.log) == Fate::kShown;
    const double px = shown ? scale.At(reference.value) : -1.0;
    if (px < -0.01 || px > scale.length_px + 0.01) {
      notes->push_back(
          fmt::format("Outside the axes: {} at {:.6g}.", reference.label, reference.value));
    } else {
      marks.push_back({is_y ? scale.length_px - px : px, reference.label});
    }
  }
  return marks;
}

void AddLegend(LegendEntry entry, bool drawn, Frame* frame) {
  if (entry.name.empty()) return;
  if (!drawn) entry.name += " (no data)";
  frame->legend.push_back(std::move(entry));
}

void SayWhereNoData(Frame* frame) {
  if (!frame->drawing.empty()) return;
  fmt::format_to(std::back_inserter(frame->drawing),
                 R"(<text class="note" text-anchor="middle" x="{:.2f}" y="{:.2f}">no data</text>)",
                 frame->width_px / 2, frame->height_px / 2);
}

// ---- lines

struct Extents {
  Extent x, y;
  LeftOut left_out;
};

Extents ExtentsOf(const LinePlot& plot) {
  Extents extents;
  for (const Series& series : plot.series) {
    FOCALFLEET_CHECK(series.x.size() == series.y.size());
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (!extents.left_out.Shows(FateOf(plot, series, i))) continue;
      extents.x.Add(series.x[i]);
      // Points cut off at the sides do not stretch the height.
      if (Inside(plot.x, series.x[i])) extents.y.Add(series.y[i]);
    }
  }
  AddReferences(plot.x, plot.vertical, &extents.x);
  AddReferences(plot.y, plot.horizontal, &extents.y);
  return extents;
}

struct Scales {
  Scale x, y;
};

std::string PathOf(const LinePlot& plot, const Series& series, const Scales& scales) {
  Trace trace({.style = series.style,
               .points_expected = series.x.size(),
               .width_px = scales.x.length_px,
               .height_px = scales.y.length_px});
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const bool shown = FateOf(plot, series, i) == Fate::kShown;
    trace.Add(shown ? Pixel{scales.x.At(series.x[i]), scales.y.length_px - scales.y.At(series.y[i])}
                    : Pixel{kNan, kNan});
  }
  return trace.Finish();
}

// ---- bars

// The ends of a bar from the zero line to the value, in pixels from the top. A bar that leaves the
// area ends just outside.
struct BarEnds {
  double top, bottom;
};
BarEnds EndsOf(const Scale& y, double value) {
  const auto px = [&](double v) {
    return std::clamp(y.length_px - y.At(v), -9.0, y.length_px + 9.0);
  };
  return {std::min(px(0), px(value)), std::max(px(0), px(value))};
}

void DrawGroup(const BarPlot& plot, std::size_t index, const Scale& y, Frame* frame) {
  const BarGroup& group = plot.groups[index];
  const double slot = frame->width_px / static_cast<double>(plot.categories.size());
  const auto groups = static_cast<double>(plot.groups.size());
  const double width = std::min(0.8 * slot / groups, 48.0);
  bool drawn = false;
  for (std::size_t i = 0; i < group.values.size(); ++i) {
    const double value = group.values[i];
    if (FateOf(value, false) != Fate::kShown) continue;
    drawn = true;
    const BarEnds ends = EndsOf(y, value);
    const double center = slot * (static_cast<double>(i) + 0.5);
    const double left = center + width * (static_cast<double>(index) - groups / 2);
    fmt::format_to(std::back_inserter(frame->drawing),
                   R"(<rect class="bar {}" x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}">)"
                   "<title>{}{}{}: {:.6g}</title></rect>",
                   SeriesClass(index), left, ends.top, width, ends.bottom - ends.top,
                   EscapeMarkup(plot.categories[i]), group.name.empty() ? "" : ", ",
                   EscapeMarkup(group.name), value);
  }
  AddLegend({group.name, index, Key::kBox}, drawn, frame);
}

// ---- histogram

// The outline over each run of bins that are shown, closed along the zero line.
std::string OutlineOf(const Histogram& plot, const Scale& x, const Scale& y, LeftOut* left_out) {
  std::string path;
  const double zero = EndsOf(y, 0).top;
  const auto out = std::back_inserter(path);
  bool open = false;
  for (std::size_t i = 0; i < plot.counts.size(); ++i) {
    Fate fate = FateOf(plot.counts[i], false);
    if (fate == Fate::kShown) fate = FateOf(plot.edges[i], plot.x.log);
    if (fate == Fate::kShown) fate = FateOf(plot.edges[i + 1], plot.x.log);
    const bool shown = left_out->Shows(fate);
    if (!shown && open) fmt::format_to(out, "V{:.2f}Z", zero);
    if (shown && !open) fmt::format_to(out, "M{:.2f},{:.2f}", x.At(plot.edges[i]), zero);
    open = shown;
    if (!shown) continue;
    const BarEnds ends = EndsOf(y, plot.counts[i]);
    fmt::format_to(out, "V{:.2f}H{:.2f}", plot.counts[i] < 0 ? ends.bottom : ends.top,
                   x.At(plot.edges[i + 1]));
  }
  if (open) fmt::format_to(out, "V{:.2f}Z", zero);
  return path;
}

Extents ExtentsOf(const Histogram& plot) {
  Extents extents;
  extents.y.Add(0);
  for (const double count : plot.counts) {
    if (FateOf(count, false) == Fate::kShown) extents.y.Add(count);
  }
  for (const double edge : plot.edges) {
    if (FateOf(edge, plot.x.log) == Fate::kShown) extents.x.Add(edge);
  }
  AddReferences(plot.x, plot.vertical, &extents.x);
  return extents;
}

}  // namespace

Svg DrawLines(const LinePlot& plot) {
  CheckAxis(plot.x);
  CheckAxis(plot.y);
  const Extents extents = ExtentsOf(plot);
  const bool dots = std::any_of(plot.series.begin(), plot.series.end(),
                                [](const Series& s) { return s.style == Style::kDots; });
  // A dot on the very edge would be half a dot.
  Scales scales{ScaleFor(plot.x, extents.x, dots ? 0.02 : 0.0), ScaleFor(plot.y, extents.y, 0.05)};
  Frame frame{.title = plot.title, .height_px = HeightOf(plot.height_px)};
  frame.whole_width_px = std::clamp(plot.width_px, kSmallPlotWidth_px, kPlotWidth_px);
  scales.y.length_px = frame.height_px;
  MarkY(plot.y, scales.y, &frame);
  PlaceArea({}, &frame);
  scales.x.length_px = frame.width_px;
  MarkX(plot.x, scales.x, &frame);

  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& series = plot.series[i];
    const std::string path = PathOf(plot, series, scales);
    const Key key = series.style == Style::kDots ? Key::kDot : Key::kLine;
    const std::size_t colour = series.colour.value_or(i);
    AddLegend({series.name, colour, key}, !path.empty(), &frame);
    if (path.empty()) continue;
    const std::string_view kind = series.style == Style::kDots ? "dots" : "line";
    frame.drawing += fmt::format(R"(<path class="{}{} {}" d="{}"/>)", kind,
                                 series.faint ? " faint" : "", SeriesClass(colour), path);
  }
  SayWhereNoData(&frame);
  Note(extents.left_out, "points", &frame.notes);
  frame.horizontal = PlaceReferences(plot.horizontal, scales.y, true, &frame.notes);
  frame.vertical = PlaceReferences(plot.vertical, scales.x, false, &frame.notes);
  return Assemble(frame);
}

Svg DrawBars(const BarPlot& plot) {
  CheckAxis(plot.y);
  FOCALFLEET_CHECK(!plot.y.log);
  Extent extent;
  LeftOut left_out;
  extent.Add(0);
  for (const BarGroup& group : plot.groups) {
    FOCALFLEET_CHECK(group.values.size() == plot.categories.size());
    for (const double value : group.values) {
      if (left_out.Shows(FateOf(value, false))) extent.Add(value);
    }
  }
  AddReferences(plot.y, plot.horizontal, &extent);
  Scale y = ScaleFor(plot.y, extent, 0.05);
  Frame frame{
      .title = plot.title, .x_title = plot.categories_label, .height_px = HeightOf(plot.height_px)};
  y.length_px = frame.height_px;
  MarkY(plot.y, y, &frame);
  PlaceArea(plot.categories, &frame);
  for (std::size_t i = 0; i < plot.groups.size(); ++i) DrawGroup(plot, i, y, &frame);
  SayWhereNoData(&frame);
  Note(left_out, "bars", &frame.notes);
  frame.horizontal = PlaceReferences(plot.horizontal, y, true, &frame.notes);
  return Assemble(frame);
}

Svg DrawHistogram(const Histogram& plot) {
  CheckAxis(plot.x);
  CheckAxis(plot.y);
  FOCALFLEET_CHECK(!plot.y.log);
  const bool empty = plot.counts.empty() && plot.edges.empty();
  FOCALFLEET_CHECK(empty || plot.edges.size() == plot.counts.size() + 1);
  FOCALFLEET_CHECK(std::is_sorted(plot.edges.begin(), plot.edges.end()));
  const Extents extents = ExtentsOf(plot);
  Scale x = ScaleFor(plot.x, extents.x, 0);
  Scale y = ScaleFor(plot.y, extents.y, 0.05);
  Frame frame{.title = plot.title, .height_px = HeightOf(plot.height_px)};
  y.length_px = frame.height_px;
  MarkY(plot.y, y, &frame);
  PlaceArea({}, &frame);
  x.length_px = frame.width_px;
  MarkX(plot.x, x, &frame);
  LeftOut left_out;
  const std::string outline = OutlineOf(plot, x, y, &left_out);
  if (!outline.empty()) frame.drawing = fmt::format(R"(<path class="area" d="{}"/>)", outline);
  SayWhereNoData(&frame);
  Note(left_out, "bins", &frame.notes);
  frame.vertical = PlaceReferences(plot.vertical, x, false, &frame.notes);
  return Assemble(frame);
}

std::string_view PlotStyle() { return kPlotStyle; }

}  // namespace focalfleet::report
