#include "fleet/camera/cholesky.h"

#include <cmath>
#include <utility>

namespace focalfleet {

double Dot(const double* a, const double* b, std::size_t n) {
  double s0 = 0;
  double s1 = 0;
  double s2 = 0;
  double s3 = 0;
  std::size_t k = 0;
  for (; k + 4 <= n; k += 4) {
    s0 += a[k] * b[k];
    s1 += a[k + 1] * b[k + 1];
    s2 += a[k + 2] * b[k + 2];
    s3 += a[k + 3] * b[k + 3];
  }
  for (; k < n; ++k) s0 += a[k] * b[k];
  return (s0 + s1) + (s2 + s3);
}

std::optional<Cholesky> Cholesky::Of(std::vector<double> matrix, std::size_t n) {
  constexpr double kPivotShareMin = 1e-12;
  for (std::size_t i = 0; i < n; ++i) {
    double* row = &matrix[i * n];
    for (std::size_t j = 0; j < i; ++j) {
      const double* other = &matrix[j * n];
      row[j] = (row[j] - Dot(row, other, j)) * other[j];
    }
    const double pivot = row[i] - Dot(row, row, i);
    if (!(pivot > kPivotShareMin * row[i])) return std::nullopt;
    row[i] = 1 / std::sqrt(pivot);
  }
  return Cholesky(std::move(matrix), n);
}

void Cholesky::SolveLower(std::span<double> b) const {
  for (std::size_t i = 0; i < n_; ++i)
    b[i] = (b[i] - Dot(&lower_[i * n_], b.data(), i)) * lower_[i * n_ + i];
}

void Cholesky::Solve(std::span<double> b) const {
  SolveLower(b);
  SolveUpper(b);
}

void Cholesky::SolveUpper(std::span<double> b) const {
  for (std::size_t i = n_; i-- > 0;) {
    double sum = b[i];
    for (std::size_t k = i + 1; k < n_; ++k) sum -= lower_[k * n_ + i] * b[k];
    b[i] = sum * lower_[i * n_ + i];
  }
}

double Cholesky::LogDeterminant() const {
  double sum = 0;
  for (std::size_t i = 0; i < n_; ++i) sum -= 2 * std::log(lower_[i * n_ + i]);
  return sum;
}

}  // namespace focalfleet
