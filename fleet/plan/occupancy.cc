#include "fleet/plan/occupancy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace focalfleet {
namespace {

/// A cell is too near where its middle is: a core may pass it at half a cell's width. Units: cells.
constexpr double kMargin = 0.5;
constexpr double kCellsPerNeed = 4;

std::int32_t CellOf(double mm, double cell_mm) {
  return static_cast<std::int32_t>(std::floor(mm / cell_mm));
}

RasterWindow WindowAround(const PointFp& centre, double radius_mm, double cell_mm) {
  RasterWindow window{.cell_mm = cell_mm};
  window.x0 = CellOf(centre.x_mm - radius_mm, cell_mm);
  window.y0 = CellOf(centre.y_mm - radius_mm, cell_mm);
  window.width = CellOf(centre.x_mm + radius_mm, cell_mm) - window.x0 + 1;
  window.height = CellOf(centre.y_mm + radius_mm, cell_mm) - window.y0 + 1;
  return window;
}

double MiddleOf(std::int32_t cell, double cell_mm) { return (cell + 0.5) * cell_mm; }

/// The cells of a row whose middles are nearer than the radius to the line: a stadium is convex.
struct RowSpan {
  double low = 1e18;
  double high = -1e18;
  void Take(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
};

RowSpan SpanAt(const SegmentFp& line, double radius_mm, double y_mm) {
  RowSpan span;
  for (const PointFp& end : {line.a, line.b}) {
    const double dy = y_mm - end.y_mm;
    if (std::abs(dy) > radius_mm) continue;
    const double half = std::sqrt(radius_mm * radius_mm - dy * dy);
    span.Take(end.x_mm - half);
    span.Take(end.x_mm + half);
  }
  const double ux = line.b.x_mm - line.a.x_mm;
  const double uy = line.b.y_mm - line.a.y_mm;
  const double length = std::sqrt(ux * ux + uy * uy);
  if (length <= 0 || uy == 0) return span;
  // The two long sides of the rectangle between the ends.
  for (const double side : {radius_mm, -radius_mm}) {
    const double ax = line.a.x_mm - uy / length * side;
    const double ay = line.a.y_mm + ux / length * side;
    const double along = (y_mm - ay) / uy;
    if (along < 0 || along > 1) continue;
    span.Take(ax + along * ux);
  }
  return span;
}

}  // namespace

TimeSteps StepsUntil(const Scene& scene, std::span<const UnitDrive> drives, double end_s) {
  constexpr double kStepDeg = 6;
  constexpr std::int64_t kRoundTicks = 60;  // usual drives turn whole vectors in such a step
  double step_s = 1e9;
  for (std::uint32_t i = 0; i < scene.size(); ++i) {
    double own_s = 0;
    for (const Axis axis : kAxes)
      own_s = std::max(own_s, kStepDeg * std::numbers::pi / 180 / scene.arm(i).step_rad(axis) *
                                  SecondsPerVector(drives[i].axis[Index(axis)]));
    step_s = std::min(step_s, own_s);
  }
  TimeSteps steps;
  steps.ticks =
      std::max<std::int64_t>(1, std::llround(step_s / kTickS / kRoundTicks)) * kRoundTicks;
  // Longer steps make a coarser search; what is found is proven all the same.
  constexpr double kStepsMost = 64 * kStepWordsMost - 3;
  const double coarser = std::max(1.0, end_s / (kStepsMost * steps.step_s()));
  steps.ticks = static_cast<std::int64_t>(std::ceil(coarser * static_cast<double>(steps.ticks)));
  // A way may need a step more than its time: parts of vectors are left at the end of a step.
  steps.count = static_cast<std::int32_t>(std::ceil(end_s / steps.step_s())) + 2;
  return steps;
}

Occupancy::Occupancy(const Motions& motions, const TimeSteps& steps)
    : motions_(motions),
      scene_(motions.scene()),
      steps_(steps),
      radius_mm_(scene_.size()),
      windows_(scene_.size()),
      drawn_(scene_.size(), 0),
      bits_(scene_.size()),
      standing_(scene_.size()) {
  double most_mm = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    for (const NeighbourNeed& near : scene_.neighbours(i))
      radius_mm_[i] = std::max(radius_mm_[i], near.need_mm);
    most_mm = std::max(most_mm, radius_mm_[i]);
  }
  if (most_mm > 0) cell_mm_ = most_mm / kCellsPerNeed;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    const ArmGeometry& arm = scene_.arm(i);
    radius_mm_[i] += kMargin * cell_mm_;
    const double reach = arm.theta_arm_mm() + arm.phi_arm_mm();
    windows_[i] = WindowAround(arm.base_fp(), reach + radius_mm_[i], cell_mm_);
    if (!scene_.standing(i).empty()) FindStanding(i);
  }
}

/// Cells of the unit's own disc that something takes for ever.
void Occupancy::FindStanding(std::uint32_t unit) {
  const ArmGeometry& arm = scene_.arm(unit);
  const RasterWindow own =
      WindowAround(arm.base_fp(), arm.theta_arm_mm() + arm.phi_arm_mm(), cell_mm_);
  for (std::int32_t y = 0; y < own.height; ++y) {
    for (std::int32_t x = 0; x < own.width; ++x) {
      const PointFp middle{MiddleOf(own.x0 + x, cell_mm_), MiddleOf(own.y0 + y, cell_mm_)};
      const auto takes = [&](const StandingThing& thing) {
        const double near = thing.need_mm + thing.capsule.radius_mm + kMargin * cell_mm_;
        return SquaredDistance(middle, thing.capsule.line) < near * near;
      };
      if (std::any_of(scene_.standing(unit).begin(), scene_.standing(unit).end(), takes))
        standing_[unit].push_back(y * own.width + x);
    }
  }
}

