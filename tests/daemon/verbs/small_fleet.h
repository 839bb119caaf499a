// A few units in a row, their coordinator without any replies, and a view of both.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "daemon/status/status_snapshot.h"
#include "fleet/coordinator.h"
#include "fleet/layout.h"

namespace focalfleet::test {

class SmallFleet {
 public:
  explicit SmallFleet(std::uint32_t count = 3) : layout_(Row(count)) {
    coordinator_ = std::make_unique<Coordinator>(&layout_, std::vector<UnitDrive>(count),
                                                 CoordinatorConfig{}, StoredFleet{});
  }
  [[nodiscard]] FleetView View(HostInstant now = {}) const {
    return {.layout = &layout_, .coordinator = coordinator_.get(), .now = now, .at = {}};
  }
  Effects Step(Inputs inputs) {
    Effects effects;
    coordinator_->Step(inputs, &effects);
    return effects;
  }
  [[nodiscard]] const Layout& layout() const { return layout_; }

 private:
  static Layout Row(std::uint32_t count) {
    std::vector<Unit> units(count);
    for (std::uint32_t n = 0; n < count; ++n) {
      units[n].id = UnitId{n + 1};
      units[n].base_fp = {25.6 * n, 0};
      units[n].axis = {AxisGeometry{7.4, 0, 890, -190, 190}, AxisGeometry{7.4, 0, 890, 0, 190}};
      units[n].bus = BusId{n / 100};
      units[n].node = NodeId{static_cast<std::uint8_t>(n % 100 + 1)};
    }
    return Layout::Create(std::move(units), {}).value();
  }

  Layout layout_;
  std::unique_ptr<Coordinator> coordinator_;
};

}  // namespace focalfleet::test
