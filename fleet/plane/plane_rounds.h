// The rounds of a plane's configuration, from gathering to its end. Each function takes the
// coordinator over one edge of the phases in plane_coordinator.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "fleet/plane/plane_state.h"

namespace focalfleet {

class PlaneRounds {
 public:
  /// `state` outlives this.
  explicit PlaneRounds(PlaneState* state) : state_(*state), parts_(state->plane.sectors()) {}

  /// A configuration begins.
  void Begin();
  void Gather();
  void TakePlan(const PlanePlanDone& done);
  void Preparing();
  void Moving();
  void Finishing();
  void TakeExposure(const ExposureDone& done);
  /// Stops all sectors, and ends the configuration when they have answered.
  void Stop(const std::string& why);
  void Stopping();

 private:
  enum class Readiness : std::uint8_t { kReady, kWaits, kMoves, kOver, kLooks, kAbsent };
  Readiness Prepare(std::uint32_t sector);
  Readiness PrepareOwn(std::uint32_t sector);
  void Plan(const std::vector<std::uint32_t>& ready, bool settling);
  void GiveRound(PlanePlan plan);
  void Start();
  void Look();
  void Finish(const std::string& failure, const PlanePlan* plan);
  void End(ConfigurationState state);

  PlaneState& state_;
  std::vector<PlanePart> parts_;     // Shape: (sectors)
  std::vector<std::uint8_t> strip_;  // Shape: (units); of the last job
  std::uint64_t job_ = 0;            // the last asked for
  std::uint64_t exposure_ = 0;       // the same
  std::uint32_t tries_ = 0;          // rounds since the last exposure, or since a unit was homed
  std::size_t to_home_ = 0;          // units that were left to home in the last plan
  ConfigurationState end_ = ConfigurationState::kDone;  // as of the last plan
};

/// The unit asks for no motion: it stands at its target.
bool IsAtTarget(const SectorJob& job, std::uint32_t local);
/// Orders the sector to give back the round that it holds. No effect where it holds none.
void Withdraw(std::uint32_t sector, SectorBook* sectors);
/// The order by which a sector that asks ends the configuration.
PlaneOrder EndOf(std::uint64_t job, const PlaneConfigurationId& id, std::uint64_t round,
                 SectorRound body);

}  // namespace focalfleet