void Occupancy::DrawArm(std::uint32_t unit, const SegmentFp& line, std::int32_t first,
                        std::int32_t last) {
  const std::int32_t end = static_cast<std::int32_t>(steps_.words() * 64) - 1;
  first = std::clamp(first, 0, end);
  last = std::clamp(last, first, end);
  const RasterWindow& window = windows_[unit];
  const double radius = radius_mm_[unit];
  std::uint64_t* const bits = bits_[unit].data();
  const std::size_t words = steps_.words();
  const auto low_y = CellOf(std::min(line.a.y_mm, line.b.y_mm) - radius, cell_mm_);
  const auto high_y = CellOf(std::max(line.a.y_mm, line.b.y_mm) + radius, cell_mm_);
  for (std::int32_t y = std::max(low_y, window.y0);
       y <= std::min(high_y, window.y0 + window.height - 1); ++y) {
    const RowSpan span = SpanAt(line, radius, MiddleOf(y, cell_mm_));
    if (span.low > span.high) continue;
    const auto from =
        std::max(static_cast<std::int32_t>(std::ceil(span.low / cell_mm_ - 0.5)) - window.x0, 0);
    const auto to =
        std::min(static_cast<std::int32_t>(std::floor(span.high / cell_mm_ - 0.5)) - window.x0,
                 window.width - 1);
    std::uint64_t* cell =
        bits + (static_cast<std::size_t>(y - window.y0) * static_cast<std::size_t>(window.width) +
                static_cast<std::size_t>(std::max(from, 0))) *
                   words;
    for (std::int32_t x = from; x <= to; ++x, cell += words) {
      for (std::int32_t w = first / 64; w <= last / 64; ++w) {
        const int low = std::max(first - w * 64, 0);
        const int high = std::min(last - w * 64, 63);
        cell[w] |= (~std::uint64_t{0} >> (63 - high + low)) << low;
      }
    }
  }
}

void Occupancy::Draw(std::uint32_t unit) {
  drawn_[unit] = 1;
  const Track& track = motions_.track(unit);
  if (!scene_.is_place(unit) || track.legs().empty()) {
    bits_[unit].clear();
    return;
  }
  const Tolerance& tolerance = motions_.request().tolerance;
  const double h = steps_.step_s();
  bits_[unit].assign(windows_[unit].cells() * steps_.words(), 0);
  const ArmGeometry& arm = scene_.arm(unit);
  const auto step = [&](double t_s) {
    return static_cast<std::int32_t>(std::floor(std::clamp(t_s, -1e6, 1e6) / h));
  };
  for (const Leg& leg : track.legs()) {
    if (leg.stands()) {
      DrawArm(unit, ArmAt(arm, leg, 0), step(leg.begin_s - tolerance.Slip(leg.begin_s)),
              step(leg.end_s + tolerance.Slip(leg.end_s)));
      continue;
    }
    const int parts = std::max(1, static_cast<int>(std::ceil((leg.end_s - leg.begin_s) / h)));
    const double lasts = (leg.end_s - leg.begin_s) / parts;
    for (int n = 0; n < parts; ++n) {
      const double begin = leg.begin_s + n * lasts;
      const double slip = tolerance.Slip(begin + lasts);
      DrawArm(unit, ArmAt(arm, leg, begin + lasts / 2), step(begin - slip),
              step(begin + lasts + slip));
    }
  }
}

void Occupancy::Look(std::uint32_t unit, Surround* out) {
  const ArmGeometry& arm = scene_.arm(unit);
  const std::size_t words = steps_.words();
  out->window = WindowAround(arm.base_fp(), arm.theta_arm_mm() + arm.phi_arm_mm(), cell_mm_);
  const RasterWindow& own = out->window;
  out->bits.assign(own.cells() * words, 0);
  for (const NeighbourNeed& near : scene_.neighbours(unit)) {
    if (drawn_[near.unit] == 0) Draw(near.unit);
    if (bits_[near.unit].empty()) continue;
    const RasterWindow& other = windows_[near.unit];
    const std::int32_t x0 = std::max(own.x0, other.x0);
    const std::int32_t x1 = std::min(own.x0 + own.width, other.x0 + other.width);
    const std::int32_t y0 = std::max(own.y0, other.y0);
    const std::int32_t y1 = std::min(own.y0 + own.height, other.y0 + other.height);
    if (x0 >= x1) continue;
    for (std::int32_t y = y0; y < y1; ++y) {
      std::uint64_t* to = out->bits.data() + (static_cast<std::size_t>(y - own.y0) *
                                                  static_cast<std::size_t>(own.width) +
                                              static_cast<std::size_t>(x0 - own.x0)) *
                                                 words;
      const std::uint64_t* from =
          bits_[near.unit].data() +
          (static_cast<std::size_t>(y - other.y0) * static_cast<std::size_t>(other.width) +
           static_cast<std::size_t>(x0 - other.x0)) *
              words;
      const std::size_t count = static_cast<std::size_t>(x1 - x0) * words;
      for (std::size_t n = 0; n < count; ++n) to[n] |= from[n];
    }
  }
  for (const std::int32_t cell : standing_[unit])
    std::fill_n(
        out->bits.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(cell) * words),
        words, ~std::uint64_t{0});
}

}  // namespace focalfleet
