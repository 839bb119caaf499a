#include "sim/campaigns/diagnosis/score/score.h"

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/model/lanes.h"
#include "sim/campaigns/diagnosis/model/neighbour_sum.h"
#include "sim/campaigns/diagnosis/score/fleet_sums.h"
#include "sim/campaigns/diagnosis/score/unit_scorer.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeverageMax = 0.5;  // of a signature in one row: an outlier looks the same
constexpr double kKeptOfSignatureMin = 0.01;  // of a unit's signature beside its geometry

// Buffers for one block of one unit.
struct Scratch {
  std::vector<Lanes> raw, m;          // Shape: (2 moves): before and after the projection
  std::vector<Lanes> gg, by;          // Shape: (moves): products of m with itself and with the data
  std::vector<Lanes> parts;           // along a plane's columns
  std::vector<double> products;       // of several columns with each other. Shape: (moves, c, c)
  std::vector<std::size_t> exposure;  // of the chunk's. Shape: (moves)
};

// Products of a template's columns with each other, move by move. Shape: (moves, c, c).
void MultiplyColumns(const std::vector<Lanes>& m, const Placed& placed, std::size_t columns,
                     std::vector<double>* products) {
  products->resize(m.size() / 2 * columns * columns);
  double* product = products->data();
  for (const Lanes *x = m.data(), *end = x + m.size(); x != end; x += 2)
    for (std::size_t p = placed.lane; p < placed.lane + columns; ++p)
      for (std::size_t q = placed.lane; q < placed.lane + columns; ++q)
        *product++ = x[0].at[p] * x[0].at[q] + x[1].at[p] * x[1].at[q];
}

// The same as SumAlikeNeighbours, in units of g. `by`: the columns' products with the data.
template <int kSize>
double SpreadOf(const std::vector<double>& products, const std::vector<Lanes>& by,
                const Placed& placed, const MatrixXd& g, const VectorXd& b) {
  using Sum = NeighbourSum<kSize>;
  using Small = typename Sum::Small;
  using Square = typename Sum::Square;
  const Index c = g.rows();
  const Square inverse = g.ldlt().solve(Square::Identity(c, c));
  const Small own = inverse * b;
  Sum sum(inverse);
  Small row(c);
  const double* product = products.data();
  for (const Lanes& of_move : by) {
    row = Eigen::Map<const Small>(of_move.at + placed.lane, c);
    row.noalias() -= Eigen::Map<const Square>(product, c, c) * own;
    sum.Add(row);
    product += c * c;
  }
  return sum.sum();
}

// Dispersion of the moves' scores about the unit's own fit, 1 for noise as modelled. Noise with
// memory makes more of it.
void AddSpread(double sum, Index values, double spent, std::size_t columns, TemplateSums* part) {
  const auto n = static_cast<double>(values);
  const double free = n - spent - static_cast<double>(columns);
  if (free < 4 || !std::isfinite(sum)) return;
  part->spread_sum += sum * n / free;
  part->spread_count += static_cast<double>(columns);
}

void AddExposureProducts(const std::vector<double>& products,
                         const std::vector<std::size_t>& exposure, std::size_t size,
                         std::vector<double>* sums) {
  const double* product = products.data();
  for (const std::size_t e : exposure) {
    double* sum = sums->data() + e * size;
    for (std::size_t i = 0; i < size; ++i) sum[i] += *product++;
  }
}

// Scores a unit in the lanes of one block after the other.
class BlockScorer {
 public:
  BlockScorer(const PassPlan& plan, std::size_t unit, UnitScorer* scorer, Scratch* scratch,
              FleetSums* part)
      : plan_(plan), unit_(unit), scorer_(*scorer), scratch_(*scratch), part_(*part) {
    moves_ = scorer_.white().moves.size();
    scratch_.raw.resize(2 * moves_), scratch_.m.resize(2 * moves_);
    scratch_.gg.resize(moves_), scratch_.by.resize(moves_);
    scratch_.exposure.clear();
    const std::vector<std::size_t>& known = part_.exposures;
    for (const std::size_t move : scorer_.white().moves) {
      const std::size_t row = scorer_.white().track.first_row + move;
      const auto at =
          std::lower_bound(known.begin(), known.end(), plan.fit.facts->exposures.of_row[row]);
      scratch_.exposure.push_back(static_cast<std::size_t>(at - known.begin()));
    }
  }

