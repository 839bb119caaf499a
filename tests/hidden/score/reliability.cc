#include "tests/hidden/score/reliability.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/hidden/score/intervals.h"

namespace focalfleet::hidden {

namespace {

std::string Tenths(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f", value);
  return text.data();
}

}  // namespace

Reliability ReliabilityOf(const std::vector<Case>& cases) {
  Reliability bins{};
  for (const Case& c : cases)
    for (const NamedCause& named : c.named) {
      if (IsStatic(named.cause)) continue;
      const auto is_true = [&](const std::string& name) {
        return c.also_true.count(name) != 0 || c.IsTrue(name);
      };
      for (const auto& [cause, probability] : named.posterior) {
        const double at = std::clamp(probability * 10, 0.0, 9.0);
        ReliabilityBin& bin = bins[static_cast<std::size_t>(at)];
        ++bin.count;
        const bool right =
            cause == "unknown" ? std::ranges::none_of(named.candidates, is_true) : is_true(cause);
        bin.right += right ? 1 : 0;
        bin.stated_sum += probability;
      }
    }
  return bins;
}

std::optional<double> CalibrationError(const Reliability& reliability) {
  double sum = 0, count = 0;
  for (const ReliabilityBin& bin : reliability) {
    sum += bin.count * std::abs(bin.stated() - bin.share());
    count += bin.count;
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

std::string TableOf(const Reliability& reliability) {
  std::string text = "stated   right    of    Clopper-Pearson\n";
  for (const ReliabilityBin& bin : reliability) {
    if (bin.count == 0) continue;
    const Interval interval = ClopperPearson(bin.right, bin.count);
    std::array<char, 128> line{};
    std::snprintf(line.data(), line.size(), "%.3f    %.3f %6d    [%.4f, %.4f]\n", bin.stated(),
                  bin.share(), bin.count, interval.low, interval.high);
    text += line.data();
  }
  return text;
}

std::string PictureOf(const Reliability& reliability) {
  constexpr double kLeft = 60, kTop = 20, kSide = 300;
  const auto x = [&](double stated) { return kLeft + kSide * stated; };
  const auto y = [&](double right) { return kTop + kSide * (1 - right); };
  const auto line = [&](double from_x, double from_y, double to_x, double to_y,
                        const std::string& colour) {
    return "<path d=\"M" + Tenths(from_x) + " " + Tenths(from_y) + "L" + Tenths(to_x) + " " +
           Tenths(to_y) + "\" stroke=\"" + colour + "\"/>\n";
  };
  const auto words = [&](double at_x, double at_y, const std::string& anchor,
                         const std::string& said) {
    return "<text x=\"" + Tenths(at_x) + "\" y=\"" + Tenths(at_y) + "\" text-anchor=\"" + anchor +
           "\">" + said + "</text>\n";
  };
  std::string text =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 400 380\" "
      "font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n"
      "<rect width=\"400\" height=\"380\" fill=\"#fff\"/>\n";
  for (const double tick : {0.0, 0.5, 1.0}) {
    text += line(x(tick), y(0), x(tick), y(1), "#ccc") + line(x(0), y(tick), x(1), y(tick), "#ccc");
    text += words(x(tick), y(0) + 18, "middle", Tenths(tick));
    text += words(x(0) - 8, y(tick) + 4, "end", Tenths(tick));
  }
  text += line(x(0), y(0), x(1), y(1), "#888");
  for (const ReliabilityBin& bin : reliability) {
    if (bin.count == 0) continue;
    const Interval interval = ClopperPearson(bin.right, bin.count);
    const double at = x(bin.stated());
    text += line(at, y(interval.low), at, y(interval.high), "#0b62a4");
    text += "<circle cx=\"" + Tenths(at) + "\" cy=\"" + Tenths(y(bin.share())) +
            "\" r=\"4\" fill=\"#0b62a4\"/>\n";
    text += words(at + 7, y(bin.share()) + 4, "start", std::to_string(bin.count));
  }
  text += words(x(0.5), y(0) + 40, "middle", "stated probability");
  text += "<g transform=\"translate(" + Tenths(x(0) - 38) + " " + Tenths(y(0.5)) +
          ") rotate(-90)\">" + words(0, 0, "middle", "share that is right") + "</g>\n";
  return text + "</svg>\n";
}

}  // namespace focalfleet::hidden
