// The factor L of a symmetric positive definite matrix, A = L L^T. A fit of a few hundred points
// needs no other linear algebra. Cost: n^3 / 6 multiplications, 1 ms at n = 200.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace focalfleet {

class Cholesky {
 public:
  /// `matrix`: row-major, (n, n); only its lower half is read. Empty: it is not positive definite
  /// within rounding.
  static std::optional<Cholesky> Of(std::vector<double> matrix, std::size_t n);

  /// Replaces b by L^-1 b.
  void SolveLower(std::span<double> b) const;
  /// Replaces b by L^-T b.
  void SolveUpper(std::span<double> b) const;
  /// Replaces b by A^-1 b.
  void Solve(std::span<double> b) const;
  /// Natural logarithm of det A.
  [[nodiscard]] double LogDeterminant() const;

 private:
  Cholesky(std::vector<double> lower, std::size_t n) : lower_(std::move(lower)), n_(n) {}
  std::vector<double> lower_;  // row-major; the diagonal holds 1 / L_ii
  std::size_t n_ = 0;
};

/// Sum of products, in four interleaved sums so that it does not wait for each addition.
double Dot(const double* a, const double* b, std::size_t n);

}  // namespace focalfleet