  void Score(std::size_t block, std::vector<ScorePass>* passes) {
    block_ = block;
    scorer_.MakeSignatures(plan_.templates, plan_.blocks[block], &scratch_.raw);
    whole_ = SquareLanes(scratch_.raw.data(), 2 * moves_);
    for (std::size_t p = 0; p < scorer_.planes().size(); ++p) {
      Project(scorer_.planes()[p]);
      for (std::size_t l = 0; l < scorer_.looks().size(); ++l) {
        const UnitScorer::UnitLook& look = scorer_.looks()[l];
        if (look.plane != p || !look.usable) continue;
        AddLengths(&part_.looks[l]);
        AddShared(plan_.shared.of_look[l], &part_.looks[l]);
        TakeLook(look, &(*passes)[l], &part_.looks[l]);
      }
    }
  }

 private:
  // Removes what the plane absorbs. Lanes are emptied whose rest is only rounding.
  void Project(const UnitScorer::Plane& plane) {
    const MatrixXd& columns = plane.basis.columns();
    scratch_.parts.resize(static_cast<std::size_t>(columns.cols()));
    MultiplyLanes(columns, scratch_.raw.data(), scratch_.parts.data());
    LeaveOutShifts();
    for (std::size_t k = 0; k < scratch_.parts.size(); ++k)
      if (plane.parts[k] < 1)
        for (double& part : scratch_.parts[k].at) part *= plane.parts[k];
    SubtractColumns(columns, scratch_.parts.data(), scratch_.raw.data(), scratch_.m.data());
    spent_ = plane.spent;
    const OwnProducts own = MultiplyByThemselves(scratch_.m.data(), moves_, scratch_.gg.data());
    kept_ = own.sum;
    says_.clear();
    Lanes mask;
    for (const Placed& placed : plan_.blocks[block_].forms) {
      says_.push_back(SaysSomething(placed, own));
      if (!says_.back()) continue;
      for (std::size_t c = 0; c < plan_.templates[placed.form].columns; ++c)
        mask.at[placed.lane + c] = 1;
    }
    if (std::find(says_.begin(), says_.end(), false) != says_.end()) Empty(mask);
    shared_cross_.resize(static_cast<std::size_t>(plane.shared.cols()));
    MultiplyLanes(plane.shared, scratch_.m.data(), shared_cross_.data());
  }

  // A bend of the plate or its image shifts each unit far more than it bends what the unit sees.
  // The shift belongs to the unit's base. The first two columns of the basis are those of the base.
  void LeaveOutShifts() {
    constexpr double kRounding = 1e-9;  // of a signature that is all shift
    raw_ = whole_;
    for (const Placed& placed : plan_.blocks[block_].forms) {
      const Template& form = plan_.templates[placed.form];
      const Owner owner = form.effect->owner;
      if (owner != Owner::kPlate && owner != Owner::kCamera) continue;
      for (std::size_t lane = placed.lane; lane < placed.lane + form.columns; ++lane)
        for (std::size_t base = 0; base < std::min<std::size_t>(2, scratch_.parts.size()); ++base)
          raw_.at[lane] -= scratch_.parts[base].at[lane] * scratch_.parts[base].at[lane];
      for (std::size_t lane = placed.lane; lane < placed.lane + form.columns; ++lane)
        raw_.at[lane] = std::max(raw_.at[lane], kRounding * whole_.at[lane]);
    }
  }

  [[nodiscard]] bool SaysSomething(const Placed& placed, const OwnProducts& own) const {
    const std::size_t c = plan_.templates[placed.form].columns;
    double raw = 0, kept = 0;
    for (std::size_t lane = placed.lane; lane < placed.lane + c; ++lane)
      raw += raw_.at[lane], kept += kept_.at[lane];
    // Less than this is what the unit's geometry explains as well, and large amplitudes of it.
    if (!(kept > kKeptOfSignatureMin * raw)) return false;
    return c > 1 || own.most.at[placed.lane] / kept <= kLeverageMax;
  }

  void Empty(const Lanes& mask) {
    for (std::vector<Lanes>* rows : {&scratch_.m, &scratch_.gg})
      for (Lanes& row : *rows)
        for (std::size_t j = 0; j < kLanes; ++j) row.at[j] = mask.at[j] > 0 ? row.at[j] : 0;
  }

