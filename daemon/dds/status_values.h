// These values are published on DDS, as this project's own types. The types that idlc makes of
// focalfleet.idl stay inside this folder. Numbers that do not exist are NaN: the place of a unit
// whose position is not known, or a target that was not given.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "daemon/clock/wall_time.h"
#include "fleet/coordinator.h"

namespace focalfleet {

/// The sector of a plane whose daemon says it; none: a daemon of its own. A reader of several
/// partitions alone fills it in.
using SectorOfValue = std::optional<std::uint32_t>;

/// A daemon says once a second how its fleet is. Three times that is no delay of a busy host.
inline constexpr std::chrono::milliseconds kSilentAfter(3000);

inline constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
inline constexpr std::size_t kWitnessCount = 5;

struct UnitStatusValue {
  UnitId unit;
  SerialNumber serial;        // of the unit that answers; 0: none yet
  SerialNumber bound_serial;  // of the unit that belongs here; 0: none yet
  BusId bus;
  NodeId node;
  WallTime at;
  std::array<Witness, kAxisCount> witness{};
  std::array<double, kAxisCount> low_deg{kNoNumber, kNoNumber};  // the axis' own angle
  std::array<double, kAxisCount> high_deg{kNoNumber, kNoNumber};
  double x_fp_mm = kNoNumber;  // the fibre, where both axes have a single position
  double y_fp_mm = kNoNumber;
  std::array<double, kAxisCount> target_deg{kNoNumber, kNoNumber};
  double measured_error_um = kNoNumber;  // from its target, as last measured; not on the topic
  MoveId move;
  UnitPhase phase = UnitPhase::kAbsent;
  UnitState reported_state = UnitState::kRest;
  FaultCode fault = FaultCode::kNone;
  TargetOutcome outcome = TargetOutcome::kNone;
  bool enabled = true;
};

/// The last reading of a unit's own sensors.
struct UnitOrientationValue {
  UnitId unit;
  WallTime at;
  FibreCarrierReading carrier;  // verdict: at most 63 bytes are sent
  MeasurementSource source = MeasurementSource::kCamera;
  double x_fp_mm = kNoNumber;  // the fibre as measured
  double y_fp_mm = kNoNumber;
  CovarianceFp covariance{kNoNumber, kNoNumber, kNoNumber};
};

struct BusStatusValue {
  BusId bus;
  WallTime at;
  BusView view;
};

struct FleetStatusValue {
  WallTime at;
  WallTime started;     // start of the daemon
  std::string version;  // at most 31 bytes are sent
  std::uint32_t units = 0;
  std::uint32_t enabled = 0;
  std::array<std::uint32_t, kUnitPhaseCount> units_by_phase{};  // index: UnitPhase
  std::array<std::uint32_t, kWitnessCount>
      units_by_witness{};  // index: Witness, the lesser of both axes
  std::uint64_t configuration = 0;
  double bus_load_max = 0;
  bool busy = false;
  bool store_failing = false;
  SectorOfValue sector = {};
};

struct ConfigurationProgressValue {
  WallTime at;
  ConfigurationView view;  // its host instants are not sent; source: at most 255 bytes are sent
  SectorOfValue sector = {};
};

struct AuditHeadValue {
  WallTime at;
  std::string head;  // as audit_chain.h writes it; at most 127 bytes are sent
  SectorOfValue sector = {};
};

struct AlarmValue {
  WallTime at;
  AlarmRow row;  // text: at most 255 bytes are sent
  SectorOfValue sector = {};
};

}  // namespace focalfleet
