// A library's shape of a cause is never quite the true one. What it leaves of a strong cause looks
// like other causes, and no threshold of chance protects from it: it is there for certain. But it
// is a distortion of that cause: its own amplitude in each unit, a bend where it is large, another
// dependence on the drive. So each weak term is asked what it still explains once the strong ones
// may be distorted. What then disappears is a misfit artefact, whatever it is called.
#pragma once

#include <cstddef>
#include <vector>

#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// What a term of the model still explains.
struct Undistorted {
  /// Of its chi-square, beside distortions of `of` of any size; both with their own noise and
  /// level.
  double kept = 1;
  std::size_t of = kNoTerm;  // the strong term; none: no strong term takes anything
  // Of 200 hidden campaigns true causes beside a strong one kept 0.82 and more.
  [[nodiscard]] bool is_misfit_artefact() const { return kept < 0.6; }
  [[nodiscard]] bool is_doubtful() const { return kept < 0.8; }
};

/// Shape: (terms of the model). Pre: `accepted` belongs to the fit's terms.
std::vector<Undistorted> BesideDistortions(const Fit& fit, const std::vector<Accepted>& accepted);

}  // namespace focalfleet::sim
