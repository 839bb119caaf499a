#include "sim/diagnosis/next_moves.h"

#include <algorithm>
#include <array>
#include <set>
#include <string_view>

namespace focalfleet::sim {
namespace {

constexpr std::size_t kMovesMax = 48;

// A block of moves is one lever; it separates causes that it drives differently.
enum class Lever { kLadder, kSingleAxis, kDrive, kDelay, kMovers, kHomings, kFullRange };

struct LeverOf {
  std::string_view cause;
  Lever lever;
};
constexpr LeverOf kLevers[] = {
    {"load_angle_lag", Lever::kDrive},      {"cogging", Lever::kDrive},
    {"phase_imbalance", Lever::kDrive},     {"relaxation", Lever::kDelay},
    {"start_skew", Lever::kDelay},          {"supply_droop", Lever::kMovers},
    {"neighbour_coupling", Lever::kMovers}, {"backlash", Lever::kLadder},
    {"friction_windup", Lever::kLadder},    {"stiction", Lever::kLadder},
    {"mode_threshold", Lever::kLadder},     {"ramp_travel", Lever::kLadder},
    {"scale_asymmetry", Lever::kLadder},    {"command_quantisation", Lever::kLadder},
    {"gear_scale", Lever::kHomings},        {"wear", Lever::kHomings},
    {"self_heating", Lever::kHomings},      {"thermal_backlash", Lever::kHomings},
    {"axis_crosstalk", Lever::kSingleAxis}, {"fibre_torque", Lever::kFullRange},
    {"eccentricity", Lever::kFullRange},    {"pinion_runout", Lever::kFullRange},
    {"axis_tilt", Lever::kFullRange},       {"hard_stop", Lever::kFullRange},
    {"stage_ripple", Lever::kFullRange},    {"tooth_mesh", Lever::kFullRange},
    {"tooth_damage", Lever::kFullRange}};

void AddLadder(double drive, double delay_s, double movers, const std::string& why,
               std::vector<ProposedMove>* out) {
  constexpr std::array<double, 6> kSteps_deg = {0.1, 0.3, 1, 3, 10, 30};
  double at = 0;
  for (const double step : kSteps_deg)
    for (const double sign : {1.0, -1.0}) {
      at += sign * step;
      out->push_back({at, at / 2, drive, delay_s, movers, false, why});
    }
}

void AddBlock(Lever lever, const std::string& why, std::vector<ProposedMove>* out) {
  switch (lever) {
    case Lever::kLadder:
      AddLadder(1, 3, 1, why, out);
      break;
    case Lever::kDrive:
      for (const double drive : {0.6, 1.0, 1.5})
        for (const double to : {40.0, -40.0, 15.0, -15.0})
          out->push_back({to, to / 2, drive, 3, 1, false, why});
      break;
    case Lever::kDelay:
      for (const double delay_s : {0.3, 3.0, 30.0})
        for (const double to : {40.0, -40.0, 15.0, -15.0})
          out->push_back({to, to / 2, 1, delay_s, 1, false, why});
      break;
    case Lever::kMovers:
      for (const double movers : {0.02, 0.25, 1.0})
        for (const double to : {40.0, -40.0, 15.0, -15.0})
          out->push_back({to, to / 2, 1, 3, movers, false, why});
      break;
    case Lever::kHomings:
      for (const double to : {20.0, 60.0, -60.0, 120.0, -120.0, 5.0})
        out->push_back({to, to / 2, 1, 3, 1, true, why});
      break;
    case Lever::kSingleAxis:
      for (const double to : {80.0, -80.0, 0.0}) out->push_back({0, to, 1, 3, 1, false, why});
      for (const double to : {120.0, -120.0, 0.0}) out->push_back({to, 0, 1, 3, 1, false, why});
      break;
    case Lever::kFullRange:
      for (int k = -6; k <= 6; ++k) out->push_back({27.0 * k, 13.0 * k, 1, 3, 1, k == -6, why});
      break;
  }
}

}  // namespace

std::vector<ProposedMove> ProposeMoves(const Campaign&, const Diagnosis& diagnosis) {
  std::vector<ProposedMove> moves;
  std::set<Lever> taken;
  for (const CauseFound& cause : diagnosis.causes) {
    if (cause.candidates.size() < 2) continue;
    std::string why;
    for (const std::string& candidate : cause.candidates)
      why += (why.empty() ? "" : " | ") + candidate;
    for (const std::string& candidate : cause.candidates)
      for (const LeverOf& entry : kLevers)
        if (entry.cause == candidate && moves.size() < kMovesMax &&
            taken.insert(entry.lever).second)
          AddBlock(entry.lever, why, &moves);
  }
  if (moves.size() > kMovesMax) moves.resize(kMovesMax);
  return moves;
}

}  // namespace focalfleet::sim
