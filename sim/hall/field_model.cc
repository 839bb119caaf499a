#include "sim/hall/field_model.h"

#include <algorithm>
#include <array>
#include <complex>
#include <cstdint>
#include <cstring>
#include <map>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

using Complex = std::complex<double>;

constexpr int kPieces = 1024;
constexpr double kStep = 2.0 / kPieces;

struct Knot {
  double value = 0;
  double slope = 0;  // times the step
};
/// Each piece is c[0] + c[1] t + c[2] t^2 + c[3] t^3, with t from 0 to 1.
struct Cubic {
  double c[4];
};

// ---- eight directions at a time

FOCALFLEET_WIDE void Wave(const DirectionLanes& local, double real, double imaginary,
                          SampleLanes* __restrict out) {
  for (std::size_t k = 0; k < kLanes; ++k) {
    const double x = local.x.at[k], y = local.y.at[k];
    const double x2 = x * x - y * y, y2 = 2 * x * y;
    const double x3 = x2 * x - y2 * y, y3 = x2 * y + y2 * x;
    const double cube_x = real * x3 - imaginary * y3, cube_y = real * y3 + imaginary * x3;
    out->b_T.at[k] = cube_x * x - cube_y * y;
    out->slope_x.at[k] = 4 * cube_x;
    out->slope_y.at[k] = -4 * cube_y;
    out->slope_z.at[k] = 0;
  }
}

// The plane coordinates as complex numbers, one a lane.
struct Flat {
  Lane x, y;
};
inline void Multiply(const Flat& by, Flat* __restrict what) {
  for (std::size_t k = 0; k < kLanes; ++k) {
    const double x = what->x.at[k] * by.x.at[k] - what->y.at[k] * by.y.at[k];
    what->y.at[k] = what->x.at[k] * by.y.at[k] + what->y.at[k] * by.x.at[k];
    what->x.at[k] = x;
  }
}

struct Order {
  int order = 0;
  std::vector<Cubic> cosine = {};  // by piece; empty where it is zero
  std::vector<Cubic> sine = {};
};

// The place of each direction in a table over z.
struct Places {
  std::int32_t piece[kLanes];
  Lane t;
};
inline void Find(const Lane& z, Places* __restrict out) {
  for (std::size_t k = 0; k < kLanes; ++k) {
    const double place = (z.at[k] + 1) * (1 / kStep);
    const double above = place > 0 ? place : 0;
    const double within = above < kPieces - 1e-9 ? above : kPieces - 1e-9;
    out->piece[k] = static_cast<std::int32_t>(within);
    out->t.at[k] = within - out->piece[k];
  }
}

// w = x + i y and its powers, up to w^(m - 1) of the current order m. Orders of equal poles are 8
// apart, so the next is one product away.
struct Powers {
  Flat w, w2, w4, w8, now;
};
FOCALFLEET_WIDE void Begin(const DirectionLanes& local, Places* __restrict places,
                           Powers* __restrict out) {
  Find(local.z, places);
  out->w = {local.x, local.y};
  out->w2 = out->w;
  Multiply(out->w, &out->w2);
  out->w4 = out->w2;
  Multiply(out->w2, &out->w4);
  out->w8 = out->w4;
  Multiply(out->w4, &out->w8);
  for (std::size_t k = 0; k < kLanes; ++k) {
    out->now.x.at[k] = 1;
    out->now.y.at[k] = 0;
  }
}
FOCALFLEET_WIDE void Raise(int by, Powers* __restrict out) {
  for (; by >= 8; by -= 8) Multiply(out->w8, &out->now);
  if ((by & 4) != 0) Multiply(out->w4, &out->now);
  if ((by & 2) != 0) Multiply(out->w2, &out->now);
  if ((by & 1) != 0) Multiply(out->w, &out->now);
}

// Adds the cosine part of Re[conj(C) w^m] for one order m, and its slopes. `along` and sign *
// `across` are the real and the imaginary part of w^(m - 1), conjugate. The sine part is that of i
// w^(m - 1).
struct Part {
  const Cubic* table;
  double order;
  double sign;
};
FOCALFLEET_WIDE void Add(const Part& part, const Places& places, const Flat& w, const Lane& along,
                         const Lane& across, SampleLanes* __restrict out) {
  const double* const c = part.table->c;
  const double order = part.order, sign = part.sign;
  for (std::size_t k = 0; k < kLanes; ++k) {
    const std::int32_t at = 4 * places.piece[k];
    const double t = places.t.at[k];
    const double c0 = c[at], c1 = c[at + 1], c2 = c[at + 2], c3 = c[at + 3];
    const double value = ((c3 * t + c2) * t + c1) * t + c0;
    const double slope = ((3 * c3 * t + 2 * c2) * t + c1) * (1 / kStep);
    const double a = along.at[k], b = sign * across.at[k];
    const double whole = a * w.x.at[k] + b * w.y.at[k];
    const double scaled = order * value;
    out->b_T.at[k] += value * whole;
    out->slope_z.at[k] += slope * whole;
    out->slope_x.at[k] += scaled * a;
    out->slope_y.at[k] += scaled * b;
  }
}
// Order 0 depends on z alone.
void AddZonal(const Cubic* table, const Places& places, SampleLanes* out) {
  for (std::size_t k = 0; k < kLanes; ++k) {
    const double t = places.t.at[k];
    const auto& c = table[places.piece[k]].c;
    out->b_T.at[k] += ((c[3] * t + c[2]) * t + c[1]) * t + c[0];
    out->slope_z.at[k] += ((3 * c[3] * t + 2 * c[2]) * t + c[1]) * (1 / kStep);
  }
}

