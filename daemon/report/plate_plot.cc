#include "daemon/report/plate_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "daemon/report/escape.h"
#include "protocol/base/check.h"

namespace focalfleet::report {
namespace {

constexpr double kWidth_px = kSmallPlotWidth_px;
constexpr double kTitle_px = 22;
constexpr double kLine_px = 17;
constexpr double kArrowMost = 6;  // of the scale
constexpr double kColumns = 3;    // of the legend

template <typename... Args>
void Put(std::string* out, fmt::format_string<Args...> format, Args&&... args) {
  fmt::format_to(std::back_inserter(*out), format, std::forward<Args>(args)...);
}

/// From places on the plate to pixels of a square.
class Square {
 public:
  template <class Units>
  explicit Square(const Units& units) {
    if (units.empty()) return;
    double low[2] = {units[0].x_mm, units[0].y_mm};
    double high[2] = {low[0], low[1]};
    for (const auto& unit : units)
      for (const auto& [axis, mm] : {std::pair(0, unit.x_mm), std::pair(1, unit.y_mm)})
        low[axis] = std::min(low[axis], mm), high[axis] = std::max(high[axis], mm);
    const double span_mm = std::max({high[0] - low[0], high[1] - low[1], 1e-3});
    // The distance between units that fill a disc of this size, roughly.
    pitch_px_ = kWidth_px / (1 + 1.1 * std::sqrt(static_cast<double>(units.size())));
    scale_ = (kWidth_px - 2 * pitch_px_) / span_mm;
    if (units.size() == 1) scale_ = 0;
    middle_[0] = (low[0] + high[0]) / 2;
    middle_[1] = (low[1] + high[1]) / 2;
    // The plot is only as high as the plate.
    height_px_ = std::max((high[1] - low[1]) * scale_ + 2 * pitch_px_, 2 * pitch_px_);
  }
  [[nodiscard]] double X(double mm) const { return kWidth_px / 2 + (mm - middle_[0]) * scale_; }
  [[nodiscard]] double Y(double mm) const { return height_px_ / 2 - (mm - middle_[1]) * scale_; }
  [[nodiscard]] double pitch_px() const { return pitch_px_; }
  [[nodiscard]] double height_px() const { return height_px_; }

 private:
  double scale_ = 1;  // px per mm
  double middle_[2] = {0, 0};
  double pitch_px_ = 20;
  double height_px_ = 40;
};

/// The text of a limit: as short as it is exact.
std::string TextOf(double value) { return fmt::format("{:.4g}", value); }

std::string ClassText(const PlateMap& map, std::size_t k) {
  if (k == 0) return fmt::format("below {}", TextOf(map.limits[0]));
  if (k == map.limits.size()) return fmt::format("from {}", TextOf(map.limits.back()));
  return fmt::format("{} to {}", TextOf(map.limits[k - 1]), TextOf(map.limits[k]));
}

std::size_t ClassOf(const PlateMap& map, double value) {
  return static_cast<std::size_t>(
      std::ranges::count_if(map.limits, [&](double limit) { return value >= limit; }));
}

std::string Legend(const PlateMap& map, const std::array<std::size_t, kPlateClasses>& counts,
                   std::size_t unknown, double* height_px) {
  std::string out;
  std::size_t place = 0;
  const auto entry = [&](std::string_view drawing, const std::string& text) {
    const double x = static_cast<double>(place % 3) * kWidth_px / kColumns;
    const double y = kLine_px * static_cast<double>(place / 3) + 12;
    Put(&out, R"(<path class="{}" d="M{:.1f},{:.1f}h0"/><text x="{:.1f}" y="{:.1f}">{}</text>)",
        drawing, x + 7, y - 4, x + 16, y, EscapeMarkup(text));
    ++place;
  };
  for (std::size_t k = 0; k < kPlateClasses; ++k)
    entry(fmt::format("spot q{}", k), fmt::format("{}: {}", ClassText(map, k), counts[k]));
  if (unknown > 0) entry("spot none", fmt::format("not known: {}", unknown));
  *height_px = kLine_px * static_cast<double>((place + 2) / 3);
  return out;
}

std::string Begin(const std::string& title, double height_px) {
  return fmt::format(
      R"(<svg class="plot small" role="img" aria-label="{}" viewBox="0 0 {:.0f} {:.0f}">)"
      R"(<text class="title" x="0" y="15">{}</text>)",
      EscapeMarkup(title), kWidth_px, std::ceil(height_px), EscapeMarkup(Shorten(title, 48)));
}

double NiceUp(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 5.0})
    if (value <= step * power * (1 + 1e-9)) return step * power;
  return 10 * power;
}

}  // namespace

std::vector<double> PlateLimits(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  std::ranges::sort(values);
  // The classes are 1, 2, 5, 10... times a unit; nine tenths of the values lie below the highest.
  const double high = values.empty() ? 1 : values[values.size() * 9 / 10];
  double limit = NiceUp(std::clamp(high, 1e-6, 1e9));
  std::vector<double> limits;
  for (std::size_t k = 1; k < kPlateClasses; ++k) {
    limits.push_back(limit);
    limit = NiceUp(limit / 2.6);  // 1 -> 0.5 -> 0.2 -> 0.1
  }
  std::ranges::reverse(limits);
  return limits;
}

