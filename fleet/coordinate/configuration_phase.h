// The phases of the configuration under way, as a table: a transition that is not in it is a bug.
//
//   gathering -> planning -> uploading -> committing -> moving -> (next round, homing, measuring)
//       ^            |           |            |            |
//       |            |           +-> disarming <-          |   a unit failed before the start
//       +------------+-----------------+-------------------+
//
// Every configuration ends by way of kReporting, when its last rows are durable. The published
// ConfigurationState (records.h) is coarser.
#pragma once

#include <cstdint>
#include <initializer_list>

namespace focalfleet {

enum class ConfigurationPhase : std::uint8_t {
  kIdle,
  kGathering,  // waits until every unit has had the chance to answer
  kPlanning,
  kUploading,
  kDisarming,  // a unit failed before the start: the others give their moves back
  kCommitting,
  kMoving,
  kHomeCommitting,
  kHoming,
  kMeasuring,  // all rest; sensors are read and an exposure is taken
  kReporting,  // all motion is over; the last rows are being written
};
inline constexpr std::uint8_t kConfigurationPhaseCount = 11;

constexpr std::uint32_t Bit(ConfigurationPhase phase) { return 1u << static_cast<unsigned>(phase); }
constexpr std::uint32_t Bits(std::initializer_list<ConfigurationPhase> phases) {
  std::uint32_t bits = 0;
  for (const ConfigurationPhase phase : phases) bits |= Bit(phase);
  return bits;
}

namespace configuration_phase_table {
using enum ConfigurationPhase;
/// The ways on from a round that is over, or that had nothing to move.
inline constexpr std::uint32_t kRoundOver =
    Bits({kGathering, kHomeCommitting, kMeasuring, kReporting});

struct Row {
  ConfigurationPhase from;
  std::uint32_t to;
};
inline constexpr Row kAllowed[kConfigurationPhaseCount] = {
    {kIdle, Bits({kGathering})},
    {kGathering, Bits({kPlanning, kMeasuring, kReporting})},
    {kPlanning, Bits({kPlanning, kUploading}) | kRoundOver},
    {kUploading, Bits({kCommitting, kDisarming})},
    {kDisarming, Bits({kGathering, kReporting})},
    {kCommitting, Bits({kMoving, kDisarming})},
    {kMoving, kRoundOver},
    {kHomeCommitting, Bits({kGathering, kHoming, kReporting})},
    {kHoming, Bits({kGathering, kReporting})},
    {kMeasuring, Bits({kGathering, kReporting})},
    {kReporting, Bits({kIdle})},
};
}  // namespace configuration_phase_table

constexpr bool IsAllowed(ConfigurationPhase from, ConfigurationPhase to) {
  return (configuration_phase_table::kAllowed[static_cast<unsigned>(from)].to & Bit(to)) != 0;
}

}  // namespace focalfleet
