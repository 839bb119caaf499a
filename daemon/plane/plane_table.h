// The table of all that the sectors of a plane publish of themselves: the newest status of each
// sector and each unit. Status is published where it changes, and each sector says once a second
// how its fleet is. A sector that says nothing for 3 s is silent: its units' places are not known
// any more, and are never shown as if they were.
//
// Pure: instants are those of this host's steady clock.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/dds/status_reader.h"
#include "daemon/dds/status_values.h"
#include "fleet/plane/plane_layout.h"
#include "fleet/plane/sector_book.h"

namespace focalfleet {

using SteadyTime = std::chrono::steady_clock::time_point;

class PlaneTable {
 public:
  /// `plane` outlives the table.
  explicit PlaneTable(const PlaneLayout* plane)
      : plane_(*plane), sectors_(plane->sectors()), units_(plane->layout().size()) {}

  struct Sector {
    std::optional<FleetStatusValue> fleet;
    std::optional<ConfigurationProgressValue> configuration;
    SteadyTime heard;  // with `fleet`
  };
  struct Counts {
    /// A unit whose sector is silent, or of which nothing was heard, counts as silent and unknown.
    std::array<std::uint32_t, kUnitPhaseCount> by_phase{};
    std::array<std::uint32_t, kWitnessCount> by_witness{};
    std::uint32_t enabled = 0;
    std::uint32_t silent_sectors = 0;
    double bus_load_max = 0;
    bool store_failing = false;
  };

  void Absorb(const StatusUpdate& update, SteadyTime now);

  [[nodiscard]] const Sector& sector(std::uint32_t sector) const { return sectors_[sector]; }
  /// Units: s since the sector was heard; none: it never was.
  [[nodiscard]] std::optional<double> AgeOf(std::uint32_t sector, SteadyTime now) const;
  [[nodiscard]] bool IsSilent(std::uint32_t sector, SteadyTime now) const;
  /// Null: nothing was heard of the unit.
  [[nodiscard]] const UnitStatusValue* unit(PositionerIndex i) const {
    return units_[i.value] ? &*units_[i.value] : nullptr;
  }
  [[nodiscard]] Counts Count(SteadyTime now) const;
  /// The answer to `state`: {"rows":[...],"sectors":[...]}, as text. `book` has the drives. Cost:
  /// 20 ms for 20,000 units.
  [[nodiscard]] std::string StateText(const SectorBook& book, SteadyTime now) const;

 private:
  const PlaneLayout& plane_;
  std::vector<Sector> sectors_;
  std::vector<std::optional<UnitStatusValue>> units_;  // Shape: (units of the plane)
};

}  // namespace focalfleet
