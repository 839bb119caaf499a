// Points of the plate sorted into square cells: the points near a place are found in a few cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fleet/layout.h"

namespace focalfleet {

class SpotGrid {
 public:
  /// Pre: all points are finite. Cost: O(n); the number of cells is bounded by the count.
  SpotGrid(std::span<const PointFp> points, double cell_mm);

  /// Calls `visit(index, squared distance)` for every point within the radius.
  template <class Visit>
  void ForNear(PointFp p, double radius_mm, Visit visit) const {
    if (sorted_.empty()) return;
    const std::size_t column0 = Cell(p.x_mm - radius_mm - low_.x_mm, columns_);
    const std::size_t column1 = Cell(p.x_mm + radius_mm - low_.x_mm, columns_);
    const std::size_t row0 = Cell(p.y_mm - radius_mm - low_.y_mm, rows_);
    const std::size_t row1 = Cell(p.y_mm + radius_mm - low_.y_mm, rows_);
    for (std::size_t row = row0; row <= row1; ++row)
      for (std::uint32_t k = begin_[row * columns_ + column0];
           k < begin_[row * columns_ + column1 + 1]; ++k) {
        const double dx = sorted_[k].x_mm - p.x_mm;
        const double dy = sorted_[k].y_mm - p.y_mm;
        const double d2 = dx * dx + dy * dy;
        if (d2 <= radius_mm * radius_mm) visit(member_[k], d2);
      }
  }

 private:
  [[nodiscard]] std::size_t Cell(double offset_mm, std::size_t count) const;

  PointFp low_;
  double cell_mm_ = 1;
  std::size_t columns_ = 1;
  std::size_t rows_ = 1;
  std::vector<std::uint32_t> begin_;   // first entry of each cell in member_, and the end
  std::vector<std::uint32_t> member_;  // indices of points, cell by cell
  std::vector<PointFp> sorted_;        // the points in the order of member_
};

}  // namespace focalfleet
