#include "daemon/campaign/cause_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace focalfleet {
namespace {

constexpr CauseWords kWords[] = {
    {"air_turbulence", "air in the light's way", "The air moves neighbouring fibres by some {}",
     false},
    {"arm_length", "arm length", "[have|has] an arm that is {} <longer|shorter> than in the table"},
    {"axis_crosstalk", "crosstalk between the axes",
     "[turn|turns] one axis by {} of what the other moves"},
    {"axis_tilt", "tilt of an axis", "[lean|leans], so that circles are seen as ellipses"},
    {"backlash", "backlash", "[end|ends] {} <late|early> whenever [they reverse|it reverses]"},
    {"base_offset", "place of the base", "[stand|stands] {} from where the table says"},
    {"camera_distortion", "distortion of the camera",
     "The camera sees the plate distorted by some {}", false},
    {"camera_similarity", "motion of the camera",
     "The whole image shifts, turns or grows by some {} from exposure to exposure", false},
    {"centroid_bias", "bias of centroids",
     "Spots are measured {} off by where in a pixel they fall", false},
    {"cogging", "cogging", "[come|comes] to rest {} off, where the rotor prefers to stand"},
    {"collision_contact", "contact of arms", "[touch their neighbours|touches its neighbour]"},
    {"command_quantisation", "rounding of commands", "[obey|obeys] commands that are rounded"},
    {"eccentricity", "eccentricity", "[err|errs] by up to {} once a turn"},
    {"fibre_torque", "torque of the fibre", "[are|is] pulled back by the twisted fibre, by {}"},
    {"friction_windup", "wind-up under friction",
     "[lag|lags] by {} after a reversal until the drive train is wound up"},
    {"gear_scale", "gear ratio", "[turn|turns] {} <more|less> than asked"},
    {"gravity_sag", "sag under gravity", "All fibres sink by {} as gravity turns", false},
    {"gravity_torque", "weight of the arm", "[lean|leans] {} to the side to which the arm weighs"},
    {"hard_stop", "end of the range", "[are|is] held back near an end of the range"},
    {"identity_swap", "exchanged names", "[go|goes] under another unit's name"},
    {"load_angle_lag", "lag under load",
     "[stop|stops] {} behind the command, the more the weaker the drive"},
    {"lost_command", "lost commands", "[miss|misses] a command now and then"},
    {"mode_threshold", "mode of short moves", "[end|ends] short moves {} elsewhere than long ones"},
    {"neighbour_coupling", "magnets of neighbours", "[are|is] pulled {} aside by motors next door"},
    {"phase_imbalance", "imbalance of phases",
     "[ripple|ripples] by {} with each turn of the motor"},
    {"pinion_runout", "run-out of the pinion",
     "[ripple|ripples] by {} with each turn of the last pinion"},
    {"plate_expansion", "expansion of the plate", "The plate grows by {} as it warms", false},
    {"plate_gradient", "warmth across the plate", "The plate bends by the warmth across it", false},
    {"ramp_travel", "travel of the ramps", "[end|ends] each move {} <too far|short>"},
    {"relaxation", "relaxation", "[creep|creeps] back by {} after the motor has stopped"},
    {"scale_asymmetry", "asymmetry of the scale", "[turn|turns] {} farther one way than the other"},
    {"self_heating", "heat of the motor", "[drift|drifts] by {} as the motor warms"},
    {"sensor_bias", "wrong temperatures", "[report|reports] a temperature that runs wrong"},
    {"stage_ripple", "ripple of a gear stage",
     "[ripple|ripples] by {} with each turn of a gear stage"},
    {"start_skew", "late starts", "[are|is] {} short where the bus starts [them|it] late"},
    {"step_loss", "lost steps", "[lose|loses] steps of the motor now and then"},
    {"stiction", "stiction", "[stay|stays] put when asked for a short move"},
    {"supply_drift", "drift of the supply", "[fall|falls] behind by {} as the supply sinks"},
    {"supply_droop", "droop of the supply",
     "[fall|falls] {} behind when many move on the same rail"},
    {"thermal_arm_growth", "growth of the arms", "[have|has] arms that grow by {} as they warm"},
    {"thermal_backlash", "backlash with temperature",
     "[have|has] a play that changes by {} as it warms"},
    {"tooth_damage", "damaged tooth", "[err|errs] by {} at one place of the turn"},
    {"tooth_mesh", "mesh of the teeth", "[ripple|ripples] by {} with each tooth of the gear"},
    {"unknown", "something unknown", "[err|errs] by {}"},
    {"wear", "wear", "[change|changes] by {} with the turns [they have|it has] made"},
    {"zero_offset", "zero of an axis", "[have|has] a zero that is {} off"}};

/// The choice between the words before and after the bar.
std::string_view Chosen(std::string_view both, bool first) {
  const std::size_t bar = std::min(both.find('|'), both.size());
  return first ? both.substr(0, bar) : both.substr(std::min(bar + 1, both.size()));
}

}  // namespace

CauseWords WordsFor(std::string_view cause) {
  const auto* const found = std::ranges::find(kWords, cause, &CauseWords::cause);
  if (found != std::end(kWords)) return *found;
  return {cause, cause, "[err|errs] by {}", true};
}

std::string Spoken(std::string_view does, bool one_unit, double amplitude,
                   std::string_view amplitude_text) {
  std::string out;
  while (!does.empty()) {
    const char open = does.front();
    const char close = open == '[' ? ']' : open == '<' ? '>' : open == '{' ? '}' : '\0';
    if (close == '\0') {
      out += open;
      does.remove_prefix(1);
      continue;
    }
    const std::size_t end = std::min(does.find(close), does.size());
    const std::string_view inside = does.substr(1, end - 1);
    if (open == '{')
      out += amplitude_text;
    else
      out += Chosen(inside, open == '[' ? !one_unit : !(amplitude < 0));
    does.remove_prefix(std::min(end + 1, does.size()));
  }
  return out;
}

std::string SpokenAmplitude(double amplitude, std::string_view unit) {
  if (!std::isfinite(amplitude)) return "an unknown amount";
  // Two digits, and no power of ten: nobody says 1.2e-05.
  const auto digits = [](double value) {
    if (value == 0) return std::string("0");
    const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(value))), 0, 9);
    std::string text = fmt::format("{:.{}f}", value, decimals);
    if (text.find('.') == std::string::npos) return text;
    while (text.back() == '0') text.pop_back();
    if (text.back() == '.') text.pop_back();
    return text;
  };
  const double size = std::abs(amplitude);
  if (unit == "deg/deg" || unit == "mm/mm") return digits(100 * size) + " %";
  if (unit == "1/K") return digits(1e6 * size) + " parts in a million a kelvin";
  if (unit == "mm" && size < 1) return digits(1000 * size) + " um";
  return digits(size) + " " + std::string(unit);
}

}  // namespace focalfleet
