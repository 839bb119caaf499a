#include "daemon/study/drive_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "daemon/report/page.h"

namespace focalfleet::cli {
namespace {

using report::LinePlot;
using sim::DriveSample;
using Numbers = std::vector<double>;

constexpr double kFloor_dB = -120;
constexpr std::size_t kHistogramBins = 80;

template <class Value>
Numbers Each(const std::vector<DriveSample>& samples, Value value) {
  Numbers numbers;
  numbers.reserve(samples.size());
  for (const DriveSample& sample : samples) numbers.push_back(value(sample));
  return numbers;
}

Numbers Times(const std::vector<DriveSample>& samples) {
  return Each(samples, [](const DriveSample& sample) { return sample.t_s; });
}
Numbers Currents(const std::vector<DriveSample>& samples, std::size_t phase) {
  return Each(samples, [phase](const DriveSample& sample) { return sample.current_A[phase]; });
}

struct Curve {
  Numbers x;
  Numbers y;
};

// The mean of the samples in each carrier period.
template <class Value>
Curve CarrierMeans(const std::vector<DriveSample>& samples, double carrier_s, Value value) {
  Curve curve;
  double sum = 0;
  double count = 0;
  double carrier = 0;
  const auto close = [&] {
    if (count == 0) return;
    curve.x.push_back((carrier + 0.5) * carrier_s);
    curve.y.push_back(sum / count);
    sum = count = 0;
  };
  for (const DriveSample& sample : samples) {
    const double in = std::floor((sample.t_s - samples.front().t_s) / carrier_s);
    if (in != carrier) close();
    carrier = in;
    sum += value(sample);
    count += 1;
  }
  close();
  return curve;
}

void CurrentAndVoltage(const sim::Recording& recording, double carrier_s, report::Page* page) {
  const std::vector<DriveSample>& samples = recording.samples;
  const Numbers t = Times(samples);
  LinePlot current{.title = "Phase current", .x = {"time", "s"}, .y = {"current", "A"}};
  const Numbers a = Currents(samples, 0);
  const Numbers b = Currents(samples, 1);
  const Numbers c = Currents(samples, 2);
  current.series = {{"a", t, a}, {"b", t, b}, {"c", t, c}};
  page->Plot(report::DrawLines(current));
  const auto terminal = [](const DriveSample& sample) { return sample.voltage_V[0]; };
  const Numbers volts = Each(samples, terminal);
  const Curve mean = CarrierMeans(samples, carrier_s, terminal);
  LinePlot voltage{.title = "Terminal voltage a", .x = {"time", "s"}, .y = {"voltage", "V"}};
  voltage.series = {{"against the negative rail", t, volts},
                    {"mean over a carrier period", mean.x, mean.y}};
  page->Plot(report::DrawLines(voltage),
             "Phase current and terminal voltage, as in paper 1's Fig. 12.");
}

void Spectrum(const sim::Recording& recording, const sim::Modulation& modulation,
              report::Page* page) {
  const double carrier = static_cast<double>(modulation.subdivision) * modulation.repeat;
  const auto count = std::min(recording.harmonics_A.size(),
                              static_cast<std::size_t>(std::ceil(2.5 * carrier)) + 1);
  Numbers f;
  Numbers level;
  for (std::size_t m = 1; m < count; ++m) {
    const double share = recording.harmonics_A[m] / recording.figures.fundamental_A;
    f.push_back(static_cast<double>(m) * modulation.field_Hz());
    level.push_back(std::max(kFloor_dB, 20 * std::log10(std::max(share, 1e-300))));
  }
  LinePlot plot{.title = "Spectrum of the phase current",
                .x = {.label = "frequency", .unit = "Hz", .log = true},
                .y = {.label = "over the fundamental", .unit = "dB", .min = kFloor_dB}};
  plot.series = {{"", f, level}};
  plot.vertical = {{carrier * modulation.field_Hz(), "carrier"}};
  page->Plot(report::DrawLines(plot),
             fmt::format("Harmonics of one turn of the field, means over the phases (Fig. 13); "
                         "below {:g} dB drawn there.",
                         kFloor_dB));
}

void CurrentHistogram(const sim::Recording& recording, report::Page* page) {
  const Numbers current = Currents(recording.samples, 0);
  report::Histogram plot{.title = "How often which current flows",
                         .x = {"current of phase a", "A"},
                         .y = {.label = "share of time", .unit = "%"}};
  const double peak = std::max(std::abs(*std::max_element(current.begin(), current.end())),
                               std::abs(*std::min_element(current.begin(), current.end()))) +
                      1e-9;
  for (std::size_t k = 0; k <= kHistogramBins; ++k)
    plot.edges.push_back(peak * (2.0 * static_cast<double>(k) / kHistogramBins - 1));
  plot.counts.assign(kHistogramBins, 0);
  for (const double value : current) {
    const double bin = (value / peak + 1) / 2 * kHistogramBins;
    plot.counts[std::min(static_cast<std::size_t>(bin), kHistogramBins - 1)] +=
        100.0 / static_cast<double>(current.size());
  }
  page->Plot(report::DrawHistogram(plot), "The current's marginal histogram (Fig. 15).");
}

std::vector<report::Reference> LimitLines(const CurrentLimits& limits, bool both_signs) {
  std::vector<report::Reference> lines = {{limits.linear_A, "V/(√3 r)"},
                                          {limits.reachable_A, "2V/(3r)"}};
  if (both_signs) {
    lines.push_back({-limits.linear_A, ""});
    lines.push_back({-limits.reachable_A, ""});
  }
  return lines;
}

// A plot of two carrier periods about the highest sampled current.
void PeakClose(const sim::Recording& recording, const CurrentLimits& limits, double carrier_s,
               report::Page* page) {
  const auto highest = [](const DriveSample& sample) {
    return std::max({std::abs(sample.current_A[0]), std::abs(sample.current_A[1]),
                     std::abs(sample.current_A[2])});
  };
  const auto at = std::max_element(
      recording.samples.begin(), recording.samples.end(),
      [&](const DriveSample& a, const DriveSample& b) { return highest(a) < highest(b); });
  std::vector<DriveSample> close;
  for (const DriveSample& sample : recording.samples)
    if (std::abs(sample.t_s - at->t_s) <= carrier_s) close.push_back(sample);
  const Numbers t = Times(close);
  const Numbers a = Currents(close, 0);
  const Numbers b = Currents(close, 1);
  const Numbers c = Currents(close, 2);
  LinePlot plot{.title = "About the highest current", .x = {"time", "s"}, .y = {"current", "A"}};
  plot.series = {{"a", t, a}, {"b", t, b}, {"c", t, c}};
  plot.horizontal = LimitLines(limits, true);
  page->Plot(report::DrawLines(plot),
             "Within a carrier period the current rises to its peak and falls (Fig. 17). V/(√3 r) "
             "is the largest linear fundamental, 2V/(3r) what a phase can reach.");
}

void Peaks(const sim::Recording& recording, const CurrentLimits& limits, double turn_s,
           report::Page* page) {
  const Numbers& peaks = recording.carrier_peak_A;
  Numbers turn;
  for (std::size_t k = 0; k < peaks.size(); ++k)
    turn.push_back((static_cast<double>(k) + 0.5) / static_cast<double>(peaks.size()));
  LinePlot plot{.title = "Peak of each carrier period",
                .x = {.label = "turns of the field", .min = 0, .max = 1},
                .y = {.label = "highest phase current", .unit = "A", .min = 0}};
  plot.series = {{"", turn, peaks}};
  plot.horizontal = LimitLines(limits, false);
  page->Plot(report::DrawLines(plot),
             fmt::format("Over the last turn that was sampled, {:.4g} s.", turn_s));
}

void TorqueAndLag(const sim::Recording& recording, report::Page* page) {
  Numbers t;
  Numbers torque;
  Numbers lag;
  for (const sim::VectorRecord& vector : recording.vectors) {
    t.push_back(vector.t_s);
    torque.push_back(vector.torque_Nm * 1e6);
    lag.push_back(vector.lag_rad * 180 / std::numbers::pi);
  }
  const Numbers sample_t = Times(recording.samples);
  const Numbers sample_torque =
      Each(recording.samples, [](const DriveSample& sample) { return sample.torque_Nm * 1e6; });
  LinePlot torques{.title = "Torque", .x = {"time", "s"}, .y = {"at the motor shaft", "uNm"}};
  torques.series = {{"as sampled", sample_t, sample_torque}, {"mean over a vector", t, torque}};
  page->Plot(report::DrawLines(torques));
  LinePlot lags{.title = "Lag", .x = {"time", "s"}, .y = {"rotor behind the field", "deg"}};
  lags.series = {{"", t, lag}};
  page->Plot(report::DrawLines(lags),
             "In step the lag stays below 90 degrees; each turn that the "
             "rotor loses adds 360.");
}

}  // namespace

CurrentLimits LimitsOf(const sim::Drive::Setting& setting) {
  const double current_A = setting.bridge.v_bus_V / setting.motor.resistance_ohm;
  return {current_A / std::numbers::sqrt3, current_A * 2 / 3};
}

std::string DriveReport(const DriveChoice& choice, const sim::Recording& recording,
                        const TextRows& rows, const TextRows& settings) {
  const CurrentLimits limits = LimitsOf(choice.setting);
  const double carrier_s = choice.modulation.carrier_s();
  report::Page page("A motor on its bridge");
  page.Table({"figure", "value"}, rows, {report::Align::kLeft, report::Align::kRight});
  CurrentAndVoltage(recording, carrier_s, &page);
  Spectrum(recording, choice.modulation, &page);
  CurrentHistogram(recording, &page);
  PeakClose(recording, limits, carrier_s, &page);
  Peaks(recording, limits, 1 / choice.modulation.field_Hz(), &page);
  TorqueAndLag(recording, &page);
  page.Heading("Settings");
  page.Table({"setting", "value"}, settings, {report::Align::kLeft, report::Align::kRight});
  return page.Html();
}

}  // namespace focalfleet::cli