  void AddLengths(LookSums* part) const {
    for (std::size_t i = 0; i < says_.size(); ++i) {
      const Placed& placed = plan_.blocks[block_].forms[i];
      TemplateSums& fleet = part->of_template[placed.form];
      for (std::size_t c = 0; c < plan_.templates[placed.form].columns; ++c) {
        fleet.raw += raw_.at[placed.lane + c];
        if (says_[i]) fleet.kept += kept_.at[placed.lane + c];
      }
    }
  }

  void AddShared(const std::vector<Index>& columns, LookSums* part) const {
    Lanes* sums = part->shared_cross.data() + block_ * columns.size();
    for (const Index column : columns)
      AddLanes(shared_cross_[static_cast<std::size_t>(column)], sums++);
  }

  void TakeLook(const UnitScorer::UnitLook& look, ScorePass* pass, LookSums* part) {
    const std::size_t exposures = part_.exposures.size();
    const Lanes b = MultiplyByData(scratch_.m.data(), look.y, scratch_.by.data());
    AddLanesAt(scratch_.by.data(), scratch_.exposure, &part->exposure_b[block_ * exposures]);
    Lanes target_b;
    MultiplyLanes(look.target, scratch_.m.data(), &target_b);
    const Block& block = plan_.blocks[block_];
    if (block.single) {
      AddLanesAt(scratch_.gg.data(), scratch_.exposure, &part->exposure_g[block_ * exposures]);
      TakeSingles(look, b, part);
    }
    for (std::size_t i = 0; i < block.forms.size(); ++i) {
      if (!says_[i]) continue;
      const Placed& placed = block.forms[i];
      const std::size_t c = plan_.templates[placed.form].columns;
      sim::Score& score = pass->scores[placed.form];
      for (std::size_t k = 0; k < c; ++k) {
        score.b[unit_ * c + k] = b.at[placed.lane + k];
        score.target_b[unit_ * c + k] = target_b.at[placed.lane + k];
      }
      if (c == 1)
        score.g[unit_] = kept_.at[placed.lane];
      else
        TakeSeveral(placed, look, &score, &part->of_template[placed.form]);
    }
  }

  void TakeSingles(const UnitScorer::UnitLook& look, const Lanes& b, LookSums* part) {
    Lanes own;
    const std::vector<Placed>& forms = plan_.blocks[block_].forms;
    for (std::size_t i = 0; i < forms.size(); ++i)
      if (says_[i]) own.at[i] = b.at[i] / kept_.at[i];
    const Lanes sums = SumAlikeNeighbours(scratch_.by.data(), scratch_.gg.data(), own, moves_);
    for (std::size_t i = 0; i < forms.size(); ++i)
      if (says_[i])
        AddSpread(sums.at[i] / kept_.at[i], look.y.size(), spent_, 1,
                  &part->of_template[forms[i].form]);
  }

  void TakeSeveral(const Placed& placed, const UnitScorer::UnitLook& look, sim::Score* score,
                   TemplateSums* fleet) {
    const std::size_t c = plan_.templates[placed.form].columns;
    const auto ic = static_cast<Index>(c);
    std::vector<double>& products = scratch_.products;
    MultiplyColumns(scratch_.m, placed, c, &products);
    MatrixXd g = MatrixXd::Zero(ic, ic);
    for (std::size_t k = 0; k < moves_; ++k)
      for (std::size_t i = 0; i < c * c; ++i) g.data()[i] += products.data()[k * c * c + i];
    std::copy_n(g.data(), c * c, score->g.data() + unit_ * c * c);
    const VectorXd b = Eigen::Map<const VectorXd>(score->b.data() + unit_ * c, ic);
    AddExposureProducts(products, scratch_.exposure, c * c, &fleet->exposure_g);
    const double sum = c == 2 ? SpreadOf<2>(products, scratch_.by, placed, g, b)
                              : SpreadOf<Eigen::Dynamic>(products, scratch_.by, placed, g, b);
    AddSpread(sum, look.y.size(), spent_, c, fleet);
  }

  const PassPlan& plan_;
  std::size_t unit_;
  UnitScorer& scorer_;
  Scratch& scratch_;
  FleetSums& part_;
  std::size_t moves_ = 0;
  // The present block and plane.
  std::size_t block_ = 0;
  Lanes whole_, raw_, kept_;  // squared lengths
  double spent_ = 0;
  std::vector<bool> says_;  // Shape: (templates of the block)
  std::vector<Lanes> shared_cross_;
};

