#include "fleet/camera/camera_model.h"

#include <array>
#include <numbers>
#include <string>

#include "fleet/camera/cholesky.h"

namespace focalfleet {
namespace {

std::complex<double> Ideal(const CameraModel& model, double x_px, double y_px) {
  const std::complex<double> seen =
      std::complex<double>(x_px - model.centre_x_px, y_px - model.centre_y_px) /
      std::polar(model.pixels_per_mm, model.rotation_deg * std::numbers::pi / 180);
  return model.mirrored ? std::conj(seen) : seen;
}

int DegreeOf(std::size_t terms) {
  for (int degree = 0; degree <= kDistortionDegreeMax; ++degree)
    if (MonomialCount(degree) == terms) return degree;
  return -1;
}

}  // namespace

void Monomials(double x, double y, int degree, std::span<double> terms) {
  terms[0] = 1;
  std::size_t begin = 0;  // of the degree below
  std::size_t k = 1;
  for (int d = 1; d <= degree; ++d) {
    const std::size_t below = k - begin;
    for (std::size_t j = 0; j < below; ++j) terms[k + j] = terms[begin + j] * x;
    terms[k + below] = terms[k - 1] * y;
    begin = k;
    k += below + 1;
  }
}

PointFp PlateOf(const CameraModel& model, double x_px, double y_px) {
  const std::complex<double> w = Ideal(model, x_px, y_px);
  PointFp at{w.real(), w.imag()};
  const int degree = DegreeOf(model.distortion.size());
  if (degree < 0) return at;
  std::array<double, kDistortionTermsMax> terms{};
  Monomials(w.real() / model.radius_mm, w.imag() / model.radius_mm, degree, terms);
  for (std::size_t k = 0; k < model.distortion.size(); ++k) {
    at.x_mm += model.distortion[k].x_mm * terms[k];
    at.y_mm += model.distortion[k].y_mm * terms[k];
  }
  return at;
}

Result<CameraModel> WithDistortion(CameraModel model, std::span<const PixelOnPlate> pairs,
                                   int degree) {
  if (degree < 1 || degree > kDistortionDegreeMax)
    return Fail(ErrorCode::kInvalid, "a distortion of degree " + std::to_string(degree) +
                                         " is not between 1 and " +
                                         std::to_string(kDistortionDegreeMax));
  const std::size_t n = MonomialCount(degree);
  if (pairs.size() < 2 * n)
    return Fail(ErrorCode::kInvalid,
                std::to_string(pairs.size()) + " pairs are too few for a distortion of degree " +
                    std::to_string(degree) + ": " + std::to_string(2 * n) + " at least");
  std::vector<double> normal(n * n, 0);
  std::vector<double> x_mm(n, 0);
  std::vector<double> y_mm(n, 0);
  std::vector<double> terms(n);
  for (const PixelOnPlate& pair : pairs) {
    const std::complex<double> w = Ideal(model, pair.x_px, pair.y_px);
    Monomials(w.real() / model.radius_mm, w.imag() / model.radius_mm, degree, terms);
    for (std::size_t i = 0; i < n; ++i) {
      x_mm[i] += terms[i] * (pair.at_fp.x_mm - w.real());
      y_mm[i] += terms[i] * (pair.at_fp.y_mm - w.imag());
      for (std::size_t j = 0; j <= i; ++j) normal[i * n + j] += terms[i] * terms[j];
    }
  }
  const auto factor = Cholesky::Of(std::move(normal), n);
  if (!factor)
    return Fail(ErrorCode::kInvalid,
                "the pairs do not determine a distortion of degree " + std::to_string(degree));
  factor->Solve(x_mm);
  factor->Solve(y_mm);
  model.distortion.resize(n);
  for (std::size_t k = 0; k < n; ++k) model.distortion[k] = {x_mm[k], y_mm[k]};
  return model;
}

}  // namespace focalfleet
