// A rotor's radial field on the sphere of its sensors, in the rotor's frame, behind one interface.
// Three models describe the field, from the one of the paper to a better one:
//
// - harmonic: B = A sin^4(theta) cos(4 (phi - phase)), the lowest term of the expansion that the
//   paper begins with. The shape is the same for all magnets.
// - surface: B = A exp(-((theta - 90 deg) / c)^2) cos(4 (phi - phase)), the paper's fitted one.
// - spherical: a sum of spherical harmonics about the centre. Between magnets the potential obeys
//   Laplace's equation, so any field on a sphere is such a sum, and its coefficients fall off
//   geometrically with the degree. For sources at 44 mm and at 85 mm around sensors at 59 mm they
//   fall like 0.75^l and 0.69^l. Some dozens of numbers reach parts per million of the peak.
//
// The change of the field with radius matters where rotor and sensors are not concentric: near the
// sphere B_r ~ r^-decay. Sources within give decay = l + 2, sources without -(l - 1) for each
// degree l. A map at one radius cannot determine the decay; one at several radii (or poses) can.
//
// Units: T, radians. Source: [HallOrientation2014] "Derivation of orientation", as reconstructed.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "sim/hall/lanes.h"
#include "sim/hall/rotation.h"

namespace focalfleet::sim {

struct FieldSample {
  double b_T = 0;
  // The change of b with the direction, a unit vector. Only tangents may be multiplied with it.
  Vector3 slope_T;
};

class FieldModel {
 public:
  FieldModel() = default;
  FieldModel(const FieldModel&) = delete;
  FieldModel& operator=(const FieldModel&) = delete;
  virtual ~FieldModel() = default;

  /// "harmonic", "surface" or "spherical".
  [[nodiscard]] virtual std::string_view kind() const = 0;
  /// The turn about z after which the field repeats: 90 deg for eight equal poles.
  [[nodiscard]] virtual double period_rad() const { return 90 * kRadPerDeg; }
  /// The fields of eight directions. Pre: all are unit vectors. Cost: no allocation.
  virtual void EvaluateLanes(const DirectionLanes& local, SampleLanes* out) const = 0;
  /// The fields of any number of directions. Pre: as many samples as directions.
  void Evaluate(std::span<const Vector3> local, std::span<FieldSample> out) const;

  [[nodiscard]] double Radial_T(const Vector3& local) const {
    FieldSample sample;
    Evaluate({&local, 1}, {&sample, 1});
    return sample.b_T;
  }
};

struct HarmonicParameters {
  double amplitude_T = 0;
  double phase_rad = 0;  // longitude of a pole
  double sd_amplitude_T = 0;
  double sd_phase_rad = 0;
};

struct SurfaceParameters {
  double amplitude_T = 0;
  double width_rad = 21 * kRadPerDeg;  // c, of the paper's 3D array
  double phase_rad = 0;
  double sd_amplitude_T = 0;
  double sd_width_rad = 0;
  double sd_phase_rad = 0;
};

/// The term of one degree and order. The mean square of a harmonic over the sphere is normalised to
/// 1, so a coefficient is the rms of its term over the sphere.
struct SphericalTerm {
  int degree = 0;
  int order = 0;
  double cosine_T = 0;
  double sine_T = 0;
  double sd_cosine_T = 0;  // of the fit
  double sd_sine_T = 0;
};
inline constexpr int kDegreeMax = 60;

/// The parameters that a model is made from, and that a model's file holds.
using FieldParameters =
    std::variant<HarmonicParameters, SurfaceParameters, std::vector<SphericalTerm>>;

/// Pre: spherical terms have 0 <= order <= degree <= kDegreeMax, each pair once.
std::unique_ptr<FieldModel> MakeField(const FieldParameters& parameters);

/// Normalised associated Legendre functions of one order, without the factor sin^order(theta), are
/// polynomials in z: p[k] is degree order + k. The next one is up z p - back (the one before).
struct LegendreStep {
  double up = 0;
  double back = 0;
};
double FirstOfOrder(int order);
/// Pre: degree > order.
LegendreStep StepToDegree(int degree, int order);

}  // namespace focalfleet::sim