Svg DrawPlateMap(const PlateMap& map) {
  FOCALFLEET_CHECK(map.limits.size() == kPlateClasses - 1 && std::ranges::is_sorted(map.limits));
  const Square square(map.units);
  std::array<std::string, kPlateClasses> paths;
  std::array<std::size_t, kPlateClasses> counts{};
  std::string hollow;
  std::size_t unknown = 0;
  for (const PlateValue& unit : map.units) {
    const bool known = std::isfinite(unit.value);
    const std::size_t k = known ? ClassOf(map, unit.value) : 0;
    Put(known ? &paths[k] : &hollow, "M{:.1f},{:.1f}h0", square.X(unit.x_mm), square.Y(unit.y_mm));
    ++(known ? counts[k] : unknown);
  }
  double legend_px = 0;
  const std::string legend = Legend(map, counts, unknown, &legend_px);
  std::string out = Begin(map.unit.empty() ? map.title : map.title + " (" + map.unit + ")",
                          kTitle_px + square.height_px() + legend_px + 8);
  // Sizes are steps of the style sheet, since the policy of pages forbids a style of its own.
  const auto size = static_cast<int>(std::clamp(0.8 * square.pitch_px(), 2.0, 16.0));
  Put(&out, R"_(<g transform="translate(0,{:.0f})" stroke-width="{}">)_", kTitle_px, size);
  if (!hollow.empty()) Put(&out, R"(<path class="spots none" d="{}"/>)", hollow);
  for (std::size_t k = 0; k < kPlateClasses; ++k)
    if (!paths[k].empty()) Put(&out, R"(<path class="spots q{}" d="{}"/>)", k, paths[k]);
  Put(&out, R"_(</g><g transform="translate(0,{:.1f})">{}</g></svg>)_",
      kTitle_px + square.height_px() + 6, legend);
  return {out + "\n"};
}

Svg DrawPlateArrows(const PlateArrows& arrows) {
  FOCALFLEET_CHECK(arrows.scale_um > 0);
  const Square square(arrows.units);
  const double px_per_um = square.pitch_px() / arrows.scale_um;
  std::string bases;
  std::string shafts;
  std::string heads;
  std::size_t cut = 0;
  for (const PlateVector& unit : arrows.units) {
    if (!std::isfinite(unit.dx_um) || !std::isfinite(unit.dy_um)) continue;
    const double length_um = std::hypot(unit.dx_um, unit.dy_um);
    const double share = std::min(1.0, kArrowMost * arrows.scale_um / std::max(length_um, 1e-9));
    if (share < 1) ++cut;
    const double x = square.X(unit.x_mm);
    const double y = square.Y(unit.y_mm);
    const double dx = share * px_per_um * unit.dx_um;
    const double dy = -share * px_per_um * unit.dy_um;
    Put(&bases, "M{:.1f},{:.1f}h0", x, y);
    const double length_px = std::hypot(dx, dy);
    if (length_px < 0.3) continue;
    Put(&shafts, "M{:.1f},{:.1f}l{:.1f},{:.1f}", x, y, dx, dy);
    // A head of 25 degrees to either side, where it can be seen.
    const double head = std::min(0.35 * length_px, 6.0);
    if (head < 1) continue;
    const double along_x = -dx / length_px * head;
    const double along_y = -dy / length_px * head;
    Put(&heads, "M{:.1f},{:.1f}l{:.1f},{:.1f}M{:.1f},{:.1f}l{:.1f},{:.1f}", x + dx, y + dy,
        0.91 * along_x - 0.42 * along_y, 0.91 * along_y + 0.42 * along_x, x + dx, y + dy,
        0.91 * along_x + 0.42 * along_y, 0.91 * along_y - 0.42 * along_x);
  }
  std::string out = Begin(arrows.title, kTitle_px + square.height_px() + 2 * kLine_px + 8);
  Put(&out,
      R"_(<g transform="translate(0,{:.0f})"><path class="spots base" stroke-width="2" d="{}"/>)_"
      R"_(<path class="arrows" d="{}{}"/></g>)_",
      kTitle_px, bases, shafts, heads);
  const double y = kTitle_px + square.height_px() + kLine_px;
  Put(&out,
      R"(<path class="arrows" d="M4,{:.1f}h{:.1f}"/><text x="{:.1f}" y="{:.1f}">{} um</text>)",
      y - 4, square.pitch_px(), 12 + square.pitch_px(), y, TextOf(arrows.scale_um));
  if (cut > 0)
    Put(&out, R"(<text class="note" x="4" y="{:.1f}">{} longer than {} um are cut.</text>)",
        y + kLine_px, cut, TextOf(kArrowMost * arrows.scale_um));
  return {out + "</svg>\n"};
}

}  // namespace focalfleet::report
