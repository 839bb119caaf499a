#include "daemon/campaign/diagnosis_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "daemon/report/plate_plot.h"
#include "daemon/report/ticks.h"
#include "sim/campaigns/diagnosis/model/chances.h"

namespace focalfleet {
namespace {

using report::kSmallPlotWidth_px;
using report::Style;

constexpr const char* kAxisNames[] = {"theta", "phi"};
// Places in the palette: blue is what the model leaves, orange what was wrong before.
constexpr std::size_t kAfterColour = 0, kBeforeColour = 1;
constexpr std::size_t kDotsMax = 1500;
constexpr std::size_t kColumnsShown = 6, kColumnsLeast = 2;
constexpr double kStructureShown = 1;  // chi-square a bin beyond what chance makes
constexpr std::size_t kAmplitudeMapsMax = 4;
constexpr double kNotKnown = sim::HeldOutGain::kNotKnown;

std::vector<double> KnownOf(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  return values;
}

double MedianOf(const std::vector<double>& values) {
  std::vector<double> known = KnownOf(values);
  return known.empty() ? kNotKnown : sim::Median(std::move(known));
}

/// The bounds of all but `tail` of the values at either end; 0 and 0 without values.
std::array<double, 2> BoundsOf(const std::vector<double>& values, double tail) {
  const std::vector<double> known = KnownOf(values);
  if (known.empty()) return {0, 0};
  return {sim::Quantile(known, tail), sim::Quantile(known, 1 - tail)};
}

/// Every so many of two columns, for dots that are not to hide each other.
struct Dots {
  std::vector<double> x, y;
};
Dots DotsOf(std::span<const double> x, std::span<const double> y) {
  const std::size_t stride = std::max<std::size_t>(1, x.size() / kDotsMax);
  Dots dots;
  for (std::size_t row = 0; row < x.size(); row += stride)
    if (std::isfinite(x[row]) && std::isfinite(y[row]))
      dots.x.push_back(x[row]), dots.y.push_back(y[row]);
  return dots;
}

/// A round number near the value: 1, 2 or 5 times a power of ten.
double RoundNear(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  const double head = value / power;
  return (head < 1.5 ? 1 : head < 3.5 ? 2 : head < 7.5 ? 5 : 10) * power;
}

/// The name of a column as a label: "theta_cmd_deg" is "theta commanded", in deg.
report::Axis LabelOf(std::string_view column) {
  constexpr std::pair<std::string_view, std::string_view> kUnits[] = {
      {"_deg", "deg"}, {"_s", "s"}, {"_um", "um"}, {"_mm", "mm"},
      {"_c", "C"},     {"_k", "K"}, {"_v", "V"}};
  constexpr std::pair<std::string_view, std::string_view> kEnds[] = {{"_cmd", " commanded"},
                                                                     {"_from", " before"}};
  report::Axis axis{.label = std::string(column)};
  for (const auto& [end, unit] : kUnits)
    if (axis.unit.empty() && column.ends_with(end)) {
      axis.unit = unit;
      axis.label.resize(column.size() - end.size());
    }
  if (column.ends_with(" step")) axis.unit = "deg";
  for (const auto& [end, word] : kEnds)
    if (axis.label.ends_with(end))
      axis.label.replace(axis.label.size() - end.size(), end.size(), word);
  std::ranges::replace(axis.label, '_', ' ');
  return axis;
}

struct Look {
  std::string_view name;
  std::span<const double> column;
  sim::MedianCurve before;
};

report::Svg DrawAgainst(const Look& one, std::size_t axis, const sim::AngleResiduals& angles) {
  const std::vector<double>& before = angles.before_deg[axis];
  const std::vector<double>& after = angles.after_deg[axis];
  const sim::MedianCurve curve = sim::MedianAlong(one.column, after);
  const Dots dots_before = DotsOf(one.column, before);
  const Dots dots_after = DotsOf(one.column, after);
  const auto [low, high] = BoundsOf(before, 0.01);
  report::LinePlot plot{
      .title = fmt::format("{} against {}", kAxisNames[axis], LabelOf(one.name).label),
      .x = LabelOf(one.name),
      .y = {.label = fmt::format("{} error", kAxisNames[axis]), .unit = "deg"},
      .series =
          {{.x = dots_before.x,
            .y = dots_before.y,
            .style = Style::kDots,
            .colour = kBeforeColour,
            .faint = true},
           {.x = dots_after.x,
            .y = dots_after.y,
            .style = Style::kDots,
            .colour = kAfterColour,
            .faint = true},
           {.name = "before", .x = one.before.x, .y = one.before.median, .colour = kBeforeColour},
           {.name = "after", .x = curve.x, .y = curve.median, .colour = kAfterColour}},
      .height_px = 190,
      .width_px = kSmallPlotWidth_px};
  if (high > low) {
    const double margin = 0.15 * (high - low);
    plot.y.min = low - margin, plot.y.max = high + margin;
  }
  return report::DrawLines(plot);
}

std::string KnownOrder(double order, double gear) {
  struct Part {
    double order;
    const char* name;
  };
  // These are the orders of this fleet's gearheads; sim/campaigns/effects/harmonic.h has their
  // teeth.
  constexpr Part kParts[] = {{1, "once a turn"}, {2, "twice a turn"}, {2.65, "pinion"},
                             {4.29, "pinion"},   {11.3, "stage"},     {18.4, "stage"},
                             {45, "teeth"},      {48.6, "stage"},     {78.7, "stage"},
                             {122, "teeth"},     {208, "stage"}};
  const auto is = [&](double known) {
    return std::abs(order - known) <= std::max(0.3, 0.004 * known);
  };
  for (const double harmonic : {1.0, 2.0, 6.0})
    if (is(harmonic * gear))
      return harmonic == 1 ? "motor" : fmt::format("motor x{:.0f}", harmonic);
  for (const Part& part : kParts)
    if (is(part.order)) return part.name;
  return "";
}

/// The highest peaks of the spectrum that stand out of what is around them and of chance, as lines
/// with the order. `turns`: the range of the axis' commands, which limits how well orders are
/// resolved.
std::vector<report::Reference> PeaksOf(const sim::OrderSpectrum& spectrum, double gear,
                                       double turns) {
  // Amplitudes, as multiples of what chance makes and of the spectrum's median. Chance alone
  // exceeds three times its root mean square at one order of 8000 (exp(-9), a Rayleigh tail).
  constexpr double kOfChance = 3, kOfMedian = 1.7;
  constexpr std::size_t kPeaksMax = 3;
  const std::vector<double>& y = spectrum.before_deg;
  const double least = std::max(kOfChance * spectrum.chance_deg, kOfMedian * MedianOf(y));
  std::vector<std::size_t> peaks;
  for (std::size_t k = 0; k < y.size(); ++k) {
    const bool rises = k == 0 || !(y[k - 1] > y[k]);
    const bool falls = k + 1 == y.size() || !(y[k + 1] > y[k]);
    if (rises && falls && y[k] > least) peaks.push_back(k);
  }
  std::ranges::sort(peaks, [&](std::size_t a, std::size_t b) { return y[a] > y[b]; });
  std::vector<report::Reference> lines;
  for (const std::size_t k : peaks) {
    const double order = spectrum.order[k];
    // The flanks of a peak that is named already are no peaks of their own.
    const bool apart = std::ranges::all_of(lines, [&](const report::Reference& line) {
      return std::abs(line.value - order) > std::max(2 / turns, 0.06 * order);
    });
    if (!apart) continue;
    const std::string part = order * turns >= 1 ? KnownOrder(order, gear) : "";
    lines.push_back({order, part.empty() ? fmt::format("{:.4g}", order)
                                         : fmt::format("{:.4g}: {}", order, part)});
    if (lines.size() == kPeaksMax) break;
  }
  return lines;
}

}  // namespace

DiagnosisFigures::DiagnosisFigures(const sim::Campaign& campaign, const sim::Diagnosis& diagnosis)
    : campaign_(campaign),
      diagnosis_(diagnosis),
      facts_(sim::MakeFacts(campaign)),
      angles_(sim::AngleResidualsOf(facts_, diagnosis)),
      units_(sim::UnitResidualsOf(campaign, diagnosis)) {}

bool DiagnosisFigures::empty() const {
  return std::ranges::none_of(units_.before_um, [](double um) { return std::isfinite(um); });
}

std::vector<report::Svg> DiagnosisFigures::Maps() const {
  const auto draw = [&](const std::string& title, const std::string& unit,
                        const std::vector<double>& values, const std::vector<double>& limits) {
    report::PlateMap map{.title = title, .unit = unit, .limits = limits, .units = {}};
    for (std::size_t u = 0; u < campaign_.units.size(); ++u)
      map.units.push_back({campaign_.units[u].base_x_mm, campaign_.units[u].base_y_mm, values[u]});
    return report::DrawPlateMap(map);
  };
  const std::vector<double> limits = report::PlateLimits(units_.before_um);
  std::vector<report::Svg> maps = {draw("rms of each unit before", "um", units_.before_um, limits),
                                   draw("the same after", "um", units_.after_um, limits)};
  for (const sim::ModelTerm& term : diagnosis_.model.terms) {
    if (maps.size() == 2 + kAmplitudeMapsMax) break;
    if (term.sharing != sim::Sharing::kUnit) continue;
    std::vector<double> sizes(campaign_.units.size(), kNotKnown);
    for (std::size_t u = 0; u < sizes.size(); ++u) {
      double square = 0;
      for (const double amplitude : term.AmplitudeOf(u)) square += amplitude * amplitude;
      if (square > 0) sizes[u] = std::sqrt(square);
    }
    const bool of_axis = term.form.axis != sim::EffectAxis::kNone;
    maps.push_back(draw(fmt::format("{}{}", term.form.effect->cause,
                                    of_axis ? fmt::format(", {}", sim::Name(term.form.axis)) : ""),
                        std::string(term.form.effect->amplitude_unit), sizes,
                        report::PlateLimits(sizes)));
  }
  return maps;
}

std::vector<report::Svg> DiagnosisFigures::Arrows() const {
  const auto exposure = sim::WorstExposure(facts_, diagnosis_);
  if (!exposure) return {};
  std::vector<double> lengths;
  report::PlateArrows before{
      .title = fmt::format("move {} before", facts_.exposures.move_id[*exposure])};
  report::PlateArrows after{.title =
                                fmt::format("move {} after", facts_.exposures.move_id[*exposure])};
  for (std::size_t u = 0; u < campaign_.units.size(); ++u)
    for (std::size_t row = campaign_.first_row[u]; row < campaign_.first_row[u + 1]; ++row) {
      if (facts_.exposures.of_row[row] != *exposure) continue;
      const sim::CampaignUnit& unit = campaign_.units[u];
      before.units.push_back({unit.base_x_mm, unit.base_y_mm, diagnosis_.x_before_um[row],
                              diagnosis_.y_before_um[row]});
      after.units.push_back(
          {unit.base_x_mm, unit.base_y_mm, diagnosis_.x_after_um[row], diagnosis_.y_after_um[row]});
      lengths.push_back(std::hypot(diagnosis_.x_before_um[row], diagnosis_.y_before_um[row]));
    }
  const double median_um = MedianOf(lengths);
  before.scale_um = after.scale_um =
      RoundNear(std::isfinite(median_um) ? std::max(median_um, 0.1) : 1);
  std::vector<report::Svg> figures = {report::DrawPlateArrows(before),
                                      report::DrawPlateArrows(after)};
  const Dots cloud_before = DotsOf(diagnosis_.x_before_um, diagnosis_.y_before_um);
  const Dots cloud_after = DotsOf(diagnosis_.x_after_um, diagnosis_.y_after_um);
  const auto [x_low, x_high] = BoundsOf(diagnosis_.x_before_um, 0.002);
  const auto [y_low, y_high] = BoundsOf(diagnosis_.y_before_um, 0.002);
  const double reach = std::max({-x_low, x_high, -y_low, y_high, 1.0});
  figures.push_back(
      report::DrawLines({.title = "all residuals",
                         .x = {.label = "x", .unit = "um", .min = -reach, .max = reach},
                         .y = {.label = "y", .unit = "um", .min = -reach, .max = reach},
                         .series = {{.name = "before",
                                     .x = cloud_before.x,
                                     .y = cloud_before.y,
                                     .style = Style::kDots,
                                     .colour = kBeforeColour,
                                     .faint = true},
                                    {.name = "after",
                                     .x = cloud_after.x,
                                     .y = cloud_after.y,
                                     .style = Style::kDots,
                                     .colour = kAfterColour,
                                     .faint = true}},
                         .height_px = 280,
                         .width_px = kSmallPlotWidth_px}));
  return figures;
}

std::vector<report::Svg> DiagnosisFigures::Against(std::size_t axis) const {
  std::vector<Look> all;
  for (const auto& [name, column] : facts_.columns) {
    const bool is_about_the_spot = name == "sigma_um" || name == "pixel_x" || name == "pixel_y";
    if (!column.varies() || is_about_the_spot || name == "rehomed") continue;
    all.push_back({name, column.values, sim::MedianAlong(column.values, angles_.before_deg[axis])});
  }
  std::ranges::stable_sort(
      all, [](const Look& a, const Look& b) { return a.before.structure > b.before.structure; });
  std::vector<report::Svg> figures;
  for (const Look& one : all) {
    const bool shows = one.before.structure > kStructureShown || figures.size() < kColumnsLeast;
    if (figures.size() == kColumnsShown || !shows) break;
    if (one.before.x.size() > 1) figures.push_back(DrawAgainst(one, axis, angles_));
  }
  return figures;
}

report::Svg DiagnosisFigures::Spectrum(std::size_t axis) const {
  const sim::OrderSpectrum spectrum = sim::SpectrumOf(campaign_, angles_, axis);
  const double gear = campaign_.units.empty() ? kNotKnown : campaign_.units.front().gear[axis];
  const auto [low, high] = BoundsOf(campaign_.cmd_deg[axis], 0.02);
  report::LinePlot plot{.title = fmt::format("periods a turn of {} in its error", kAxisNames[axis]),
                        .x = {.label = "order", .log = true},
                        .y = {.label = "amplitude", .unit = "deg", .min = 0},
                        .series = {{.name = "before",
                                    .x = spectrum.order,
                                    .y = spectrum.before_deg,
                                    .colour = kBeforeColour},
                                   {.name = "after",
                                    .x = spectrum.order,
                                    .y = spectrum.after_deg,
                                    .colour = kAfterColour}},
                        .vertical = PeaksOf(spectrum, gear, (high - low) / 360)};
  if (spectrum.chance_deg > 0) plot.horizontal = {{spectrum.chance_deg, "chance"}};
  return report::DrawLines(plot);
}

}  // namespace focalfleet
