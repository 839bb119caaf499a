#include "sim/campaigns/diagnosis/unit_scorer.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace focalfleet::sim {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Removes the mean of errors that add up. They are mostly a zero, one for all moves, which geometry
// has anyway. With it little of the signature would seem to be its own.
void TakeOffZeros(PoseErrors* errors) {
  for (std::vector<double>& angle : errors->angle_deg) {
    const double sum = std::accumulate(angle.begin(), angle.end(), 0.0);
    for (double& error : angle) error -= sum / static_cast<double>(angle.size());
  }
}

}  // namespace

std::vector<Block> PlaceInLanes(const Templates& templates) {
  std::vector<Block> blocks;
  for (const bool single : {true, false}) {
    std::size_t used = kLanes;
    for (std::size_t k = 0; k < templates.size(); ++k) {
      const std::size_t c = templates[k].columns;
      if ((c == 1) != single) continue;
      if (used + c > kLanes) blocks.push_back({{}, single}), used = 0;
      blocks.back().forms.push_back({k, used});
      used += c;
    }
  }
  return blocks;
}

SharedColumns ListShared(const std::vector<ModelTerm>& terms,
                         std::span<const std::size_t> withouts) {
  SharedColumns shared;
  for (const ModelTerm& term : terms) {
    const bool own = term.sharing == Sharing::kUnit;
    shared.begin_of_term.push_back(own ? SharedColumns::kNone : shared.count);
    if (!own) shared.count += static_cast<Index>(term.form.columns);
  }
  for (const std::size_t without : withouts) {
    std::vector<Index>& columns = shared.of_look.emplace_back();
    for (std::size_t t = 0; t < terms.size(); ++t) {
      if (t == without || shared.begin_of_term[t] == SharedColumns::kNone) continue;
      for (std::size_t c = 0; c < terms[t].form.columns; ++c)
        columns.push_back(shared.begin_of_term[t] + static_cast<Index>(c));
    }
  }
  return shared;
}

UnitScorer::UnitScorer(const Fit& fit, std::size_t unit, std::span<const std::size_t> withouts,
                       const SharedColumns& shared)
    : fit_(fit), unit_(unit), white_(Whiten(fit, unit)) {
  const std::size_t terms = fit.model.terms.size();
  shared_ = MatrixXd::Zero(white_.y.size(), shared.count);
  own_.resize(terms);
  for (std::size_t t = 0; t < terms; ++t) MakeColumns(t, shared.begin_of_term[t]);
  MakeHomings();
  std::vector<std::size_t> plane_of(terms + 1, kNoTerm);
  for (const std::size_t without : withouts) {
    const bool own = without != kNoTerm && own_[without].cols() > 0;
    std::size_t& plane = plane_of[own ? without : terms];
    if (plane == kNoTerm) plane = planes_.size(), planes_.push_back(PlaneWithout(without));
    looks_.push_back(LookWithout(without, plane));
  }
}

bool UnitScorer::usable() const {
  return std::any_of(looks_.begin(), looks_.end(),
                     [](const UnitLook& look) { return look.usable; });
}

void UnitScorer::MakeSignatures(const Templates& templates, const Block& block,
                                std::vector<Lanes>* rows) {
  std::fill(rows->begin(), rows->end(), Lanes{});
  for (const Placed& placed : block.forms) {
    const Template& form = templates[placed.form];
    for (std::size_t c = 0; c < form.columns; ++c) {
      ApplyColumn(white_.track, form, c, 1, &errors_);
      if (form.memory == Memory::kChain) TakeOffZeros(&errors_);
      PutDisplacement(white_, errors_, placed.lane + c, rows->data());
    }
  }
  WhitenLanes(white_, rows->data());
}

void UnitScorer::MakeColumns(std::size_t t, Index shared_begin) {
  const ModelTerm& term = fit_.model.terms[t];
  const std::span<const double> amplitude = term.AmplitudeOf(unit_);
  if (amplitude.empty()) return;
  const bool plain = term.sharing == Sharing::kFleet || term.sharing == Sharing::kUnit;
  const auto c = static_cast<Index>(term.form.columns);
  MatrixXd columns(white_.y.size(), c);
  for (Index k = 0; k < c; ++k) {
    const auto at = static_cast<std::size_t>(k);
    ApplyColumn(white_.track, term.form, at, plain ? 1 : amplitude[at], &errors_);
    WhiteDisplacement(white_, errors_, columns.col(k).data());
  }
  if (shared_begin == SharedColumns::kNone)
    own_[t] = std::move(columns);
  else
    shared_.middleCols(shared_begin, c) = columns;
}

void UnitScorer::MakeHomings() {
  const std::vector<Homing> homings = FreeHomingsOf(fit_.model, white_.track);
  homings_.resize(white_.y.size(), static_cast<Index>(homings.size()));
  for (std::size_t h = 0; h < homings.size(); ++h) {
    ApplyHoming(white_.track, homings[h], &errors_);
    WhiteDisplacement(white_, errors_, homings_.col(static_cast<Index>(h)).data());
  }
}

UnitScorer::Plane UnitScorer::PlaneWithout(std::size_t without) const {
  Plane plane{Basis(white_.y.size()), shared_};
  for (Index c = 0; c < white_.geometry.cols(); ++c) plane.basis.Add(white_.geometry.col(c));
  for (std::size_t t = 0; t < own_.size(); ++t)
    for (Index c = 0; t != without && c < own_[t].cols(); ++c) plane.basis.Add(own_[t].col(c));
  for (Index c = 0; c < homings_.cols(); ++c) plane.basis.Add(homings_.col(c));
  plane.basis.Remove(&plane.shared);
  return plane;
}

UnitScorer::UnitLook UnitScorer::LookWithout(std::size_t without, std::size_t plane) {
  UnitLook look{plane, white_.y, VectorXd::Zero(white_.y.size())};
  if (without != kNoTerm) {
    const ModelTerm& term = fit_.model.terms[without];
    const std::span<const double> amplitude = term.AmplitudeOf(unit_);
    if (!amplitude.empty()) {
      errors_.Reset(white_.track.moves);
      AddErrors(white_.track, term.form, amplitude, &errors_);
      WhiteDisplacement(white_, errors_, look.target.data());
      look.y += look.target;
    }
  }
  const Basis& basis = planes_[plane].basis;
  look.usable = look.y.size() > basis.size() + 3;
  basis.Remove(&look.y);
  basis.Remove(&look.target);
  return look;
}

}  // namespace focalfleet::sim
