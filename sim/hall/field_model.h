// A rotor's radial field on the sphere of its sensors, in the rotor's frame, behind one interface.
// Three models, from the paper's to a better one:
//
// - harmonic: B = A sin^4(theta) cos(4 (phi - phase)), the lowest term of the expansion that the
//   paper begins with. It has one shape, whatever the magnets are.
// - surface: B = A exp(-((theta - 90 deg) / c)^2) cos(4 (phi - phase)), the paper's fitted one.
// - spherical: a sum of spherical harmonics about the centre. Between magnets the potential obeys
//   Laplace's equation, so on a sphere any field is such a sum, and its coefficients fall off
//   geometrically with the degree: where sources lie at 44 mm and at 85 mm around sensors at 59 mm,
//   like 0.75^l and 0.69^l. Some dozens of numbers reach parts per million of the peak.
//
// How the field changes with radius matters where rotor and sensors are not concentric: near the
// sphere B_r ~ r^-decay. Sources within give decay = l + 2, sources without -(l - 1) for each
// degree l; a map at one radius cannot tell, one at several (or poses) can.
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
  Vector3 slope_T;  // change of b with the direction, a unit vector: only tangents may meet it
};

class FieldModel {
 public:
  FieldModel() = default;
  FieldModel(const FieldModel&) = delete;
  FieldModel& operator=(const FieldModel&) = delete;
  virtual ~FieldModel() = default;

  /// "harmonic", "surface" or "spherical".
  [[nodiscard]] virtual std::string_view kind() const = 0;
  /// After which turn about z the field is the same again: 90 deg for eight equal poles.
  [[nodiscard]] virtual double period_rad() const { return 90 * kRadPerDeg; }
  /// Pre: all are unit vectors. Cost: no allocation.
  virtual void EvaluateLanes(const DirectionLanes& local, SampleLanes* out) const = 0;
  /// The same of any number. Pre: as many samples as directions.
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

/// One degree and order. Normalised so that the mean square of a harmonic over the sphere is 1: a
/// coefficient is the rms of its term over the sphere.
struct SphericalTerm {
  int degree = 0;
  int order = 0;
  double cosine_T = 0;
  double sine_T = 0;
  double sd_cosine_T = 0;  // of the fit
  double sd_sine_T = 0;
};
inline constexpr int kDegreeMax = 60;

/// What a model is made from, and what a file of it holds.
using FieldParameters =
    std::variant<HarmonicParameters, SurfaceParameters, std::vector<SphericalTerm>>;

/// Pre: of spherical terms 0 <= order <= degree <= kDegreeMax, each pair once.
std::unique_ptr<FieldModel> MakeField(const FieldParameters& parameters);

/// Normalised associated Legendre functions of one order without the factor sin^order(theta), which
/// are polynomials in z: p[k] is degree order + k. The next is up z p - back (the one before).
struct LegendreStep {
  double up = 0;
  double back = 0;
};
double FirstOfOrder(int order);
/// Pre: degree > order.
LegendreStep StepToDegree(int degree, int order);

}  // namespace focalfleet::sim
