// The plate as its pages see it: a short code for each unit, and facts about the fleet as text. The
// table takes what DDS gets, and keeps the newest value of everything.
//
// A unit is 14 bytes. An angle is a 65,535th of a turn, 0.0055 degrees or 1 um at an arm of 12 mm,
// which is far below a pixel. 5000 units are 70 kB.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "daemon/status/status_batch.h"
#include "fleet/layout.h"

namespace focalfleet {

/// An angle or a distance that is not known.
inline constexpr std::uint16_t kNoCode = 0xFFFF;
/// A turn has this many steps. The code kNoCode is none of them.
inline constexpr std::uint32_t kTurnSteps = 65'535;

struct PlateUnit {
  // Directions on the plate: zero angles are added, whole turns are left out.
  std::uint16_t theta = kNoCode;  // kTurnSteps a turn
  std::uint16_t phi = kNoCode;    // against theta
  std::uint16_t target_theta = kNoCode;
  std::uint16_t target_phi = kNoCode;
  std::uint16_t error = kNoCode;  // from target, 0.5 um: as measured, else by its place
  std::uint8_t phase = 0;         // UnitPhase
  std::uint8_t witness = 0;       // Witness, the lesser of both axes
  std::uint8_t outcome = 0;       // TargetOutcome
  std::uint8_t flags = 0;         // 1: enabled; fault code << 1
  bool operator==(const PlateUnit&) const = default;
};

/// The code of an angle; kNoCode where it is no number.
std::uint16_t AngleCode(double angle_deg);

class PlateTable {
 public:
  /// `layout` outlives the table.
  explicit PlateTable(const Layout* layout);

  void Take(const StatusBatch& batch);
  /// An alarm came: pages ask for the list again.
  void NoteAlarm() { ++alarms_; }

  [[nodiscard]] const std::vector<PlateUnit>& units() const { return units_; }
  /// The time of the newest status; 0: there was none yet.
  [[nodiscard]] WallTime at() const { return at_; }
  /// Fleet, configuration and buses as JSON.
  [[nodiscard]] std::string Facts() const;
  /// Changes with what a page must not wait for: the configuration's step, and a new alarm.
  [[nodiscard]] std::uint64_t urgent() const;

 private:
  PlateUnit CodeOf(PositionerIndex i, const UnitStatusValue& status) const;
  [[nodiscard]] nlohmann::json ConfigurationFacts() const;
  [[nodiscard]] nlohmann::json BusFacts() const;

  const Layout* layout_;
  std::vector<PlateUnit> units_;
  std::vector<BusStatusValue> buses_;  // in the order of the layout's buses
  FleetStatusValue fleet_;
  ConfigurationProgressValue configuration_;
  double makespan_s_ = 0;  // of the configuration so far
  WallTime at_;
  std::uint64_t alarms_ = 0;
};

}  // namespace focalfleet
