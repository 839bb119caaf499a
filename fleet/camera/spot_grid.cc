#include "fleet/camera/spot_grid.h"

#include <algorithm>
#include <cmath>

namespace focalfleet {

SpotGrid::SpotGrid(std::span<const PointFp> points, double cell_mm) : cell_mm_(cell_mm) {
  if (points.empty()) return;
  low_ = points.front();
  PointFp high = points.front();
  for (const PointFp& p : points) {
    low_ = {std::min(low_.x_mm, p.x_mm), std::min(low_.y_mm, p.y_mm)};
    high = {std::max(high.x_mm, p.x_mm), std::max(high.y_mm, p.y_mm)};
  }
  // A single far point must not cost an unlimited number of cells.
  const double side_max = 2 * std::sqrt(static_cast<double>(points.size())) + 2;
  cell_mm_ =
      std::max({cell_mm_, (high.x_mm - low_.x_mm) / side_max, (high.y_mm - low_.y_mm) / side_max});
  columns_ = static_cast<std::size_t>((high.x_mm - low_.x_mm) / cell_mm_) + 1;
  rows_ = static_cast<std::size_t>((high.y_mm - low_.y_mm) / cell_mm_) + 1;
  std::vector<std::uint32_t> cell_of(points.size());
  begin_.assign(columns_ * rows_ + 1, 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    cell_of[i] = static_cast<std::uint32_t>(Cell(points[i].y_mm - low_.y_mm, rows_) * columns_ +
                                            Cell(points[i].x_mm - low_.x_mm, columns_));
    ++begin_[cell_of[i] + 1];
  }
  for (std::size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  member_.resize(points.size());
  sorted_.resize(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const std::uint32_t at = next[cell_of[i]]++;
    member_[at] = i;
    sorted_[at] = points[i];
  }
}

std::size_t SpotGrid::Cell(double offset_mm, std::size_t count) const {
  // The comparison comes before the cast: a place far off the plate fits no integer.
  const double cells = offset_mm / cell_mm_;
  if (!(cells > 0)) return 0;
  if (cells >= static_cast<double>(count)) return count - 1;
  return static_cast<std::size_t>(cells);
}

}  // namespace focalfleet
