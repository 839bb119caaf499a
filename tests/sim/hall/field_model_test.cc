// Each model against its formula written down anew, and its slopes against differences. Spherical
// harmonics stand against the standard library's Legendre functions.
#include "sim/hall/field_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

std::vector<FieldParameters> Every() {
  return {HarmonicParameters{.amplitude_T = 0.07, .phase_rad = 0.1},
          SurfaceParameters{.amplitude_T = 0.08, .width_rad = 0.37, .phase_rad = -0.05},
          std::vector<SphericalTerm>{{4, 4, 0.03, 0.001},
                                     {6, 4, -0.01, 0},
                                     {9, 4, 0.0003, 0.002},
                                     {1, 0, 0.001, 0},
                                     {14, 12, 0.002, -0.001},
                                     {2, 1, 0.0004, 0.0007}}};
}

double Formula(const FieldParameters& parameters, const Vector3& u) {
  const double theta = std::acos(u.z), phi = std::atan2(u.y, u.x);
  if (const auto* h = std::get_if<HarmonicParameters>(&parameters))
    return h->amplitude_T * std::pow(std::sin(theta), 4) * std::cos(4 * (phi - h->phase_rad));
  if (const auto* s = std::get_if<SurfaceParameters>(&parameters)) {
    const double x = (theta - std::acos(-1) / 2) / s->width_rad;
    return s->amplitude_T * std::exp(-x * x) * std::cos(4 * (phi - s->phase_rad));
  }
  double sum = 0;
  for (const SphericalTerm& term : std::get<std::vector<SphericalTerm>>(parameters)) {
    // std::sph_legendre has a mean square of 1 / (4 pi) with its phase factor over the sphere.
    const double p = std::sph_legendre(static_cast<unsigned>(term.degree),
                                       static_cast<unsigned>(term.order), theta) *
                     std::sqrt(4 * std::acos(-1.0)) * (term.order > 0 ? std::sqrt(2.0) : 1) *
                     (term.order % 2 == 0 ? 1 : -1);
    sum +=
        p * (term.cosine_T * std::cos(term.order * phi) + term.sine_T * std::sin(term.order * phi));
  }
  return sum;
}

TEST(FieldModel, IsItsFormulaAndItsSlopesAreItsChanges) {
  const std::uint64_t seed = test::TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (const FieldParameters& parameters : Every()) {
    const auto model = MakeField(parameters);
    for (int k = 0; k < 200; ++k) {
      const Vector3 u = Unit({rng.Normal(), rng.Normal(), rng.Normal()});
      if (std::abs(u.z) > 0.99) continue;  // differences across the axis mean nothing there
      const Vector3 side = Unit(Cross(u, Vector3{rng.Normal(), rng.Normal(), rng.Normal()}));
      FieldSample sample;
      model->Evaluate({&u, 1}, {&sample, 1});
      EXPECT_NEAR(sample.b_T, Formula(parameters, u), 2e-10) << model->kind();
      constexpr double kStep = 1e-5;
      const double rise =
          Formula(parameters, Unit(u + kStep * side)) - Formula(parameters, Unit(u - kStep * side));
      EXPECT_NEAR(Dot(sample.slope_T, side), rise / (2 * kStep), 2e-7) << model->kind();
    }
  }
}

TEST(FieldModel, KnowsItsPeriod) {
  const auto all = Every();
  EXPECT_NEAR(MakeField(all[0])->period_rad() / kRadPerDeg, 90, 1e-9);
  EXPECT_NEAR(MakeField(all[1])->period_rad() / kRadPerDeg, 90, 1e-9);
  EXPECT_NEAR(MakeField(all[2])->period_rad() / kRadPerDeg, 360, 1e-9);
}

}  // namespace
}  // namespace focalfleet::sim