class HarmonicField final : public FieldModel {
 public:
  explicit HarmonicField(const HarmonicParameters& parameters)
      : factor_(std::polar(parameters.amplitude_T, -4 * parameters.phase_rad)) {}

  [[nodiscard]] std::string_view kind() const override { return "harmonic"; }

  void EvaluateLanes(const DirectionLanes& local, SampleLanes* out) const override {
    Wave(local, factor_.real(), factor_.imag(), out);
  }

 private:
  Complex factor_;
};

class SurfaceField final : public FieldModel {
 public:
  explicit SurfaceField(const SurfaceParameters& parameters)
      : parameters_(parameters), turn_(std::polar(1.0, -4 * parameters.phase_rad)) {}

  [[nodiscard]] std::string_view kind() const override { return "surface"; }

  void EvaluateLanes(const DirectionLanes& local, SampleLanes* out) const override {
    for (std::size_t k = 0; k < kLanes; ++k) {
      const FieldSample sample = At({local.x.at[k], local.y.at[k], local.z.at[k]});
      out->b_T.at[k] = sample.b_T;
      out->slope_x.at[k] = sample.slope_T.x;
      out->slope_y.at[k] = sample.slope_T.y;
      out->slope_z.at[k] = sample.slope_T.z;
    }
  }

 private:
  [[nodiscard]] FieldSample At(const Vector3& u) const {
    // Longitude has no meaning on the axis, where the field is nearly zero.
    const double square = std::max(u.x * u.x + u.y * u.y, 1e-24);
    const double radius = std::sqrt(square);
    const double latitude_rad = std::atan2(u.z, radius);
    const double scaled = latitude_rad / parameters_.width_rad;
    const double peak_T = parameters_.amplitude_T * std::exp(-scaled * scaled);
    // Real numbers are used here: std::complex tests for infinities after each product.
    const double cosine = u.x / radius, sine = u.y / radius;
    const double cosine2 = cosine * cosine - sine * sine, sine2 = 2 * cosine * sine;
    const double cosine4 = cosine2 * cosine2 - sine2 * sine2, sine4 = 2 * cosine2 * sine2;
    const double wave = cosine4 * turn_.real() - sine4 * turn_.imag();
    const double wave_across = cosine4 * turn_.imag() + sine4 * turn_.real();
    FieldSample sample;
    sample.b_T = peak_T * wave;
    const double by_latitude = -2 * scaled / parameters_.width_rad * sample.b_T;
    const double by_longitude = -4 * peak_T * wave_across;
    // Along a meridian dz = cos(latitude) d latitude.
    sample.slope_T = {-by_longitude * u.y / square, by_longitude * u.x / square,
                      by_latitude / radius};
    return sample;
  }

  SurfaceParameters parameters_;
  Complex turn_;
};

// The field is B = sum over orders m of Re[conj(C_m(z)) (x + i y)^m], with C_m a polynomial in z:
// the sum over degrees. C_m is tabulated once, with slopes, and read by cubic Hermite pieces; 1024
// of them leave 1e-10 of a polynomial of degree 20. Value and slope belong together, so that an
// inversion of the table's own values is exact.
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

  void EvaluateLanes(const DirectionLanes& local, SampleLanes* out) const override {
    *out = {};
    Places places;
    Powers powers;
    Begin(local, &places, &powers);
    int reached = 0;
    for (const Order& order : orders_) {
      const int m = order.order;
      if (m == 0) {
        if (!order.cosine.empty()) AddZonal(order.cosine.data(), places, out);
        continue;
      }
      Raise(m - 1 - reached, &powers);
      reached = m - 1;
      const auto& [x, y] = powers.now;
      if (!order.cosine.empty())
        Add({order.cosine.data(), static_cast<double>(m), -1}, places, powers.w, x, y, out);
      if (!order.sine.empty())
        Add({order.sine.data(), static_cast<double>(m), 1}, places, powers.w, y, x, out);
    }
  }

 private:
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
    if (any(cosine)) table.cosine = CubicsOf(order, cosine);
    if (any(sine)) table.sine = CubicsOf(order, sine);
    return table;
  }

  // Value and derivative come from the three-term recurrence.
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

  // Hermite's cubics go through both knots of a piece with their slopes.
  static std::vector<Cubic> CubicsOf(int order, const std::vector<double>& coefficients) {
    const std::vector<Knot> knots = KnotsOf(order, coefficients);
    std::vector<Cubic> cubics;
    for (std::size_t k = 0; k < kPieces; ++k) {
      const Knot &low = knots[k], &high = knots[k + 1];
      const double rise = high.value - low.value;
      cubics.push_back({{low.value, low.slope, 3 * rise - 2 * low.slope - high.slope,
                         low.slope + high.slope - 2 * rise}});
    }
    return cubics;
  }

  std::vector<Order> orders_;  // ascending
};

}  // namespace

void FieldModel::Evaluate(std::span<const Vector3> local, std::span<FieldSample> out) const {
  DirectionLanes directions;
  SampleLanes samples;
  for (std::size_t begin = 0; begin < local.size(); begin += kLanes) {
    const std::size_t count = std::min(kLanes, local.size() - begin);
    for (std::size_t k = 0; k < kLanes; ++k) {
      const Vector3& u = local[begin + std::min(k, count - 1)];
      directions.x.at[k] = u.x;
      directions.y.at[k] = u.y;
      directions.z.at[k] = u.z;
    }
    EvaluateLanes(directions, &samples);
    for (std::size_t k = 0; k < count; ++k)
      out[begin + k] = {samples.b_T.at[k],
                        {samples.slope_x.at[k], samples.slope_y.at[k], samples.slope_z.at[k]}};
  }
}

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
