// The arrays, and the curves of the paper's figures.

#include "sim/hall/reproduction/hall_reproduce.h"

#include <limits>

#include "protocol/base/check.h"
#include "sim/hall/closed_form.h"
#include "sim/hall/reproduction/hall_parts.h"

namespace focalfleet::sim {
namespace reproduction {
namespace {

constexpr double kMapStep_deg = 3;
constexpr double kObliqueRight = 0.5;  // a deg of theta
constexpr double kObliqueUp_mT = 1;

void Set(Orientation* orientation, int axis, double angle_rad) {
  (axis == 0   ? orientation->alpha_rad
   : axis == 1 ? orientation->beta_rad
               : orientation->gamma_rad) = angle_rad;
}
double Get(const Orientation& orientation, int axis) {
  return axis == 0   ? orientation.alpha_rad
         : axis == 1 ? orientation.beta_rad
                     : orientation.gamma_rad;
}

template <class Invert>
ClaimCurve AngleCurve(const std::string& figure, const std::string& name, const HallArray& array,
                      int axis, double reach_deg, Invert invert) {
  ClaimCurve curve{.figure = figure, .name = name, .x = {}, .y = {}};
  for (double angle_deg = -reach_deg; angle_deg <= reach_deg + 1e-9; angle_deg += reach_deg / 40) {
    Orientation orientation;
    Set(&orientation, axis, angle_deg * kRadPerDeg);
    const auto found = invert(array.Fields(orientation));
    if (!found) continue;
    curve.x.push_back(angle_deg);
    curve.y.push_back(Get(*found, axis) / kRadPerDeg);
  }
  return curve;
}

ClaimCurve Truth(const std::string& figure, double reach_deg) {
  return {figure, "actual", {-reach_deg, reach_deg}, {-reach_deg, reach_deg}};
}

// The field along a line of directions, by the magnets and by a fit.
template <class Direction>
void AddCut(const std::string& figure, const HallArray& array, double from_deg, double to_deg,
            Direction direction, Reproduction* out) {
  ClaimCurve computed{figure, "computed", {}, {}}, fitted{figure, "surface fit", {}, {}};
  ClaimCurve ours{figure, "spherical harmonics", {}, {}};
  const auto surface = static_cast<std::size_t>(FieldKind::kSurface);
  const auto spherical = static_cast<std::size_t>(FieldKind::kSpherical);
  for (double angle_deg = from_deg; angle_deg <= to_deg + 1e-9; angle_deg += 1) {
    const Vector3 local = direction(angle_deg * kRadPerDeg);
    for (ClaimCurve* curve : {&computed, &fitted, &ours}) curve->x.push_back(angle_deg);
    computed.y.push_back(array.magnets.Radial_T(local, kSensorRadius_mm) * 1e3);
    fitted.y.push_back(array.models[surface]->Radial_T(local) * 1e3);
    ours.y.push_back(array.models[spherical]->Radial_T(local) * 1e3);
  }
  for (ClaimCurve* curve : {&computed, &fitted, &ours}) out->curves.push_back(std::move(*curve));
}

// The fitted surface over theta and phi, seen obliquely: points farther in theta stand farther up
// and to the right. Lines of equal theta and of equal phi have a gap between them.
void AddView(const HallArray& array, Reproduction* out) {
  constexpr double kGap = std::numeric_limits<double>::quiet_NaN();
  const FieldModel& surface = *array.models[static_cast<std::size_t>(FieldKind::kSurface)];
  ClaimCurve view{"figure 8: the fitted surface, seen obliquely, " + std::string(array.name),
                  "surface fit",
                  {},
                  {}};
  const auto add = [&](double theta_deg, double phi_deg) {
    const Vector3 local = DirectionAt(theta_deg * kRadPerDeg, phi_deg * kRadPerDeg);
    view.x.push_back(phi_deg + kObliqueRight * theta_deg);
    view.y.push_back(surface.Radial_T(local) * 1e3 + kObliqueUp_mT * theta_deg);
  };
  const auto end_line = [&] {
    view.x.push_back(kGap);
    view.y.push_back(kGap);
  };
  for (double theta_deg = 0; theta_deg <= 180; theta_deg += 6) {
    for (double phi_deg = 0; phi_deg <= 360; phi_deg += 3) add(theta_deg, phi_deg);
    end_line();
  }
  for (double phi_deg = 0; phi_deg <= 360; phi_deg += 11.25) {
    for (double theta_deg = 0; theta_deg <= 180; theta_deg += 3) add(theta_deg, phi_deg);
    end_line();
  }
  out->curves.push_back(std::move(view));
}

}  // namespace

std::vector<double> HallArray::Fields(const Orientation& orientation) const {
  const Rotation rotation(orientation);
  std::vector<double> fields_T;
  for (const HallSensor& sensor : EightSensors())
    fields_T.push_back(magnets.Radial_T(rotation.ToRotor(sensor.direction), kSensorRadius_mm));
  return fields_T;
}

HallArray MakeHallArray(const char* name, const std::vector<MagnetShell>& shells) {
  HallArray array{.name = name, .magnets = MagnetArray(shells, 8)};
  // A single period in longitude is computed; the others repeat it with the other sign.
  for (double theta_deg = 0; theta_deg <= 180; theta_deg += kMapStep_deg)
    for (double phi_deg = 0; phi_deg < 45; phi_deg += kMapStep_deg) {
      const double theta_rad = theta_deg * kRadPerDeg;
      const double b_T =
          array.magnets.Radial_T(DirectionAt(theta_rad, phi_deg * kRadPerDeg), kSensorRadius_mm);
      for (int pole = 0; pole < 8; ++pole)
        array.map.push_back({theta_rad, (phi_deg + 45 * pole) * kRadPerDeg,
                             pole % 2 == 0 ? b_T : -b_T, kSensorRadius_mm});
    }
  for (const FieldKind kind : kFieldKinds) {
    auto fit = FitField(array.map, kind);
    FOCALFLEET_CHECK(fit.has_value());
    const auto k = static_cast<std::size_t>(kind);
    array.models[k] = MakeField(fit->parameters);
    array.fits[k] = std::move(*fit);
  }
  return array;
}

void AddHallFigures(const HallReproduceOptions& options, const HallArray& two,
                    const HallArray& three, Reproduction* out) {
  const SensorAngles angles;
  const char* names[] = {"alpha", "beta", "gamma"};
  for (int axis = 0; axis < 3; ++axis) {
    const double reach_deg = axis == 2 ? 22 : options.tilt_deg;
    const std::string four = std::string("figure 4: ") + names[axis] + " by the harmonic model, 3D";
    out->curves.push_back(Truth(four, reach_deg));
    out->curves.push_back(
        AngleCurve(four, "harmonic, closed form", three, axis, reach_deg,
                   [&](const std::vector<double>& b_T) { return OrientByHarmonic(b_T, angles); }));
    for (const HallArray* array : {&three, &two}) {
      const std::string five =
          std::string("figure 5: ") + names[axis] + " by the surface model, " + array->name;
      out->curves.push_back(Truth(five, reach_deg));
      out->curves.push_back(AngleCurve(
          five, "surface, closed form", *array, axis, reach_deg,
          [&](const std::vector<double>& b_T) { return OrientBySurfaceOfAnyWidth(b_T, angles); }));
    }
  }
  for (const HallArray* array : {&three, &two}) {
    ClaimCurve slope{"figure 6: slope of the field along theta", array->name, {}, {}};
    const auto surface = static_cast<std::size_t>(FieldKind::kSurface);
    for (double theta_deg = 0; theta_deg <= 180; theta_deg += 1) {
      const double step_rad = 1e-4, theta_rad = theta_deg * kRadPerDeg;
      const double rise_T = array->models[surface]->Radial_T(DirectionAt(theta_rad + step_rad, 0)) -
                            array->models[surface]->Radial_T(DirectionAt(theta_rad - step_rad, 0));
      slope.x.push_back(theta_deg);
      slope.y.push_back(rise_T / (2 * step_rad) * kRadPerDeg * 1e3);
    }
    out->curves.push_back(std::move(slope));
  }
  for (const HallArray* array : {&two, &three}) {
    const std::string name(array->name);
    AddCut(
        "figure 8: field along phi at theta 90 deg, " + name, *array, 0, 360,
        [](double angle_rad) { return DirectionAt(90 * kRadPerDeg, angle_rad); }, out);
    AddCut(
        "figure 8: field along theta at phi 0, " + name, *array, 0, 180,
        [](double angle_rad) { return DirectionAt(angle_rad, 0); }, out);
    AddView(*array, out);
  }
}

}  // namespace reproduction

Reproduction ReproduceHall(const HallReproduceOptions& options) {
  const reproduction::HallArray two = reproduction::MakeHallArray("2D", OneShellArray());
  const reproduction::HallArray three = reproduction::MakeHallArray("3D", TwoShellArray());
  Reproduction out;
  reproduction::AddHallClaims(options, two, three, &out);
  reproduction::AddHallFigures(options, two, three, &out);
  for (Claim& claim : out.claims)
    if (claim.status == ClaimStatus::kReproduced || claim.status == ClaimStatus::kOrdering)
      claim.reason.clear();
  return out;
}

}  // namespace focalfleet::sim
