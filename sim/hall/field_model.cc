#include "sim/hall/field_model.h"

#include <algorithm>
#include <array>
#include <complex>
#include <map>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

using Complex = std::complex<double>;

class HarmonicField final : public FieldModel {
 public:
  explicit HarmonicField(const HarmonicParameters& parameters)
      : factor_(std::polar(parameters.amplitude_T, -4 * parameters.phase_rad)) {}

  [[nodiscard]] std::string_view kind() const override { return "harmonic"; }

  void Evaluate(std::span<const Vector3> local, std::span<FieldSample> out) const override {
    for (std::size_t k = 0; k < local.size(); ++k) {
      const Complex w(local[k].x, local[k].y);
      const Complex cube = factor_ * w * w * w;
      out[k].b_T = (cube * w).real();
      out[k].slope_T = {4 * cube.real(), -4 * cube.imag(), 0};
    }
  }

 private:
  Complex factor_;
};

class SurfaceField final : public FieldModel {
 public:
  explicit SurfaceField(const SurfaceParameters& parameters)
      : parameters_(parameters), turn_(std::polar(1.0, -4 * parameters.phase_rad)) {}

  [[nodiscard]] std::string_view kind() const override { return "surface"; }

  void Evaluate(std::span<const Vector3> local, std::span<FieldSample> out) const override {
    for (std::size_t k = 0; k < local.size(); ++k) {
      const Vector3& u = local[k];
      // Longitude means nothing on the axis, where the field is nearly none.
      const double square = std::max(u.x * u.x + u.y * u.y, 1e-24);
      const double radius = std::sqrt(square);
      const double latitude_rad = std::atan2(u.z, radius);
      const double scaled = latitude_rad / parameters_.width_rad;
      const double peak_T = parameters_.amplitude_T * std::exp(-scaled * scaled);
      Complex wave = Complex(u.x, u.y) / radius;
      wave *= wave;
      wave *= wave * turn_;
      out[k].b_T = peak_T * wave.real();
      const double by_latitude = -2 * scaled / parameters_.width_rad * out[k].b_T;
      const double by_longitude = -4 * peak_T * wave.imag();
      // Along a meridian dz = cos(latitude) d latitude.
      out[k].slope_T = {-by_longitude * u.y / square, by_longitude * u.x / square,
                        by_latitude / radius};
    }
  }

 private:
  SurfaceParameters parameters_;
  Complex turn_;
};

// B = sum over orders m of Re[conj(C_m(z)) (x + i y)^m], C_m a polynomial: the sum over degrees by
// the three-term recurrence, value and derivative together.
class SphericalField final : public FieldModel {
 public:
  explicit SphericalField(const std::vector<SphericalTerm>& terms) {
    std::map<int, std::vector<SphericalTerm>> by_order;
    for (const SphericalTerm& term : terms) {
      FOCALFLEET_CHECK(term.order >= 0 && term.degree >= term.order && term.degree <= kDegreeMax);
      by_order[term.order].push_back(term);
    }
    for (const auto& [order, list] : by_order) {
      int degree_max = order;
      for (const SphericalTerm& term : list) degree_max = std::max(degree_max, term.degree);
      Ladder ladder;
      ladder.order = order;
      ladder.rungs.resize(static_cast<std::size_t>(degree_max - order + 1));
      for (const SphericalTerm& term : list) {
        Rung& rung = ladder.rungs[static_cast<std::size_t>(term.degree - order)];
        rung.cosine_T = term.cosine_T;
        rung.sine_T = term.sine_T;
      }
      ladder.first = FirstOfOrder(order);
      for (std::size_t k = 1; k < ladder.rungs.size(); ++k) {
        const LegendreStep step = StepToDegree(order + static_cast<int>(k), order);
        ladder.rungs[k].up = step.up;
        ladder.rungs[k].back = step.back;
      }
      ladders_.push_back(std::move(ladder));
    }
  }

  [[nodiscard]] std::string_view kind() const override { return "spherical"; }

  [[nodiscard]] double period_rad() const override {
    const bool four_fold = std::all_of(ladders_.begin(), ladders_.end(),
                                       [](const Ladder& ladder) { return ladder.order % 4 == 0; });
    return (four_fold ? 90 : 360) * kRadPerDeg;
  }

  void Evaluate(std::span<const Vector3> local, std::span<FieldSample> out) const override {
    for (std::size_t k = 0; k < local.size(); ++k) out[k] = At(local[k]);
  }

 private:
  // p_l = up z p_(l-1) - back p_(l-2), times its coefficients.
  struct Rung {
    double up = 0;
    double back = 0;
    double cosine_T = 0;
    double sine_T = 0;
  };
  struct Ladder {
    int order = 0;
    double first = 1;  // p of degree = order
    std::vector<Rung> rungs;
  };

  [[nodiscard]] FieldSample At(const Vector3& u) const {
    FieldSample sample;
    const Complex w(u.x, u.y);
    Complex power = 1;  // w^(m - 1) of the ladder at hand
    int reached = 0;
    for (const Ladder& ladder : ladders_) {
      double p = ladder.first, p_before = 0, d = 0, d_before = 0;
      double cosine = 0, sine = 0, cosine_slope = 0, sine_slope = 0;
      for (const Rung& rung : ladder.rungs) {
        if (&rung != ladder.rungs.data()) {
          const double p_next = rung.up * u.z * p - rung.back * p_before;
          const double d_next = rung.up * (p + u.z * d) - rung.back * d_before;
          p_before = p;
          p = p_next;
          d_before = d;
          d = d_next;
        }
        cosine += rung.cosine_T * p;
        sine += rung.sine_T * p;
        cosine_slope += rung.cosine_T * d;
        sine_slope += rung.sine_T * d;
      }
      const int m = ladder.order;
      const Complex coefficient(cosine, -sine), slope(cosine_slope, -sine_slope);
      if (m == 0) {
        sample.b_T += cosine;
        sample.slope_T.z += cosine_slope;
        continue;
      }
      for (; reached < m - 1; ++reached) power *= w;
      const Complex whole = power * w;
      const Complex by_w = static_cast<double>(m) * coefficient * power;
      sample.b_T += (coefficient * whole).real();
      sample.slope_T.x += by_w.real();
      sample.slope_T.y -= by_w.imag();
      sample.slope_T.z += (slope * whole).real();
    }
    return sample;
  }

  std::vector<Ladder> ladders_;  // orders ascend
};

}  // namespace

std::unique_ptr<FieldModel> MakeField(const FieldParameters& parameters) {
  if (const auto* harmonic = std::get_if<HarmonicParameters>(&parameters))
    return std::make_unique<HarmonicField>(*harmonic);
  if (const auto* surface = std::get_if<SurfaceParameters>(&parameters))
    return std::make_unique<SurfaceField>(*surface);
  return std::make_unique<SphericalField>(std::get<std::vector<SphericalTerm>>(parameters));
}

double FirstOfOrder(int order) {
  double first = 1;
  for (int k = 1; k <= order; ++k) first *= std::sqrt((2.0 * k + 1) / (2.0 * k) * (k == 1 ? 2 : 1));
  return first;
}

LegendreStep StepToDegree(int degree, int order) {
  const double l = degree, m = order, before = l - 1;
  const double up = std::sqrt((2 * l - 1) * (2 * l + 1) / ((l - m) * (l + m)));
  return {up, up * std::sqrt((before * before - m * m) / (4 * before * before - 1))};
}

}  // namespace focalfleet::sim
