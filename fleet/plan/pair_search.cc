#include "fleet/plan/pair_search.h"

#include <algorithm>
#include <cmath>

namespace focalfleet {
namespace {

/// Between two poses of a step the arms may be nearer than at both; away from start and target they
/// keep this share of their distance more.
constexpr std::array kMarginShares{0.06, 0.0};
constexpr std::int32_t kPairTightSteps = 1;  // so near to both starts, or both targets, no margin
constexpr std::uint64_t kWordsPerColumn = 200;  // that cost as much as one column of distances
constexpr std::uint64_t kWordsPerLook = 5;      // at a pose before, while a way is read
constexpr std::uint64_t kWordsPerTest = 150;    // of a step
constexpr int kTestsMost = 20'000;              // of steps, while a way is read
constexpr int kLooksMost = 400'000;

bool IsTight(const GridPose& a, const GridPose& b) {
  return PoseGrid::StepsBetween(a, b) <= kPairTightSteps;
}

}  // namespace

/// The poses that unit m can have at each step, whatever the other does. False: there are none.
bool PairSearch::FindLiving(std::size_t m, std::int32_t end_step) {
  const PoseGrid& grid = grid_[m];
  const std::size_t n = grid.words();
  std::vector<std::uint64_t>& living = living_[m];
  living.assign(static_cast<std::size_t>(end_step + 1) * n, 0);
  std::vector<std::uint64_t> scratch(n, 0);
  std::vector<std::uint64_t> here(n, 0);
  std::vector<std::uint64_t> next(n, 0);
  const auto set = [&](std::int32_t k) { return living.data() + static_cast<std::size_t>(k) * n; };
  set(0)[grid.WordOf(grid.from())] = PoseGrid::BitOf(grid.from());
  work_ += static_cast<std::uint64_t>(2 * end_step) * n;
  for (std::int32_t k = 0; k < end_step; ++k) {
    const std::uint64_t* free = free_[m].In(k);
    for (std::size_t i = 0; i < n; ++i) here[i] = set(k)[i] & free[i];
    if (q_.units[m].MayMove(k)) {
      grid.Spread(here.data(), scratch.data(), next.data());
      std::swap(here, next);
    }
    for (std::size_t i = 0; i < n; ++i) set(k + 1)[i] = here[i] & free[i];
  }
  if (!grid.Has(set(end_step), grid.to())) return false;
  std::fill_n(set(end_step), n, 0);
  set(end_step)[grid.WordOf(grid.to())] = PoseGrid::BitOf(grid.to());
  for (std::int32_t k = end_step; k > 0; --k) {
    const std::uint64_t* free = free_[m].In(k - 1);
    for (std::size_t i = 0; i < n; ++i) here[i] = set(k)[i] & free[i];
    if (q_.units[m].MayMove(k - 1)) {
      grid.Spread(here.data(), scratch.data(), next.data());
      std::swap(here, next);
    }
    for (std::size_t i = 0; i < n; ++i) set(k - 1)[i] &= here[i] & free[i];
  }
  return grid.Has(set(0), grid.from());
}

bool PairSearch::IsSamePair(const Question& question) const {
  if (question.need_mm != q_.need_mm) return false;
  for (std::size_t m = 0; m < 2; ++m) {
    const StepQuestion& a = question.units[m];
    const StepQuestion& b = q_.units[m];
    if (a.arm != b.arm || a.drive != b.drive || a.from != b.from || a.to != b.to ||
        a.within != b.within || a.steps.ticks != b.steps.ticks)
      return false;
  }
  return true;
}

double PairSearch::margin_mm() const { return kMarginShares[margin_] * q_.need_mm; }

void PairSearch::SetUpLines() {
  for (std::size_t m = 0; m < 2; ++m) {
    lines_[m].clear();
    for (std::int32_t a = 0; a < grid_[m].count(0); ++a)
      for (std::int32_t b = 0; b < grid_[m].count(1); ++b)
        lines_[m].push_back(q_.units[m].arm->At(grid_[m].At({a, b})));
  }
  for (Apart& apart : apart_) {
    apart.row_of.assign(lines_[0].size(), -1);
    apart.rows.clear();
  }
}

bool PairSearch::IsApart(const GridPose& first, const GridPose& second) const {
  const bool tight = (IsTight(first, grid_[0].from()) && IsTight(second, grid_[1].from())) ||
                     (IsTight(first, grid_[0].to()) && IsTight(second, grid_[1].to()));
  const double need_mm = q_.need_mm + (tight ? 0 : margin_mm());
  const SegmentFp& a = lines_[0][static_cast<std::size_t>(IndexOf(first))];
  const SegmentFp& b =
      lines_[1][static_cast<std::size_t>(second[0] * grid_[1].count(1) + second[1])];
  return SquaredDistance(a, b) > need_mm * need_mm;
}

/// All poses of one theta of the second unit. Spans of phi too far away need one distance.
void PairSearch::TakeColumn(const GridPose& first, std::int32_t theta, std::uint64_t* row) const {
  struct PhiRun {
    std::int32_t low;
    std::int32_t high;
  };
  const PoseGrid& grid = grid_[1];
  const SegmentFp& line = lines_[0][static_cast<std::size_t>(IndexOf(first))];
  std::array<PhiRun, 64> stack;
  std::size_t size = 0;
  stack[size++] = {0, grid.count(1) - 1};
  while (size > 0) {
    const PhiRun span = stack[--size];
    const std::int32_t middle = (span.low + span.high) / 2;
    const std::int32_t half = std::max(middle - span.low, span.high - middle);
    if (half == 0) {
      const GridPose at{theta, middle};
      if (IsApart(first, at)) row[grid.WordOf(at)] |= PoseGrid::BitOf(at);
      continue;
    }
    const SegmentFp& other = lines_[1][static_cast<std::size_t>(theta * grid.count(1) + middle)];
    const std::int32_t vectors =
        std::max(grid.At({theta, span.high})[1] - grid.At({theta, middle})[1],
                 grid.At({theta, middle})[1] - grid.At({theta, span.low})[1]);
    const double travel_mm = q_.units[1].arm->TravelBound(0, vectors);
    const double enough_mm = q_.need_mm + margin_mm() + travel_mm;
    const double distance2 = SquaredDistance(line, other);
    if (distance2 > enough_mm * enough_mm) {
      for (std::int32_t phi = span.low; phi <= span.high; ++phi)
        row[grid.WordOf({theta, phi})] |= PoseGrid::BitOf({theta, phi});
      continue;
    }
    const double never_mm = q_.need_mm - travel_mm;
    if (never_mm > 0 && distance2 < never_mm * never_mm) continue;
    stack[size++] = {span.low, middle};
    stack[size++] = {middle + 1, span.high};
  }
}

/// The poses of the second unit that are apart from this one of the first.
const std::uint64_t* PairSearch::ApartFrom(const GridPose& first) {
  const std::size_t n = grid_[1].words();
  Apart& apart = apart_[margin_];
  std::int32_t& index = apart.row_of[static_cast<std::size_t>(IndexOf(first))];
  if (index < 0) {
    index = static_cast<std::int32_t>(apart.rows.size() / n);
    apart.rows.resize(apart.rows.size() + n, 0);
    std::uint64_t* row = apart.rows.data() + static_cast<std::size_t>(index) * n;
    const ArmGeometry& arm = *q_.units[1].arm;
    const SegmentFp& line = lines_[0][static_cast<std::size_t>(IndexOf(first))];
    const double far_mm = arm.theta_arm_mm() + arm.phi_arm_mm() + q_.need_mm + margin_mm();
    if (SquaredDistance(arm.base_fp(), line) > far_mm * far_mm)
      std::fill_n(row, n, ~std::uint64_t{0});
    else
      for (std::int32_t theta = 0; theta < grid_[1].count(0); ++theta)
        TakeColumn(first, theta, row);
    work_ += kWordsPerColumn * n;
  }
  return apart.rows.data() + static_cast<std::size_t>(index) * n;
}

/// `out`: the rows of all poses within a step of `at`, together.
void PairSearch::JoinNeighbours(const GridPose& at, const std::vector<std::uint64_t>& rows,
                                std::uint64_t* out) const {
  const std::size_t n = grid_[1].words();
  const Layer& layer = layers_.back();
  std::fill_n(out, n, 0);
  for (std::int32_t a = -1; a <= 1; ++a)
    for (std::int32_t b = -1; b <= 1; ++b) {
      const GridPose from{at[0] + a, at[1] + b};
      if (!grid_[0].Contains(from)) continue;
      const std::int32_t index = layer.row_of[static_cast<std::size_t>(IndexOf(from))];
      if (index < 0) continue;
      const std::uint64_t* row = rows.data() + static_cast<std::size_t>(index) * n;
      for (std::size_t i = 0; i < n; ++i) out[i] |= row[i];
    }
}

/// Adds the layer after the last one.
void PairSearch::Step(std::int32_t step) {
  const std::size_t n = grid_[1].words();
  const PoseGrid& second = grid_[1];
  const Layer& here = layers_.back();
  const std::uint64_t* free = free_[1].In(step);
  const bool may_move = q_.units[0].MayMove(step);
  stay_ = here.rows;
  second_goes_.assign(here.rows.size(), 0);
  for (std::int32_t a = 0; a < grid_[0].count(0); ++a)
    for (std::int32_t b = 0; b < grid_[0].count(1); ++b) {
      const std::int32_t index = here.row_of[static_cast<std::size_t>(IndexOf({a, b}))];
      if (index < 0) continue;
      std::uint64_t* stay = stay_.data() + static_cast<std::size_t>(index) * n;
      std::uint64_t* goes = second_goes_.data() + static_cast<std::size_t>(index) * n;
      const bool is_free = grid_[0].Has(free_[0].In(step), {a, b});
      for (std::size_t i = 0; i < n; ++i) stay[i] &= is_free ? free[i] : 0;
      second.Spread(stay, spread_.data(), goes);
      const std::uint64_t* apart = ApartFrom({a, b});
      for (std::size_t i = 0; i < n; ++i) goes[i] &= free[i] & apart[i];
    }
  Layer next;
  next.row_of.assign(here.row_of.size(), -1);
  const std::uint64_t* living = Living(1, step + 1);
  std::size_t rows = 0;
  for (std::int32_t a = 0; a < grid_[0].count(0); ++a)
    for (std::int32_t b = 0; b < grid_[0].count(1); ++b) {
      const GridPose at{a, b};
      if (!grid_[0].Has(Living(0, step + 1), at) || !grid_[0].Has(free_[0].In(step), at)) continue;
      if (!may_move && here.row_of[static_cast<std::size_t>(IndexOf(at))] < 0) continue;
      JoinNeighbours(at, stay_, joined_.data());
      if (std::all_of(joined_.begin(), joined_.end(), [](std::uint64_t w) { return w == 0; }))
        continue;
      work_ += 30 * n;
      const std::uint64_t* apart = ApartFrom(at);
      next.rows.resize((rows + 1) * n);
      std::uint64_t* row = next.rows.data() + rows * n;
      if (may_move) {
        for (std::size_t i = 0; i < n; ++i) joined_[i] &= apart[i];
        second.Spread(joined_.data(), spread_.data(), first_goes_.data());
        JoinNeighbours(at, second_goes_, joined_.data());
        for (std::size_t i = 0; i < n; ++i)
          row[i] = first_goes_[i] & joined_[i] & apart[i] & living[i];
      } else {
        const auto index =
            static_cast<std::size_t>(here.row_of[static_cast<std::size_t>(IndexOf(at))]);
        for (std::size_t i = 0; i < n; ++i) row[i] = stay_[index * n + i] & living[i];
      }
      if (std::all_of(row, row + n, [](std::uint64_t w) { return w == 0; })) continue;
      next.row_of[static_cast<std::size_t>(IndexOf(at))] = static_cast<std::int32_t>(rows++);
    }
  next.rows.resize(rows * n);
  layers_.push_back(std::move(next));
}

bool PairSearch::Reached(const State& state) const {
  const Layer& layer = layers_[static_cast<std::size_t>(state.step)];
  const std::int32_t index = layer.row_of[static_cast<std::size_t>(IndexOf(state.at[0]))];
  if (index < 0) return false;
  return grid_[1].Has(layer.rows.data() + static_cast<std::size_t>(index) * grid_[1].words(),
                      state.at[1]);
}

/// Each unit may be at the begin of the step, in its middle or at its end while the other is at any
/// of these.
bool PairSearch::StepClear(const State& before, const State& after) {
  std::array<std::array<SegmentFp, 3>, 2> lines;
  for (std::size_t m = 0; m < 2; ++m) {
    const Pose a = grid_[m].At(before.at[m]);
    const Pose b = grid_[m].At(after.at[m]);
    lines[m] = {q_.units[m].arm->At(a), q_.units[m].arm->At({(a[0] + b[0]) / 2, (a[1] + b[1]) / 2}),
                q_.units[m].arm->At(b)};
  }
  for (const SegmentFp& a : lines[0])
    for (const SegmentFp& b : lines[1])
      if (SquaredDistance(a, b) <= q_.need_mm * q_.need_mm) return false;
  return true;
}

/// Reads a way backwards. Where no step before is clear in its middle, another way is tried.
bool PairSearch::Read(const State& end, std::vector<State>* way) {
  struct Open {
    State state;
    Turns last{};
    int tried = 0;
  };
  const auto key = [&](const State& s) {
    std::uint64_t k = static_cast<std::uint64_t>(s.step);
    for (const GridPose& at : s.at)
      for (const std::int32_t i : at) k = k * 512 + static_cast<std::uint64_t>(i);
    return k;
  };
  dead_.clear();
  std::vector<Open> open{{end, {}, 0}};
  int tests = 0;
  int looks = 0;
  // First all stand, then all turn as in the step after; then every other turn.
  constexpr int kTurns = 83;
  while (!open.empty() && open.back().state.step > 0) {
    Open& here = open.back();
    const std::int32_t step = here.state.step - 1;
    bool deeper = false;
    while (here.tried < kTurns && !deeper) {
      const int turn = here.tried++;
      work_ += kWordsPerLook;
      if (++looks > kLooksMost) return false;
      Turns turns{};
      if (turn == 1) turns = here.last;
      if (turn > 1)
        for (std::size_t n = 0, rest = static_cast<std::size_t>(turn - 2); n < 4; ++n, rest /= 3)
          turns[n / 2][n % 2] = static_cast<std::int32_t>(rest % 3) - 1;
      if (turns != Turns{} && !q_.units[0].MayMove(step)) continue;
      State before{{}, step};
      bool free = true;
      for (std::size_t m = 0; m < 2 && free; ++m) {
        before.at[m] = {here.state.at[m][0] + turns[m][0], here.state.at[m][1] + turns[m][1]};
        free = grid_[m].Contains(before.at[m]) && grid_[m].Has(free_[m].In(step), before.at[m]) &&
               grid_[m].Has(free_[m].In(step), here.state.at[m]);
      }
      if (!free || !Reached(before) || dead_.contains(key(before))) continue;
      work_ += kWordsPerTest;
      if (++tests > kTestsMost) return false;
      if (!StepClear(before, here.state)) continue;
      const Turns last = turns == Turns{} ? here.last : turns;
      open.push_back({before, last, 0});
      deeper = true;
    }
    if (deeper) continue;
    dead_.insert(key(open.back().state));
    open.pop_back();
  }
  if (open.empty()) return false;
  way->clear();
  for (auto it = open.rbegin(); it != open.rend(); ++it) way->push_back(it->state);
  return true;
}

std::optional<PairSearch::Found> PairSearch::LayOut(const std::vector<State>& way) const {
  Found found;
  found.end_step = way.back().step;
  for (std::size_t m = 0; m < 2; ++m) {
    StepPaths paths(*q_.units[m].drive, q_.units[m].steps);
    for (std::size_t s = 0; s + 1 < way.size(); ++s) {
      const Pose a = grid_[m].At(way[s].at[m]);
      const Pose b = grid_[m].At(way[s + 1].at[m]);
      paths.Turn(static_cast<std::int32_t>(s), {b[0] - a[0], b[1] - a[1]});
    }
    const std::optional<AxisPaths> made = paths.Take();
    if (!made) return std::nullopt;
    found.paths[m] = *made;
  }
  return found;
}

/// Adds layers until both have arrived, and reads the way. False: they do not arrive in time.
bool PairSearch::Spread(std::int32_t end_step, std::vector<State>* way) {
  // Once both targets are free for good the two may stay there.
  std::int32_t may_end = end_step;
  for (; may_end > 0; --may_end)
    if (!grid_[0].Has(free_[0].In(may_end - 1), grid_[0].to()) ||
        !grid_[1].Has(free_[1].In(may_end - 1), grid_[1].to()))
      break;
  for (std::vector<std::uint64_t>* scratch : {&spread_, &first_goes_, &joined_})
    scratch->assign(grid_[1].words(), 0);
  layers_.clear();
  Layer first;
  first.row_of.assign(lines_[0].size(), -1);
  first.row_of[static_cast<std::size_t>(IndexOf(grid_[0].from()))] = 0;
  first.rows.assign(grid_[1].words(), 0);
  first.rows[grid_[1].WordOf(grid_[1].from())] = PoseGrid::BitOf(grid_[1].from());
  layers_.push_back(std::move(first));
  for (std::int32_t step = 0;; ++step) {
    const State end{{grid_[0].to(), grid_[1].to()}, step};
    if (step >= may_end && Reached(end) && Read(end, way)) return true;
    if (step == end_step || layers_.back().rows.empty()) return false;
    Step(step);
  }
}

std::optional<PairSearch::Found> PairSearch::Find(const Question& question) {
  const bool same = !lines_[0].empty() && IsSamePair(question);
  if (!same) lines_[0].clear();
  q_ = question;
  const std::int32_t end_step = q_.units[0].end_step;
  for (std::size_t m = 0; m < 2; ++m) {
    const StepQuestion& unit = q_.units[m];
    grid_[m].SetUp(*unit.drive, unit.steps, unit.from, unit.to, unit.within);
    if (PoseGrid::StepsBetween(grid_[m].from(), grid_[m].to()) > end_step) return std::nullopt;
    free_[m].SetUp(unit, grid_[m]);
    if (!FindLiving(m, end_step)) return std::nullopt;
  }
  if (!same || lines_[0].empty()) SetUpLines();
  // A margin may close narrow ways out of a hook.
  for (margin_ = 0; margin_ < kMarginShares.size(); ++margin_) {
    std::vector<State> way;
    if (Spread(end_step, &way)) return LayOut(way);
  }
  return std::nullopt;
}

}  // namespace focalfleet