void AddUnit(const UnitScorer& scorer, const SharedColumns& shared, FleetSums* part) {
  for (std::size_t l = 0; l < scorer.looks().size(); ++l) {
    const UnitScorer::UnitLook& look = scorer.looks()[l];
    if (!look.usable) continue;
    LookSums& sums = part->looks[l];
    sums.residual_square += look.y.squaredNorm();
    sums.target_square += look.target.squaredNorm();
    sums.values += static_cast<std::size_t>(look.y.size());
    const MatrixXd beside = scorer.planes()[look.plane].shared(Eigen::all, shared.of_look[l]);
    sums.shared_g.noalias() += beside.transpose() * beside;
    sums.shared_b.noalias() += beside.transpose() * look.y;
    sums.shared_target_b.noalias() += beside.transpose() * look.target;
  }
}

void ScoreUnit(const PassPlan& plan, std::size_t unit, Scratch* scratch,
               std::vector<ScorePass>* passes, FleetSums* part) {
  if (!plan.fit.UsesUnit(unit)) return;
  UnitScorer scorer(plan.fit, unit, plan.withouts, plan.shared);
  if (!scorer.usable()) return;
  AddUnit(scorer, plan.shared, part);
  BlockScorer blocks(plan, unit, &scorer, scratch, part);
  for (std::size_t block = 0; block < plan.blocks.size(); ++block) blocks.Score(block, passes);
}

// The lanes of one template, as numbers one after the other.
std::vector<double> OutOfLanes(const Lanes* rows, std::size_t count, const Placed& placed,
                               std::size_t columns) {
  std::vector<double> values;
  values.reserve(count * columns);
  for (std::size_t r = 0; r < count; ++r)
    for (std::size_t c = 0; c < columns; ++c) values.push_back(rows[r].at[placed.lane + c]);
  return values;
}

void SumUnits(Index c, Score* score) {
  score->fleet_b = VectorXd::Zero(c);
  score->fleet_target_b = VectorXd::Zero(c);
  score->fleet_g = MatrixXd::Zero(c, c);
  const auto units = static_cast<Index>(score->b.size()) / c;
  for (Index u = 0; u < units; ++u) {
    score->fleet_b += Eigen::Map<const VectorXd>(score->b.data() + u * c, c);
    score->fleet_target_b += Eigen::Map<const VectorXd>(score->target_b.data() + u * c, c);
    score->fleet_g += Eigen::Map<const MatrixXd>(score->g.data() + u * c * c, c, c);
  }
}

void TakeFleet(const PassPlan& plan, std::size_t look, const LookSums& all, ScorePass* pass) {
  const std::size_t exposures = plan.fit.facts->exposures.size();
  const Index shared = all.shared_g.rows();
  MatrixXd normal = shared > 0 ? all.shared_g : MatrixXd::Identity(1, 1);
  VectorXd right = all.shared_b;
  for (Index k = 0; k < shared; ++k) {
    const auto column =
        static_cast<std::size_t>(plan.shared.of_look[look][static_cast<std::size_t>(k)]);
    normal(k, k) += plan.shared.precision[column];
    right[k] -= plan.shared.precision[column] * plan.shared.value[column];
  }
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver(normal);
  const auto take = [&](std::size_t block, const Placed& placed) {
    Score& score = pass->scores[placed.form];
    const TemplateSums& part = all.of_template[placed.form];
    const std::size_t columns = plan.templates[placed.form].columns;
    const auto c = static_cast<Index>(columns);
    score.exposure_b = OutOfLanes(&all.exposure_b[block * exposures], exposures, placed, columns);
    score.exposure_g = columns > 1
                           ? part.exposure_g
                           : OutOfLanes(&all.exposure_g[block * exposures], exposures, placed, 1);
    score.raw = part.raw, score.kept = part.kept;
    score.spread_sum = part.spread_sum, score.spread_count = part.spread_count;
    SumUnits(c, &score);
    if (shared == 0) return;
    const double own = score.fleet_g.trace();
    const std::vector<double> crossed =
        OutOfLanes(all.shared_cross.data() + block * static_cast<std::size_t>(shared),
                   static_cast<std::size_t>(shared), placed, columns);
    const MatrixXd cross = Eigen::Map<const MatrixXd>(crossed.data(), c, shared).transpose();
    const MatrixXd gone = solver.solve(cross);
    score.fleet_b -= gone.transpose() * right;
    score.fleet_target_b -= gone.transpose() * all.shared_target_b;
    score.fleet_g -= cross.transpose() * gone;
    // A template that the model has already gives only rounding.
    if (score.fleet_g.trace() > kKeptOfSignatureMin * own) return;
    score.fleet_b.setZero();
    score.fleet_target_b.setZero();
    score.fleet_g.setZero();
  };
  for (std::size_t block = 0; block < plan.blocks.size(); ++block)
    for (const Placed& placed : plan.blocks[block].forms) take(block, placed);
  pass->target_square = all.target_square;
  pass->residual_square = all.residual_square;
  pass->values = all.values;
}

