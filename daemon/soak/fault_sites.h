// The sites at which something outside of the daemon goes wrong. Each site is armed in a part of the
// seeds, with rates of its own, so that a run has some faults often and others never. The table is
// also the list of what a soak must have reached: a site without a count was not tested.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace focalfleet::soak {

enum class FaultSite : std::uint8_t {
  // The host is killed at a point of a turn (TurnPoint), between two frames, or within a commit.
  kKillGathered,
  kKillStepped,
  kKillRowsGiven,
  kKillFramesPut,
  kKillJobsGiven,
  kKillReplied,
  kKillFlushed,
  kKillStatusGiven,
  kKillBetweenFrames,
  kKillInCommit,
  kKillInStart,
  // The host otherwise.
  kHostPowerCut,
  kHostEnds,
  kHostFreeze,
  kWallStepBack,
  kWallStepForward,
  // The disk.
  kDiskWriteError,
  kDiskSyncError,
  kDiskDropsPages,
  kDiskReadError,
  kDiskFull,
  kDiskSlow,
  // The planner.
  kPlannerSlow,
  kPlannerFails,
  kPlannerFull,
  // Buses.
  kBusNoise,
  kBusDrop,
  kBusDuplicate,
  kBusDelay,
  kBusDead,
  kBusSwizzle,
  kBusStuck,
  kBusHostOff,
  kPortFull,
  kForeignStop,
  kForeignFrame,
  kGarbageHeard,
  // Units.
  kUnitPowerCut,
  kRailPowerCut,
  kUnitSilent,
  kUnitIntermittent,
  kUnitDeaf,
  kUnitLate,
  kUnitCopies,
  kUnitWrongDigest,
  kUnitMuteDone,
  kUnitIgnores,
  kUnitRefuses,
  kUnitStaleSequence,
  kUnitFaultInMotion,
  kUnitFault,
  kUnitUnplugged,
  kUnitBabbles,
  kUnitForeign,
  kUnitSerialZero,
  kUnitFlashLost,
  kUnitMarkLost,
  // Operators and readers.
  kOperatorBusy,
  kOperatorStop,
  kOperatorStopUnit,
  kOperatorRetarget,
  kOperatorHome,
  kOperatorDisable,
  kOperatorParameter,
  kOperatorPreview,
  kOperatorGarbage,
  kOperatorFlood,
  kOperatorGone,
  kReaderBehind,
  kStoreReaderFails,
  // The camera.
  kCameraDead,
  kCameraLate,
  kCameraDoubled,
  kCameraTurned,
  kCameraOtherField,
  kCount
};
inline constexpr std::size_t kFaultSites = static_cast<std::size_t>(FaultSite::kCount);

inline constexpr std::array<const char*, kFaultSites> kFaultSiteNames{
    "kill_gathered",      "kill_stepped",      "kill_rows_given",   "kill_frames_put",
    "kill_jobs_given",    "kill_replied",      "kill_flushed",      "kill_status_given",
    "kill_between_frames", "kill_in_commit",   "kill_in_start",     "host_power_cut",
    "host_ends",          "host_freeze",       "wall_step_back",    "wall_step_forward",
    "disk_write_error",   "disk_sync_error",   "disk_drops_pages",  "disk_read_error",
    "disk_full",          "disk_slow",         "planner_slow",      "planner_fails",
    "planner_full",       "bus_noise",         "bus_drop",          "bus_duplicate",
    "bus_delay",          "bus_dead",          "bus_swizzle",       "bus_stuck",
    "bus_host_off",       "port_full",         "foreign_stop",      "foreign_frame",
    "garbage_heard",      "unit_power_cut",    "rail_power_cut",    "unit_silent",
    "unit_intermittent",  "unit_deaf",         "unit_late",         "unit_copies",
    "unit_wrong_digest",  "unit_mute_done",    "unit_ignores",      "unit_refuses",
    "unit_stale_sequence", "unit_fault_in_motion", "unit_fault",    "unit_unplugged",
    "unit_babbles",       "unit_foreign",      "unit_serial_zero",  "unit_flash_lost",
    "unit_mark_lost",     "operator_busy",     "operator_stop",     "operator_stop_unit",
    "operator_retarget",  "operator_home",     "operator_disable",  "operator_parameter",
    "operator_preview",   "operator_garbage",  "operator_flood",    "operator_gone",
    "reader_behind",      "store_reader_fails", "camera_dead",      "camera_late",
    "camera_doubled",     "camera_turned",     "camera_other_field"};

constexpr std::size_t Index(FaultSite site) { return static_cast<std::size_t>(site); }
constexpr const char* Name(FaultSite site) { return kFaultSiteNames[Index(site)]; }

/// The number of times that each site was reached.
using FaultCounts = std::array<std::uint64_t, kFaultSites>;

}  // namespace focalfleet::soak
