// A library's shape of a cause is never quite the true one. The misfit of a strong cause looks like
// other causes, and no threshold of chance protects from it, because the misfit is certain. The
// misfit is, however, a distortion of that cause. The cause has its own amplitude in each unit,
// bends where it is large, or depends on the drive in another way. Each weak term is therefore
// fitted beside distortions of the strong ones. A term that then explains nothing is a misfit
// artefact, whatever its name.
#pragma once

#include <cstddef>
#include <vector>

#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// The part that a term of the model still explains.
struct Undistorted {
  /// Share of its chi-square that is left beside distortions of `of` of any size, with their own
  /// noise and level.
  double kept = 1;
  std::size_t of = kNoTerm;  // the strong term; kNoTerm: no strong term takes anything
  // In 200 hidden campaigns true causes beside a strong one kept 0.82 and more.
  [[nodiscard]] bool is_misfit_artefact() const { return kept < 0.6; }
  [[nodiscard]] bool is_doubtful() const { return kept < 0.8; }
};

/// The undistorted part of each term. Shape: (terms of the model). Pre: `accepted` belongs to the
/// fit's terms.
std::vector<Undistorted> BesideDistortions(const Fit& fit, const std::vector<Accepted>& accepted);

}  // namespace focalfleet::sim
