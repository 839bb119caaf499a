#include "daemon/report/frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "daemon/report/escape.h"

namespace focalfleet::report {
namespace {

constexpr double kRightPx = 28;  // room for half of the last label
constexpr double kCharacterPx = 6.8;
constexpr double kLinePx = 17;
constexpr std::size_t kCategoryCharactersMax = 24;
constexpr std::size_t kColours = 7;
constexpr std::size_t kDashes = 3;
constexpr double kSlantSine = 0.574;  // sine of 35 degrees
constexpr double kSlantCosine = 0.819;

double WidthOf(const std::string& text) {
  return kCharacterPx * static_cast<double>(CountCharacters(text));
}

double WidestOf(const std::vector<Mark>& marks) {
  double widest = 0;
  for (const Mark& mark : marks) widest = std::max(widest, WidthOf(mark.label));
  return widest;
}

std::size_t CharactersIn(double width_px) {
  return static_cast<std::size_t>(std::max(1.0, width_px / kCharacterPx));
}

template <typename... Args>
void Write(std::string* out, fmt::format_string<Args...> format, Args&&... args) {
  fmt::format_to(std::back_inserter(*out), format, std::forward<Args>(args)...);
}

// ---- reference lines

struct Box {
  double left, top, right, bottom;
};

bool Overlap(const Box& a, const Box& b) {
  return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}

// Places the labels of reference lines inside the area. Each label stands beside its line, and on
// no other line or label where such a place exists.
class ReferenceLabels {
 public:
  explicit ReferenceLabels(const Frame& frame) : frame_(frame) {
    for (const Mark& mark : frame.horizontal) {
      taken_.push_back({0, mark.px - 0.5, frame.width_px, mark.px + 0.5});
    }
    for (const Mark& mark : frame.vertical) {
      taken_.push_back({mark.px - 0.5, 0, mark.px + 0.5, frame.height_px});
    }
  }

  void BesideHorizontal(const Mark& mark, std::string* out) {
    const double width = WidthOf(mark.label);
    std::vector<Box> places;
    for (double right = frame_.width_px - 4; right > width; right -= width + 8) {
      places.push_back(BoxAt(right - width, mark.px - kLinePx, width));
      places.push_back(BoxAt(right - width, mark.px + 1, width));
    }
    Place(places, mark.label, out);
  }

  void BesideVertical(const Mark& mark, std::string* out) {
    const double width = WidthOf(mark.label);
    std::vector<Box> places;
    for (double top = 2; top + kLinePx < frame_.height_px; top += kLinePx) {
      places.push_back(BoxAt(mark.px + 4, top, width));
      places.push_back(BoxAt(mark.px - 4 - width, top, width));
    }
    Place(places, mark.label, out);
  }

 private:
  static Box BoxAt(double left, double top, double width) {
    return {left, top, left + width, top + kLinePx - 1};
  }

  void Place(const std::vector<Box>& places, const std::string& label, std::string* out) {
    if (label.empty() || places.empty()) return;
    const auto is_free = [&](const Box& place) {
      const bool inside = place.left >= 0 && place.right <= frame_.width_px && place.top >= 0 &&
                          place.bottom <= frame_.height_px;
      return inside && std::none_of(taken_.begin(), taken_.end(),
                                    [&](const Box& box) { return Overlap(place, box); });
    };
    const auto free = std::find_if(places.begin(), places.end(), is_free);
    const Box place = free == places.end() ? places.front() : *free;
    taken_.push_back(place);
    // The text ends at the right of its place, so it ends at the edge even where the font is
    // narrower than estimated.
    Write(out, R"(<text class="halo" text-anchor="end" x="{:.2f}" y="{:.2f}">{}</text>)",
          place.right, place.bottom - 4, EscapeMarkup(label));
  }

