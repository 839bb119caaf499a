#include "sim/campaigns/diagnosis/score/unit_scorer.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "sim/campaigns/diagnosis/model/discrepancy.h"

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

SharedColumns ListShared(const CampaignModel& model, std::span<const std::size_t> withouts) {
  SharedColumns shared;
  for (const ModelTerm& term : model.terms) {
    const bool own = term.sharing == Sharing::kUnit;
    shared.begin_of_term.push_back(own ? SharedColumns::kNone : shared.count);
    if (!own) shared.count += static_cast<Index>(term.form.columns);
  }
  shared.precision.assign(static_cast<std::size_t>(shared.count), 0);
  shared.value = shared.precision;
  for (const Discrepancy& of : model.discrepancies) {
    shared.begin_of_discrepancy.push_back(shared.count);
    shared.count += static_cast<Index>(of.common.size());
    for (const double value : of.common) {
      shared.precision.push_back(1 / (of.spread * of.spread));
      shared.value.push_back(value);
    }
  }
  shared.begin_of_frames = shared.count;
  for (std::size_t frame = 1; frame < model.frames.size(); ++frame)
    for (std::size_t k = 0; k < kExposureParameters; ++k, ++shared.count) {
      shared.precision.push_back(1 / (kFrameSpread[k] * kFrameSpread[k]));
      shared.value.push_back(model.frames[frame][k]);
    }
  for (const std::size_t without : withouts) {
    std::vector<Index>& columns = shared.of_look.emplace_back();
    for (std::size_t t = 0; t < model.terms.size(); ++t) {
      if (t == without || shared.begin_of_term[t] == SharedColumns::kNone) continue;
      for (std::size_t c = 0; c < model.terms[t].form.columns; ++c)
        columns.push_back(shared.begin_of_term[t] + static_cast<Index>(c));
    }
    for (std::size_t k = 0; k < model.discrepancies.size(); ++k)
      for (std::size_t d = 0;
           model.discrepancies[k].of != without && d < model.discrepancies[k].common.size(); ++d)
        columns.push_back(shared.begin_of_discrepancy[k] + static_cast<Index>(d));
    for (Index column = shared.begin_of_frames; column < shared.count; ++column)
      columns.push_back(column);
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
  MakeDistorted(shared);
  MakeHomings();
  MakeFrames(shared.begin_of_frames);
  std::vector<std::size_t> plane_of(terms + 1, kNoTerm);
  for (const std::size_t without : withouts) {
    const bool own = without != kNoTerm && (own_[without].cols() > 0 || HasOwnDistorted(without));
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
  WhitenLanes(white_.filter, white_.turn_um.data(), rows->data(), rows->data());
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

void UnitScorer::MakeDistorted(const SharedColumns& shared) {
  const std::vector<Discrepancy>& discrepancies = fit_.model.discrepancies;
  distorted_.resize(discrepancies.size());
  for (std::size_t k = 0; k < discrepancies.size(); ++k) {
    const Discrepancy& of = discrepancies[k];
    if (!of.HasUnit(unit_)) continue;
    DistortionColumns(white_, of, &distorted_[k]);
    const auto common = static_cast<Index>(of.common.size());
    shared_.middleCols(shared.begin_of_discrepancy[k], common) = distorted_[k].rightCols(common);
  }
}

void UnitScorer::MakeHomings() {
  const std::vector<Homing> homings = FreeHomingsOf(fit_.model, white_.track);
  homings_.resize(white_.y.size(), static_cast<Index>(homings.size()));
  for (std::size_t h = 0; h < homings.size(); ++h) {
    ApplyHoming(white_.track, homings[h], &errors_);
    WhiteDisplacement(white_, errors_, homings_.col(static_cast<Index>(h)).data());
  }
}

void UnitScorer::MakeFrames(Index begin) {
  for (std::size_t frame = 1; frame < fit_.model.frames.size(); ++frame)
    for (std::size_t k = 0; k < kExposureParameters; ++k, ++begin)
      if (ApplyFrame(white_.track, frame, k, &errors_))
        WhiteDisplacement(white_, errors_, shared_.col(begin).data());
}

UnitScorer::Plane UnitScorer::PlaneWithout(std::size_t without) const {
  Plane plane{.basis = Basis(white_.y.size()), .parts = {}, .shared = shared_};
  for (Index c = 0; c < white_.geometry.cols(); ++c) plane.basis.Add(white_.geometry.col(c));
  for (std::size_t t = 0; t < own_.size(); ++t)
    for (Index c = 0; t != without && c < own_[t].cols(); ++c) plane.basis.Add(own_[t].col(c));
  for (Index c = 0; c < homings_.cols(); ++c) plane.basis.Add(homings_.col(c));
  plane.parts.assign(static_cast<std::size_t>(plane.basis.size()), 1);
  plane.spent = static_cast<double>(plane.basis.size());
  AddDistorted(without, &plane);
  plane.Remove(&plane.shared);
  return plane;
}

void UnitScorer::AddDistorted(std::size_t without, Plane* plane) const {
  // The prior's squared length in units of the noise. A direction with less is left out, for time:
  // evidence along it is then too large by that share at most. Half and double of it change no
  // verdict (docs/diagnosis.md, Discrepancy).
  constexpr double kWorthwhile = 0.02;
  MatrixXd columns(white_.y.size(), 0);
  for (std::size_t k = 0; k < distorted_.size(); ++k) {
    if (k == without || !HasOwnDistorted(k)) continue;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + distorted_[k].cols());
    columns.rightCols(distorted_[k].cols()) = distorted_[k] * fit_.model.discrepancies[k].spread;
  }
  if (columns.cols() == 0) return;
  plane->basis.Remove(&columns);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(columns.transpose() * columns);
  for (Index k = 0; k < columns.cols(); ++k) {
    const double square = solver.eigenvalues()[k];
    if (!(square > kWorthwhile)) continue;
    const Index before = plane->basis.size();
    plane->basis.Add(columns * solver.eigenvectors().col(k));
    if (plane->basis.size() == before) continue;
    plane->parts.push_back(1 - 1 / std::sqrt(1 + square));
    plane->spent += square / (1 + square);
  }
}

// Own distortions are marginalised in the plane: the data have all of them. The left-out term's
// are gone with it, the common ones too.
void UnitScorer::AddBackDistorted(std::size_t without, VectorXd* y) const {
  for (std::size_t k = 0; k < distorted_.size(); ++k) {
    const Discrepancy& of = fit_.model.discrepancies[k];
    if (!of.HasUnit(unit_)) continue;
    if (k == without) {
      const std::vector<double> amplitude = of.AmplitudeOf(unit_);
      *y += distorted_[k] *
            Eigen::Map<const VectorXd>(amplitude.data(), static_cast<Index>(amplitude.size()));
    } else if (HasOwnDistorted(k)) {
      *y +=
          distorted_[k] * Eigen::Map<const VectorXd>(of.own.data() + unit_ * of.distortions.size(),
                                                     static_cast<Index>(of.distortions.size()));
    }
  }
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
  AddBackDistorted(without, &look.y);
  look.usable = static_cast<double>(look.y.size()) > planes_[plane].spent + 3;
  planes_[plane].Remove(&look.y);
  planes_[plane].Remove(&look.target);
  return look;
}

}  // namespace focalfleet::sim
