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

// B = sum over orders m of Re[conj(C_m(z)) (x + i y)^m], C_m a polynomial in z: the sum over
// degrees. It is tabulated once, with slopes, and read by cubic Hermite pieces: 1024 of them leave
// 1e-10 of a polynomial of degree 20, and value and slope belong together, so that an inversion of
// the table's own values is exact.
class SphericalField final : public FieldModel {
 public:
  explicit SphericalField(const std::vector<SphericalTerm>& terms) {
    std::map<int, std::vector<SphericalTerm>> by_order;
    for (const SphericalTerm& term : terms) {
      FOCALFLEET_CHECK(term.order >= 0 && term.degree >= term.order && term.degree <= kDegreeMax);
      by_order[term.order].push_back(term);
    }
    for (const auto& [order, list] : by_order) orders_.push_back(Tabulate(order, list));
  }

  [[nodiscard]] std::string_view kind() const override { return "spherical"; }

  [[nodiscard]] double period_rad() const override {
    const bool four_fold = std::all_of(orders_.begin(), orders_.end(),
                                       [](const Order& order) { return order.order % 4 == 0; });
    return (four_fold ? 90 : 360) * kRadPerDeg;
  }

  void Evaluate(std::span<const Vector3> local, std::span<FieldSample> out) const override {
    for (std::size_t k = 0; k < local.size(); ++k) out[k] = At(local[k]);
  }

 private:
  static constexpr int kPieces = 1024;
  static constexpr double kStep = 2.0 / kPieces;

  struct Knot {
    double value = 0;
    double slope = 0;  // times the step
  };
  struct Order {
    int order = 0;
    std::vector<Knot> cosine;  // empty where it is zero
    std::vector<Knot> sine;
  };
  struct Read {
    double value = 0;
    double slope = 0;
  };

  struct Flat {
    double x = 0;
    double y = 0;
  };
  // As complex numbers; std::complex asks for infinities behind each product.
  static Flat Times(const Flat& a, const Flat& b) {
    return {a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x};
  }

  static Order Tabulate(int order, const std::vector<SphericalTerm>& terms) {
    Order table{.order = order};
    int degree_max = order;
    for (const SphericalTerm& term : terms) degree_max = std::max(degree_max, term.degree);
    std::vector<double> cosine(static_cast<std::size_t>(degree_max + 1));
    std::vector<double> sine = cosine;
    for (const SphericalTerm& term : terms) {
      cosine[static_cast<std::size_t>(term.degree)] = term.cosine_T;
      sine[static_cast<std::size_t>(term.degree)] = term.sine_T;
    }
    const auto any = [](const std::vector<double>& list) {
      return std::any_of(list.begin(), list.end(), [](double value) { return value != 0; });
    };
    if (any(cosine)) table.cosine = KnotsOf(order, cosine);
    if (any(sine)) table.sine = KnotsOf(order, sine);
    return table;
  }

  // Value and derivative by the three-term recurrence.
  static std::vector<Knot> KnotsOf(int order, const std::vector<double>& coefficients) {
    std::vector<Knot> knots;
    for (int k = 0; k <= kPieces; ++k) {
      const double z = -1 + k * kStep;
      double p = FirstOfOrder(order), p_before = 0, d = 0, d_before = 0;
      Knot knot;
      for (std::size_t degree = static_cast<std::size_t>(order); degree < coefficients.size();
           ++degree) {
        if (degree > static_cast<std::size_t>(order)) {
          const LegendreStep step = StepToDegree(static_cast<int>(degree), order);
          const double p_next = step.up * z * p - step.back * p_before;
          const double d_next = step.up * (p + z * d) - step.back * d_before;
          p_before = p;
          p = p_next;
          d_before = d;
          d = d_next;
        }
        knot.value += coefficients[degree] * p;
        knot.slope += coefficients[degree] * d * kStep;
      }
      knots.push_back(knot);
    }
    return knots;
  }

  static Read ReadAt(const std::vector<Knot>& knots, std::size_t piece, double t) {
    if (knots.empty()) return {};
    const Knot& low = knots[piece];
    const Knot& high = knots[piece + 1];
    const double rise = high.value - low.value;
    const double a = low.slope - rise, b = rise - high.slope;
    // low + t rise + t (1 - t) ((1 - t) a + t b)
    const double bow = (1 - t) * a + t * b, hump = t * (1 - t);
    return {low.value + t * rise + hump * bow,
            (rise + (1 - 2 * t) * bow + hump * (b - a)) * (1 / kStep)};
  }

  [[nodiscard]] FieldSample At(const Vector3& u) const {
    const double place = std::clamp((u.z + 1) * (1 / kStep), 0.0, kPieces - 1e-9);
    const auto piece = static_cast<std::size_t>(place);
    const double t = place - static_cast<double>(piece);
    FieldSample sample;
    // w = x + i y, and w^(m - 1) of the order at hand; orders of equal poles are 8 apart.
    const Flat w{u.x, u.y}, w2 = Times(w, w), w4 = Times(w2, w2), w8 = Times(w4, w4);
    Flat power{1, 0};
    int reached = 0;
    for (const Order& order : orders_) {
      const Read cosine = ReadAt(order.cosine, piece, t);
      const int m = order.order;
      if (m == 0) {
        sample.b_T += cosine.value;
        sample.slope_T.z += cosine.slope;
        continue;
      }
      const Read sine = ReadAt(order.sine, piece, t);
      int gap = m - 1 - reached;
      for (; gap >= 8; gap -= 8) power = Times(power, w8);
      if ((gap & 4) != 0) power = Times(power, w4);
      if ((gap & 2) != 0) power = Times(power, w2);
      if ((gap & 1) != 0) power = Times(power, w);
      reached = m - 1;
      const Flat whole = Times(power, w);
      sample.b_T += cosine.value * whole.x + sine.value * whole.y;
      sample.slope_T.z += cosine.slope * whole.x + sine.slope * whole.y;
      sample.slope_T.x += m * (cosine.value * power.x + sine.value * power.y);
      sample.slope_T.y += m * (sine.value * power.x - cosine.value * power.y);
    }
    return sample;
  }

  std::vector<Order> orders_;  // ascending
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