  const Frame& frame_;
  std::vector<Box> taken_;
};

std::string References(const Frame& frame) {
  std::string out;
  for (const Mark& mark : frame.horizontal) {
    Write(&out, R"(<path class="ref" d="M0,{:.2f}h{:.2f}"/>)", mark.px, frame.width_px);
  }
  for (const Mark& mark : frame.vertical) {
    Write(&out, R"(<path class="ref" d="M{:.2f},0v{:.2f}"/>)", mark.px, frame.height_px);
  }
  ReferenceLabels labels(frame);
  for (const Mark& mark : frame.horizontal) labels.BesideHorizontal(mark, &out);
  for (const Mark& mark : frame.vertical) labels.BesideVertical(mark, &out);
  return out;
}

// ---- axes

std::string Grid(const Frame& frame) {
  std::string out;
  for (const Mark& mark : frame.y_marks) {
    Write(&out, R"(<path class="grid" d="M0,{:.2f}h{:.2f}"/>)", mark.px, frame.width_px);
  }
  if (frame.x_marks_are_categories) return out;
  for (const Mark& mark : frame.x_marks) {
    Write(&out, R"(<path class="grid" d="M{:.2f},0v{:.2f}"/>)", mark.px, frame.height_px);
  }
  return out;
}

bool Slanted(const Frame& frame) {
  if (!frame.x_marks_are_categories || frame.x_marks.size() < 2) return false;
  return WidestOf(frame.x_marks) + 6 > frame.x_marks[1].px - frame.x_marks[0].px;
}

double XLabelsHeight(const Frame& frame) {
  return Slanted(frame) ? 14 + kSlantSine * WidestOf(frame.x_marks) : kLinePx;
}

std::string Labels(const Frame& frame) {
  std::string out;
  for (const Mark& mark : frame.y_marks) {
    Write(&out, R"(<text text-anchor="end" x="-7" y="{:.2f}">{}</text>)", mark.px + 4,
          EscapeMarkup(mark.label));
  }
  const double y = frame.height_px + kLinePx - 1;
  const bool slanted = Slanted(frame);
  for (const Mark& mark : frame.x_marks) {
    if (slanted) {
      Write(&out, R"_(<text text-anchor="end" transform="translate({:.2f},{:.2f})rotate(-35)">)_",
            mark.px + 4, y - 2);
    } else {
      Write(&out, R"(<text text-anchor="middle" x="{:.2f}" y="{:.2f}">)", mark.px, y);
    }
    out += EscapeMarkup(mark.label) + "</text>";
  }
  if (!frame.y_title.empty()) {
    Write(&out, R"_(<text text-anchor="middle" transform="translate({:.2f},{:.2f})rotate(-90)">)_",
          14 - frame.left_px, frame.height_px / 2);
    out += EscapeMarkup(frame.y_title) + "</text>";
  }
  if (!frame.x_title.empty()) {
    Write(&out, R"(<text text-anchor="middle" x="{:.2f}" y="{:.2f}">{}</text>)", frame.width_px / 2,
          y + XLabelsHeight(frame) + 1, EscapeMarkup(frame.x_title));
  }
  return out;
}

// ---- legend

struct Block {
  std::string markup;
  double height_px = 0;
};

Block Legend(const Frame& frame) {
  Block block;
  double x = 0;
  for (const LegendEntry& entry : frame.legend) {
    const std::string name = Shorten(entry.name, CharactersIn(frame.width_px - 40));
    const double width = 28 + WidthOf(name) + 16;
    if (block.height_px == 0 || x + width > frame.width_px + kRightPx) {
      x = 0;
      block.height_px += kLinePx + 1;
    }
    const double y = block.height_px - 5;
    const std::string classes = SeriesClass(entry.series);
    if (entry.key == Key::kLine) {
      Write(&block.markup, R"(<path class="key {}" d="M{:.2f},{:.2f}h22"/>)", classes, x, y - 4);
    } else if (entry.key == Key::kDot) {
      Write(&block.markup, R"(<path class="dots {}" d="M{:.2f},{:.2f}h0"/>)", classes, x + 16,
            y - 4);
    } else {
      Write(&block.markup, R"(<rect class="bar {}" x="{:.2f}" y="{:.2f}" width="14" height="10"/>)",
            classes, x + 8, y - 9);
    }
    Write(&block.markup, R"(<text x="{:.2f}" y="{:.2f}">{}</text>)", x + 28, y, EscapeMarkup(name));
    x += width;
  }
  return block;
}

// Moves the ends that are not given `margin` further out. Data that begin at zero keep zero as
// their end.
Range Widened(const Axis& axis, Range range, Range data, double margin) {
  const double wider = margin * (range.high - range.low);
  const bool up_from_zero = !axis.log && data.low >= 0 && data.low < wider;
  const bool down_from_zero = !axis.log && data.high <= 0 && data.high > -wider;
  if (!axis.min) range.low = up_from_zero ? 0.0 : range.low - wider;
  if (!axis.max) range.high = down_from_zero ? 0.0 : range.high + wider;
  return range;
}

// A range for equal values, or for an end given on the wrong side of the data. An end that is given
// alone stays.
Range AroundOneValue(const Axis& axis, Range range, double half) {
  if (axis.min && !axis.max) return {range.low, range.low + 2 * half};
  if (axis.max && !axis.min) return {range.high - 2 * half, range.high};
  return {range.low - half, range.high + half};
}

}  // namespace

double Scale::At(double value) const {
  const double place = log ? std::log10(value) : value;
  return (place - range.low) / (range.high - range.low) * length_px;
}

Ticks Scale::TicksOf(int count_max) const {
  if (!log) return LinearTicks(range, count_max);
  return LogTicks({std::pow(10.0, range.low), std::pow(10.0, range.high)}, count_max);
}

void Extent::Add(double value) {
  low = empty ? value : std::min(low, value);
  high = empty ? value : std::max(high, value);
  empty = false;
}

Scale ScaleFor(const Axis& axis, const Extent& extent, double margin) {
  const auto place = [&](double value) { return axis.log ? std::log10(value) : value; };
  // Without data the range is 0 to 1, or one decade.
  const Range data{extent.empty ? 0.0 : place(extent.low), extent.empty ? 1.0 : place(extent.high)};
  Range range{axis.min ? place(*axis.min) : data.low, axis.max ? place(*axis.max) : data.high};
  const double size = std::max(std::abs(range.low), std::abs(range.high));
  const double span_min = axis.log ? 1e-3 : std::max(1e-12 * size, 1e-290);
  if (range.high - range.low > span_min) {
    range = Widened(axis, range, data, margin);
  } else {
    const double around = size < 1e-290 ? 1.0 : 0.05 * size;
    range = AroundOneValue(axis, range, axis.log ? 0.3 : around);
  }
  // Powers of ten beyond these are no finite doubles.
  if (axis.log) range = {std::max(range.low, -305.0), std::min(range.high, 305.0)};
  return {axis.log, range, 0};
}

std::string AxisTitle(const Axis& axis, int exponent) {
  std::string unit = exponent == 0 ? "" : PowerOfTen(exponent);
  if (!unit.empty() && !axis.unit.empty()) unit += " ";
  unit += axis.unit;
  if (unit.empty()) return axis.label;
  return axis.label.empty() ? unit : fmt::format("{} ({})", axis.label, unit);
}

void PlaceArea(const std::vector<std::string>& categories, Frame* frame) {
  frame->left_px = 12 + WidestOf(frame->y_marks) + (frame->y_title.empty() ? 0 : 16);
  frame->left_px = std::max(frame->left_px, 60.0);
  frame->width_px = frame->whole_width_px - kRightPx - frame->left_px;
  if (categories.empty()) return;

  frame->x_marks_are_categories = true;
  const double slot = frame->width_px / static_cast<double>(categories.size());
  // The number of labels is limited to those that fit beside each other when slanted.
  const auto stride = static_cast<std::size_t>(std::max(1.0, std::ceil(kLinePx / slot)));
  for (std::size_t i = 0; i < categories.size(); i += stride) {
    frame->x_marks.push_back(
        {slot * (static_cast<double>(i) + 0.5), Shorten(categories[i], kCategoryCharactersMax)});
  }
  if (!Slanted(*frame)) return;
  // The first label leans out to the left, so the area starts further right.
  const double overhang = kSlantCosine * WidthOf(frame->x_marks[0].label) - slot / 2;
  const double shift = std::max(0.0, overhang - frame->left_px);
  const double shrink = (frame->width_px - shift) / frame->width_px;
  frame->left_px += shift;
  frame->width_px -= shift;
  for (Mark& mark : frame->x_marks) mark.px *= shrink;
}

void MarkX(const Axis& axis, const Scale& scale, Frame* frame) {
  for (int count_max = 9; count_max > 1; --count_max) {
    const Ticks ticks = scale.TicksOf(count_max);
    frame->x_marks.clear();
    for (const Tick& tick : ticks.marks) {
      frame->x_marks.push_back({scale.At(tick.value), tick.label});
    }
    frame->x_title = AxisTitle(axis, ticks.exponent);
    double gap = frame->width_px;
    for (std::size_t i = 1; i < frame->x_marks.size(); ++i) {
      gap = std::min(gap, frame->x_marks[i].px - frame->x_marks[i - 1].px);
    }
    if (WidestOf(frame->x_marks) + 14 < gap) return;
  }
}

void MarkY(const Axis& axis, const Scale& scale, Frame* frame) {
  const int count_max = std::max(3, static_cast<int>(scale.length_px / 34));
  const Ticks ticks = scale.TicksOf(count_max);
  for (const Tick& tick : ticks.marks) {
    frame->y_marks.push_back({scale.length_px - scale.At(tick.value), tick.label});
  }
  frame->y_title = AxisTitle(axis, ticks.exponent);
}

std::string SeriesClass(std::size_t series) {
  const std::size_t dashes = series / kColours % kDashes;
  std::string classes = fmt::format("s{}", series % kColours);
  if (dashes > 0) classes += fmt::format(" dash{}", dashes);
  return classes;
}

Svg Assemble(const Frame& frame) {
  const double title_px = frame.title.empty() ? 0 : 22;
  const Block legend = Legend(frame);
  const double top = title_px + legend.height_px + 10;
  const double below =
      top + frame.height_px + XLabelsHeight(frame) + (frame.x_title.empty() ? 0 : kLinePx) + 6;
  const double height = below + kLinePx * static_cast<double>(frame.notes.size());

  std::string out;
  Write(&out, R"(<svg class="plot{}" role="img" aria-label="{}" viewBox="0 0 {:.0f} {:.0f}">)",
        frame.whole_width_px < kPlotWidth_px ? " small" : "",
        EscapeMarkup(frame.title.empty() ? frame.y_title : frame.title), frame.whole_width_px,
        std::ceil(height));
  if (!frame.title.empty()) {
    Write(&out, R"(<text class="title" x="{:.2f}" y="15">{}</text>)", frame.left_px,
          EscapeMarkup(Shorten(frame.title, CharactersIn(0.9 * frame.width_px))));
  }
  Write(&out, R"_(<g transform="translate({:.2f},{:.2f})">{}</g>)_", frame.left_px, title_px,
        legend.markup);
  Write(&out, R"_(<g transform="translate({:.2f},{:.2f})">{})_", frame.left_px, top, Grid(frame));
  // An inner svg clips without an id, which would have to be unique in the page.
  Write(&out, R"(<svg overflow="hidden" width="{:.2f}" height="{:.2f}">{}{}</svg>)", frame.width_px,
        frame.height_px, frame.drawing, References(frame));
  Write(&out, R"(<rect class="box" width="{:.2f}" height="{:.2f}"/>{}</g>)", frame.width_px,
        frame.height_px, Labels(frame));
  double y = below;
  for (const std::string& note : frame.notes) {
    y += kLinePx;
    const auto room = CharactersIn(frame.width_px);
    Write(&out, R"(<text class="note" x="{:.2f}" y="{:.2f}">{}</text>)", frame.left_px, y - 5,
          EscapeMarkup(Shorten(note, room)));
  }
  out += "</svg>\n";
  return {std::move(out)};
}

}  // namespace focalfleet::report
