// A complete unit: FLASH, firmware, two axes, its mechanism, and its planted faults. The unit also
// keeps the simulation's own record of the moves that were begun, to which the firmware has no
// access.
#pragma once

#include <memory>
#include <vector>

#include "sim/world/mechanism.h"
#include "sim/world/spread.h"
#include "sim/world/unit/firmware.h"

namespace focalfleet::sim {

class Unit {
 public:
  struct Parts {
    UnitDescription description;
    UnitTraits traits;
    Flash flash;
    std::array<AxisModel, kAxisCount> axis;
    const JointSensors* magnets = nullptr;  // outlives the unit
  };
  explicit Unit(const Parts& parts);
  Unit(const Unit&) = delete;  // the firmware points into it
  Unit& operator=(const Unit&) = delete;

  void OnFrame(const CanFrame& frame, HostInstant now, TransmitQueue* out);
  void OnTime(HostInstant now, TransmitQueue* out);
  void OnSync(HostInstant now, TransmitQueue* out);

  void SpoilFlash(FlashDamage damage);

  [[nodiscard]] Firmware& firmware() { return firmware_; }
  [[nodiscard]] const Firmware& firmware() const { return firmware_; }
  [[nodiscard]] const Flash& flash() const { return flash_; }
  [[nodiscard]] const AxisModel& axis(Axis which) const { return axis_[Index(which)]; }
  [[nodiscard]] const UnitTraits& traits() const { return traits_; }
  [[nodiscard]] UnitFaults& faults() { return faults_; }
  [[nodiscard]] const UnitFaults& faults() const { return faults_; }
  [[nodiscard]] std::uint32_t begun_twice() const { return begun_twice_; }
  /// The move that it began last, whatever its FLASH says since; 0: none yet.
  [[nodiscard]] MoveId last_begun() const { return last_begun_; }
  /// The begin of its last motion; kNever: none in this run.
  [[nodiscard]] HostInstant began() const { return began_; }

 private:
  void RecordBegun(HostInstant now);

  UnitTraits traits_;
  Flash flash_;
  std::array<AxisModel, kAxisCount> axis_;
  UnitFaults faults_;
  Firmware firmware_;
  std::uint32_t recorded_ = 0;        // the part of flash_.moves_begun that is in begun_
  std::vector<std::uint16_t> begun_;  // sorted
  std::uint32_t begun_twice_ = 0;
  MoveId last_begun_;
  HostInstant began_ = kNever;
};

}  // namespace focalfleet::sim
