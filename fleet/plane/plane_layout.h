// A plane is one layout that several daemons share. Each daemon owns one sector: whole buses, and
// the units on them. Sectors are numbered from 0 in the order in which the configuration has them.
//
// Two units can touch only where they are neighbours, so borders are pairs of neighbours in
// different sectors. A unit without a neighbour beyond its border is no concern of other sectors.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

class PlaneLayout {
 public:
  /// `buses` has the buses of each sector. Errors: kInvalid: a bus that is in no sector, in two, or
  /// not in the layout; a sector without a unit; more than limits::kSectors. Cost: O(n).
  static Result<PlaneLayout> Create(Layout layout, std::vector<std::vector<BusId>> buses);

  [[nodiscard]] const Layout& layout() const { return layout_; }
  [[nodiscard]] std::uint32_t sectors() const { return static_cast<std::uint32_t>(own_.size()); }
  [[nodiscard]] std::uint32_t SectorOf(PositionerIndex i) const { return sector_[i.value]; }
  /// The units of a sector, ascending: its own layout has them in this order.
  [[nodiscard]] std::span<const PositionerIndex> own(std::uint32_t sector) const {
    return own_[sector];
  }
  /// The unit's place in the layout of its sector.
  [[nodiscard]] PositionerIndex Local(PositionerIndex i) const { return local_[i.value]; }
  /// Other sectors that have a unit in reach of this one; ascending.
  [[nodiscard]] std::span<const std::uint32_t> beyond(PositionerIndex i) const {
    return beyond_[i.value];
  }
  /// Sectors that have a border with this one; ascending.
  [[nodiscard]] std::span<const std::uint32_t> neighbours(std::uint32_t sector) const {
    return neighbours_[sector];
  }

 private:
  explicit PlaneLayout(Layout layout) : layout_(std::move(layout)) {}
  void FindBorders();

  Layout layout_;
  std::vector<std::uint32_t> sector_;               // Shape: (n)
  std::vector<PositionerIndex> local_;              // Shape: (n)
  std::vector<std::vector<PositionerIndex>> own_;   // Shape: (sectors)
  std::vector<std::vector<std::uint32_t>> beyond_;  // Shape: (n)
  std::vector<std::vector<std::uint32_t>> neighbours_;
};

/// A number that differs where layouts do: units, addresses, geometry. A sector and its coordinator
/// compare theirs before anything moves.
std::uint64_t DigestOf(const Layout& layout);

}  // namespace focalfleet
