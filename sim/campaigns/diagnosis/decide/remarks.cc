#include "sim/campaigns/diagnosis/decide/remarks.h"

#include <array>
#include <charconv>
#include <cmath>

#include "protocol/base/units.h"

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
                                         double radius_mm, const Places& measured) {
  constexpr std::size_t kShown = 5;
  constexpr double kSeen_um = 1;  // less is the noise of some hundred places
  const std::vector<Similarity> found = FitFrames(frames, expected, measured);
  const auto name = [&](std::size_t k) {
    return std::isnan(frames.id[k]) ? std::string("none") : FourDigits(frames.id[k]);
  };
  std::vector<std::string> remarks;
  for (std::size_t k = 1; k < found.size() && k <= kShown; ++k) {
    const std::complex<double> factor = found[k].factor / found[0].factor;
    const double shift_um = kUmPerMm * std::abs(found[k].Of(found[0].Undone(0)));
    const double edge_um = kUmPerMm * radius_mm * std::abs(factor - 1.0);
    const std::string frames_k_and_0 = "frame " + name(k) + " and in frame " + name(0);
    if (std::max(shift_um, edge_um) < kSeen_um)
      remarks.push_back("the camera stands alike in " + frames_k_and_0);
    else
      remarks.push_back("the camera stands otherwise in " + frames_k_and_0 + ": shifted by " +
                        FourDigits(shift_um) + " um at the centre, turned by " +
                        FourDigits(std::arg(factor) / kRadiansPerDegree) + " deg, scaled by " +
                        FourDigits(1e6 * (std::abs(factor) - 1)) + " ppm");
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