ScorePass EmptyPass(const Templates& templates, std::size_t units) {
  ScorePass pass;
  pass.scores.resize(templates.size());
  for (std::size_t k = 0; k < templates.size(); ++k) {
    const std::size_t c = templates[k].columns;
    pass.scores[k].b.assign(units * c, 0);
    pass.scores[k].target_b.assign(units * c, 0);
    pass.scores[k].g.assign(units * c * c, 0);
  }
  return pass;
}

}  // namespace

OwnFit FitOwn(const Score& score, std::size_t columns, std::size_t unit) {
  constexpr int kMost = static_cast<int>(kColumnsMax);  // there may be thousands: without heap
  using Small = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;
  const auto c = static_cast<Index>(columns);
  const Eigen::Map<const Small> b(score.b.data() + unit * columns, c);
  const Eigen::Map<const Square> g(score.g.data() + unit * columns * columns, c, c);
  if (!(g.trace() > 0)) return {};
  const Eigen::CompleteOrthogonalDecomposition<Square> solver(g);
  const Small amplitude = solver.solve(b);
  return {b.dot(amplitude), static_cast<double>(solver.rank())};
}

bool IsImpossible(const Template& form, const Eigen::Ref<const VectorXd>& b,
                  const Eigen::Ref<const MatrixXd>& g) {
  constexpr double kSigmas = 3;
  if (!(g.trace() > 0)) return false;
  if (b.size() == 1) return !CanBe(form, b[0] / g(0, 0), kSigmas / std::sqrt(g(0, 0)));
  const double size = std::sqrt(std::max(b.dot(g.ldlt().solve(b)) / g.trace(), 0.0) *
                                static_cast<double>(b.size()));
  return size > RangeOfAmplitude(*form.effect).high +
                    kSigmas * std::sqrt(static_cast<double>(b.size()) / g.trace());
}

std::vector<ScorePass> ScoreWithouts(const Fit& fit, const Templates& templates,
                                     std::span<const std::size_t> withouts) {
  const std::size_t units = fit.model.units.size();
  const PassPlan plan{fit, templates, withouts, PlaceInLanes(templates),
                      ListShared(fit.model, withouts)};
  std::vector<ScorePass> passes(withouts.size(), EmptyPass(templates, units));
  FleetSums all = EmptySums(plan, {0, units});
  // Chunks run a few at a time, because the sums of each may be as large as a pass.
  constexpr std::size_t kAtOnce = 8;
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  for (std::size_t begin = 0; begin < chunks.size(); begin += kAtOnce) {
    std::vector<FleetSums> parts(std::min(kAtOnce, chunks.size() - begin));
    fit.parallel(parts.size(), [&](std::size_t k) {
      const UnitChunk& chunk = chunks[begin + k];
      parts[k] = EmptySums(plan, chunk);
      Scratch scratch;
      for (std::size_t unit = chunk.begin; unit < chunk.end; ++unit)
        ScoreUnit(plan, unit, &scratch, &passes, &parts[k]);
    });
    for (const FleetSums& part : parts) AddSums(plan, part, &all);
  }
  for (std::size_t l = 0; l < passes.size(); ++l) TakeFleet(plan, l, all.looks[l], &passes[l]);
  return passes;
}

ScorePass ScoreTemplates(const Fit& fit, const Templates& templates, std::size_t without) {
  return std::move(ScoreWithouts(fit, templates, std::span(&without, 1)).front());
}

}  // namespace focalfleet::sim
