#include "sim/campaigns/diagnosis/decide/remarks.h"

#include <array>
#include <charconv>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/model.h"

namespace focalfleet::sim {
namespace {

// Two field vectors of an axis, which are 3 um at 16.5 mm: a table that rounds its angles to
// hundredths is within it. Half of it would call such rounding a break. Twice of it is what a
// camera sees.
constexpr double kJoins_deg = 0.01;

std::string OfRows(std::size_t some, std::size_t all) {
  return std::to_string(some) + " of " + std::to_string(all) + " rows";
}

bool Joins(const Campaign& campaign, std::size_t row) {
  for (const std::size_t axis : {kTheta, kPhi}) {
    const double gap_deg = campaign.from_deg[axis][row] - campaign.cmd_deg[axis][row - 1];
    if (std::abs(std::remainder(gap_deg, kTurnDeg)) > kJoins_deg) return false;
  }
  return true;
}

// How far the places of a frame are from where its image puts them, and how far that image is from
// the first frame's, there.
struct FrameScatter {
  std::vector<double> off_mm;
  double moved_mm2 = 0;  // summed over the places
  void Add(const Similarity& first, const Similarity& own, std::complex<double> expected,
           std::complex<double> measured) {
    off_mm.push_back(std::abs(measured - own.Of(expected)));
    moved_mm2 += std::norm(own.Of(expected) - first.Of(expected));
  }
};

// Whether two frames differ by more than the noise of their places. The squared motion, averaged
// over the places, is then that of four parameters. Those that make the sum of distances least have
// 4/pi of the variance of least squares (Brown, J. R. Stat. Soc. B 45, 25: the spatial median). The
// variance itself is by the median of the squared distances, which for two normal coordinates knows
// it as well as ln^2 2 of the places do by their mean.
bool StandOtherwise(const FrameScatter& first, const FrameScatter& frame) {
  constexpr double kByChance = 0.001;  // of frames in which the camera stands alike
  constexpr double kLn2 = std::numbers::ln2;
  const auto rows = static_cast<double>(frame.off_mm.size());
  const auto of_first = static_cast<double>(first.off_mm.size());
  std::vector<double> off_mm = first.off_mm;
  off_mm.insert(off_mm.end(), frame.off_mm.begin(), frame.off_mm.end());
  const double values = 2 * (rows + of_first), freedom = values - 2 * kExposureParameters;
  const double a = kLn2 * kLn2 * freedom / 2;
  if (!(a > 0)) return false;
  const double variance_mm2 = std::pow(Median(std::move(off_mm)), 2) / (2 * kLn2) * values /
                              freedom * 4 / std::numbers::pi * (1 / rows + 1 / of_first);
  const double left = 1 / (1 + frame.moved_mm2 / rows / variance_mm2 / (2 * a));
  return TailOfFourParameters(left, a) < kByChance;
}

}  // namespace

std::vector<std::string> RemarksOnOrder(const CampaignFacts& facts) {
  const Campaign& campaign = *facts.campaign;
  const bool has_times = !campaign.Find("t_s").empty();
  const std::span<const double> from_measured = campaign.Find("from_measured");
  std::size_t against = 0, breaks = 0;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit] + 1; row < campaign.first_row[unit + 1];
         ++row) {
      if (has_times && campaign.move_id[row] < campaign.move_id[row - 1]) ++against;
      // In a closed loop a move begins where the camera saw the fibre.
      const bool begins_elsewhere = !from_measured.empty() && from_measured[row] > 0.5;
      if (facts.restarts[row] == 0 && !begins_elsewhere && !Joins(campaign, row)) ++breaks;
    }
  std::vector<std::string> remarks;
  if (against > 0)
    remarks.push_back("in " + OfRows(against, campaign.rows()) +
                      " t_s and move_id tell opposite orders: moves are taken in the order of t_s");
  if (breaks > 0)
    remarks.push_back(OfRows(breaks, campaign.rows()) +
                      " do not begin where the unit's row before ended: it was moved otherwise, or "
                      "rows are missing");
  return remarks;
}

std::vector<std::string> RemarksOnRepeats(const RepeatedPlaces& repeated, std::size_t rows) {
  std::vector<std::string> remarks;
  if (!repeated.carried_on.empty())
    remarks.push_back(OfRows(repeated.carried_on.size(), rows) +
                      " repeat the unit's place before to the last digit, where it was not moved: "
                      "they are taken as carried on, not as measured");
  if (!repeated.copies.empty())
    remarks.push_back("the exposure of move " + FirstOf(repeated.copies) +
                      " repeats the places before it: they are not counted as measured");
  return remarks;
}

std::vector<std::string> RemarksOnFrames(const Frames& frames, const Places& expected,
                                         const Places& measured) {
  constexpr std::size_t kShown = 5;  // the others are counted
  const std::vector<Similarity> found = FitFrames(frames, expected, measured);
  std::vector<FrameScatter> scatter(found.size());
  for (std::size_t row = 0; row < frames.of_row.size(); ++row)
    if (std::isfinite(measured.x_mm[row]) && std::isfinite(expected.x_mm[row]))
      scatter[frames.of_row[row]].Add(found[0], found[frames.of_row[row]],
                                      {expected.x_mm[row], expected.y_mm[row]},
                                      {measured.x_mm[row], measured.y_mm[row]});
  const auto name = [&](std::size_t k) {
    return std::isnan(frames.id[k]) ? std::string("none") : FourDigits(frames.id[k]);
  };
  std::vector<std::string> remarks;
  for (std::size_t k = 1; k < found.size() && k <= kShown; ++k) {
    const std::string both = "frame " + name(k) + " and in frame " + name(0);
    if (scatter[k].off_mm.empty()) {
      remarks.push_back("no place was seen in frame " + name(k));
    } else if (!StandOtherwise(scatter[0], scatter[k])) {
      remarks.push_back("the camera stands alike in " + both + ", as far as these places show it");
    } else {
      const std::complex<double> factor = found[k].factor / found[0].factor;
      const double shift_um = kUmPerMm * std::abs(found[k].Of(found[0].Undone(0)));
      remarks.push_back("the camera stands otherwise in " + both + ": shifted by " +
                        FourDigits(shift_um) + " um at the centre, turned by " +
                        FourDigits(std::arg(factor) / kRadiansPerDegree) + " deg, scaled by " +
                        FourDigits(1e6 * (std::abs(factor) - 1)) + " ppm");
    }
  }
  if (found.size() > kShown + 1)
    remarks.push_back("the places of " + std::to_string(found.size() - kShown - 1) +
                      " more frames are taken to one frame as well");
  return remarks;
}

std::string RemarkOnSteps(const PlaceSteps& steps) {
  const bool alike = std::abs(steps.x_mm - steps.y_mm) < 1e-3 * steps.wider_mm();
  return "places come in steps of " +
         (alike ? FourDigits(steps.x_mm) + " mm"
                : FourDigits(steps.x_mm) + " mm in x and " + FourDigits(steps.y_mm) + " mm in y") +
         ": nothing finer can be told";
}

std::string FourDigits(double value) {
  std::array<char, 32> text{};
  const auto written =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 4);
  return {text.data(), written.ptr};
}

}  // namespace focalfleet::sim
