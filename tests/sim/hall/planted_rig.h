// A rotor, its sensors and their campaigns with physics of their own: nothing here comes from
// sim/hall. Magnets are plain cubes of dipoles by the midpoint rule, the rotation is a product of
// three written-out matrices, sensors are read one by one in a full field vector at their true
// place. What is planted is named as in the reports.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace focalfleet::test {

using Vec = std::array<double, 3>;
using Mat = std::array<Vec, 3>;

Mat RotationMatrix(double alpha_rad, double beta_rad, double gamma_rad);
/// M^T v.
Vec BackTurned(const Mat& m, const Vec& v);

struct Shell {
  double inner_mm, outer_mm, half_height_deg;
  std::vector<double> strength = std::vector<double>(8, 1.0);
};

/// Eight tiles a shell, radial magnetisation, pole width 0.9 of the pitch, remanence 1.2 T.
class DipoleRotor {
 public:
  DipoleRotor(const std::vector<Shell>& shells, int cuts);
  /// T at a place in mm, rotor frame.
  [[nodiscard]] Vec Field(const Vec& place_mm) const;

 private:
  std::vector<std::array<double, 6>> dipoles_;  // place, moment
};

std::vector<Shell> PlantedOneShell();
std::vector<Shell> PlantedTwoShells();

/// The eight sensors of the paper: unit directions for 11.25, 75, 15 deg.
std::vector<Vec> PlantedSensors();

/// Field in T that a sensor at `place_mm` with axis `axis` reads, both in the rotor's frame.
using FieldLaw = std::function<double(const Vec& place_mm, const Vec& axis)>;
FieldLaw OfRotor(const DipoleRotor& rotor);
/// A exp(-(latitude / width)^2) cos 4 phi, whatever the radius.
FieldLaw OfSurface(double amplitude_T, double width_deg);

struct PlantedPose {
  double alpha_deg = 0, beta_deg = 0, gamma_deg = 0;
  double temp_C = 20;
  std::vector<double> volts;
};

/// Causes of the library, or what is outside of it: `drift` of a sensor's offset over the rows (V
/// in all), `pose_scale` of the told alpha, `crosstalk` of a sensor with the next; and what the
/// diagnosis has no number for either: `play` of the told alpha (deg), `cogging` of gamma (deg),
/// `iron` that turns with alpha and changes a sensor's gain.
struct Planted {
  std::string cause = "none";
  double size = 0;  // in the cause's own unit
  std::size_t sensor = 0;
  int variant = 0;
};

struct PlantedCampaign {
  std::vector<PlantedPose> poses;
  Planted planted;
  double lambda = 0;       // chi^2 of what was planted, before anything is projected out
  double lambda_free = 0;  // and after the field's amplitude and phase, which nobody knows, are
};

struct CampaignPlan {
  std::size_t rows = 150;
  double tilt_deg = 12;
  double noise_T = 5e-4;
  bool temperatures = true;
  bool dirty = false;  // 1 % of readings missing, 1 % anything, 5 % four times as noisy
  std::vector<Planted> also = {};
  std::uint64_t seed = 1;
};

/// `law` without the cause, `wrong` with it: the same but for field causes.
PlantedCampaign MakeCampaign(const CampaignPlan& plan, const FieldLaw& law, const FieldLaw& wrong,
                             const Planted& planted);

/// CSV as focalfleet hall diagnose reads it.
std::string CampaignText(const PlantedCampaign& campaign, bool temperatures);

}  // namespace focalfleet::test
