// PlotRatios draws how ratios are distributed (SVG). For each series it shows the share of
// configurations whose ratio to the bound is no more than a given value.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

namespace focalfleet::bench {

struct RatioSeries {
  std::string name;
  const char* colour = "";
  std::vector<double> ratios;
};

namespace ratio_plot {

constexpr double kLeft = 60, kTop = 46, kWidth = 600, kHeight = 240;

inline std::string Number(double value, int digits = 1) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

inline std::string Text(double x, double y, const char* anchor, const std::string& what) {
  return "<text x=\"" + Number(x) + "\" y=\"" + Number(y) + "\" text-anchor=\"" + anchor + "\">" +
         what + "</text>\n";
}

inline std::string Line(double x0, double y0, double x1, double y1) {
  return "<path d=\"M" + Number(x0) + " " + Number(y0) + "L" + Number(x1) + " " + Number(y1) +
         "\" stroke=\"#ccc\"/>\n";
}

}  // namespace ratio_plot

/// The plot as SVG. Pre: no series is empty.
inline std::string PlotRatios(const std::string& title, std::vector<RatioSeries> all) {
  using namespace ratio_plot;
  double most = 1;
  for (RatioSeries& series : all) {
    std::sort(series.ratios.begin(), series.ratios.end());
    most = std::max(most, series.ratios.back());
  }
  const double last = std::ceil(most * 10 + 0.5) / 10;
  const auto x_of = [&](double ratio) { return kLeft + kWidth * (ratio - 1) / (last - 1); };
  const auto y_of = [&](double share) { return kTop + kHeight * (1 - share); };
  std::string svg =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 700 350\" "
      "font-family=\"sans-serif\" "
      "font-size=\"13\" fill=\"#222\">\n<rect width=\"700\" height=\"350\" fill=\"#fff\"/>\n";
  svg += Text(kLeft, 24, "start", title);
  const double step = last > 2 ? 0.2 : 0.1;
  for (double ratio = 1; ratio < last + 1e-9; ratio += step) {
    svg += Line(x_of(ratio), kTop, x_of(ratio), kTop + kHeight);
    svg += Text(x_of(ratio), kTop + kHeight + 18, "middle", Number(ratio));
  }
  for (const double share : {0.0, 0.5, 1.0}) {
    svg += Line(kLeft, y_of(share), kLeft + kWidth, y_of(share));
    svg += Text(kLeft - 8, y_of(share) + 4, "end", Number(100 * share, 0) + " %");
  }
  svg += Text(kLeft + kWidth / 2, kTop + kHeight + 40, "middle",
              "makespan over the slowest unit's time alone");
  double key_y = kTop + kHeight * 0.6;
  for (const RatioSeries& series : all) {
    const auto n = static_cast<double>(series.ratios.size());
    std::string path = "M" + Number(x_of(1)) + " " + Number(y_of(0));
    for (std::size_t k = 0; k < series.ratios.size(); ++k)
      path += "H" + Number(x_of(series.ratios[k])) + "V" +
              Number(y_of((static_cast<double>(k) + 1) / n));
    path += "H" + Number(x_of(last));
    svg += "<path d=\"" + path + "\" fill=\"none\" stroke-width=\"2\" stroke=\"" +
           std::string(series.colour) + "\"/>\n";
    svg += "<g fill=\"" + std::string(series.colour) + "\">" +
           Text(kLeft + kWidth * 0.05, key_y, "start",
                series.name + ": median " + Number(series.ratios[series.ratios.size() / 2], 3) +
                    ", worst " + Number(series.ratios.back(), 3)) +
           "</g>";
    key_y += 20;
  }
  return svg + "</svg>\n";
}

}  // namespace focalfleet::bench
