// The state of a plane's coordinator: what it keeps, what sectors report, what it shows. Its rooms
// share it: plane_rounds.h, plane_recall.h and the coordinator itself.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fleet/coordinate/effects.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/plane/plane_measuring.h"
#include "fleet/plane/plane_plan.h"
#include "fleet/plane/plane_tasks.h"
#include "fleet/plane/sector_book.h"

namespace focalfleet {

enum class PlanePhase : std::uint8_t {
  kListening,
  kClaiming,
  kIdle,
  kRecording,
  kGathering,
  kPlanning,
  kPreparing,
  kMoving,
  kFinishing,
  kStopping,
  kMeasuring,
};
inline constexpr std::size_t kPlanePhaseCount = 11;
constexpr const char* Name(PlanePhase phase) {
  constexpr const char* kNames[] = {"listening", "claiming", "idle",      "recording",
                                    "gathering", "planning", "preparing", "moving",
                                    "finishing", "stopping", "measuring"};
  return kNames[static_cast<std::size_t>(phase)];
}

struct PlaneEffects {
  std::vector<PlaneOrder> orders;
  std::optional<PlaneJob> job;
  /// Asks the plane's camera for an exposure, and for the place of each unit in it.
  std::optional<PlaneExposure> exposure;
  std::optional<PlaneRecord> record;  // is to be made durable, under `record_number`
  std::uint64_t record_number = 0;
  std::vector<ReplyEffect> replies;
  std::vector<std::string> log;  // for people
  std::vector<ShellNote> notes;  // alarms of the plane, and their ends
  HostInstant wake_at = kNever;
};

/// The configuration under way, or the last one.
struct PlaneView {
  PlanePhase phase = PlanePhase::kListening;
  PlaneEpoch epoch;
  std::uint64_t configuration = 0;
  ConfigurationKind kind = ConfigurationKind::kApply;
  std::string source;
  ConfigurationState state = ConfigurationState::kDone;
  std::uint32_t rounds = 0;
  OutcomeCounts counts = {};        // of all sectors that were heard
  std::string waiting_for = {};     // for people; usually empty
  double makespan_predicted_s = 0;  // of all rounds
  /// The guarantee of the last plan over borders.
  std::uint32_t follows_beyond = 0;
  std::vector<UnnoticedPair> unnoticed = {};
  HostInstant start_at = kNever;             // of the last round
  std::vector<MeasuredRound> measured = {};  // blind, then after each correction
  std::string not_measured = {};             // why the last exposure could not be used
};

/// The part of a sector in a round.
struct PlanePart {
  std::uint64_t incarnation = 0;
  std::uint64_t job = 0;  // or the exposure that it asks for; 0: none
  bool operator==(const PlanePart&) const = default;
};

struct PlaneState {
  void Enter(PlanePhase phase) {
    view.phase = phase;
    since = now;
    out->wake_at = std::min(out->wake_at, now);
  }
  /// The record is to be made durable.
  void Keep() {
    out->record = record;
    out->record_number = ++record_number;
  }
  [[nodiscard]] bool IsKept() const { return kept == record_number; }
  /// The configuration under way, or the last one.
  [[nodiscard]] PlaneConfigurationId Id() const { return {self, view.configuration}; }
  /// Answers the command that began the configuration, if it still waits.
  void Reply(std::optional<Error> error, std::string text) {
    if (request == 0) return;
    out->replies.push_back({std::exchange(request, 0), true, std::move(error), std::move(text)});
  }

  const PlaneLayout& plane;
  const PlaneTimes times;
  const std::uint64_t self;
  PlaneRecord record;
  SectorBook sectors;
  PlaneView view = {};
  std::uint64_t record_number = 0;
  std::uint64_t kept = 0;
  std::uint64_t request = 0;  // that waits for the end; 0: none
  std::uint64_t round = 0;    // the last given out, in this epoch
  HostInstant now = {};
  HostInstant since{INT64_MIN};  // the phase began
  PlaneEffects* out = nullptr;   // of the present step
};

}  // namespace focalfleet
