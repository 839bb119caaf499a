// A rotor, its sensors and their campaigns with physics of their own: nothing here comes from
// sim/hall. Magnets are plain cubes of dipoles by the midpoint rule. The rotation is a product of
// three written-out matrices. Sensors are read one by one in a full field vector at their true
// place. The planted effects are named as in the reports.
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

/// A rotor with eight tiles a shell, radial magnetisation, pole width 0.9 of the pitch, remanence
/// 1.2 T.
class DipoleRotor {
 public:
  DipoleRotor(const std::vector<Shell>& shells, int cuts);
  /// The field at a place, rotor frame. Units: mm in, T out.
  [[nodiscard]] Vec Field(const Vec& place_mm) const;

 private:
  std::vector<std::array<double, 6>> dipoles_;  // place, moment
};

std::vector<Shell> PlantedOneShell();
std::vector<Shell> PlantedTwoShells();

/// The eight sensors of the paper: unit directions for 11.25, 75, 15 deg.
std::vector<Vec> PlantedSensors();

/// The field in T that a sensor at `place_mm` with axis `axis` reads, both in the rotor's frame.
using FieldLaw = std::function<double(const Vec& place_mm, const Vec& axis)>;
FieldLaw OfRotor(const DipoleRotor& rotor);
/// The law A exp(-(latitude / width)^2) cos 4 phi, at any radius.
FieldLaw OfSurface(double amplitude_T, double width_deg);

struct PlantedPose {
  double alpha_deg = 0, beta_deg = 0, gamma_deg = 0;
  double temp_C = 20;
  std::vector<double> volts;
};

/// A planted effect is a cause of the library, or one outside of it. Foreseen outside effects are
/// `drift` of a sensor's offset over the rows (V in all), `pose_scale` of the reported alpha, and
/// `crosstalk` of a sensor with the next. The diagnosis has no number for the other three. They are
/// `play` of the reported alpha (deg), `cogging` of gamma (deg), and `iron` that turns with alpha
/// and changes a sensor's gain.
struct Planted {
  std::string cause = "none";
  double size = 0;  // in the cause's own unit
  std::size_t sensor = 0;
  int variant = 0;
};

struct PlantedCampaign {
  std::vector<PlantedPose> poses;
  Planted planted;
  double lambda = 0;  // chi^2 of the planted effect, before anything is projected out
  // After the field's amplitude and phase, which are unknown, are projected out.
  double lambda_free = 0;
};

struct CampaignPlan {
  std::size_t rows = 150;
  double tilt_deg = 12;
  double noise_T = 5e-4;
  bool temperatures = true;
  bool dirty = false;  // 1 % of readings missing, 1 % arbitrary, 5 % four times as noisy
  std::vector<Planted> also = {};
  std::uint64_t seed = 1;
};

/// `law` is without the cause, `wrong` with it: the same but for field causes.
PlantedCampaign MakeCampaign(const CampaignPlan& plan, const FieldLaw& law, const FieldLaw& wrong,
                             const Planted& planted);

/// CSV as focalfleet hall diagnose reads it.
std::string CampaignText(const PlantedCampaign& campaign, bool temperatures);

}  // namespace focalfleet::test
