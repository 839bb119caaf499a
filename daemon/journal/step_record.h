// A record of one step of the coordinator: all that it took in, and a digest of what it decided. A
// coordinator that starts from the same state and takes the recorded inputs must decide the same,
// to the bit. Plans are not recorded: the planner makes the same one of the same job, given up at
// the same look where the search was cut short.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/coordinator.h"

namespace focalfleet::journal {

/// The digest of all that a step decided.
std::uint64_t DigestOf(const Effects& effects);

/// The bytes of a record.
std::string RecordOf(const Inputs& inputs, const Effects& effects);

/// Replays records, in their order, on a coordinator of its own.
class Replayer {
 public:
  struct Start {
    const Layout* layout = nullptr;  // outlives the replayer
    std::vector<UnitDrive> drives;
    CoordinatorConfig config;
    StoredFleet stored;
    PowerLimits plan_limits;  // that the planner kept; none in the daemon
  };
  explicit Replayer(Start start);
  ~Replayer();

  /// The step decided as it did when it was recorded. Errors: kInvalid: the bytes are no record;
  /// kRefused: it decided otherwise, with its number, its instant and what differs.
  Status Step(std::string_view record);
  [[nodiscard]] std::uint64_t steps() const { return steps_; }
  [[nodiscard]] HostInstant now() const { return now_; }  // of the last step

 private:
  /// A job with the drives that the planner got with it.
  struct GivenJob {
    PlanJob job;
    std::vector<UnitDrive> drives;
  };
  const Layout* layout_;
  PowerLimits plan_limits_;
  std::unique_ptr<Coordinator> coordinator_;
  std::map<std::uint64_t, GivenJob> jobs_;  // that have no answer yet
  Effects effects_;
  HostInstant now_;
  std::uint64_t steps_ = 0;
};

}  // namespace focalfleet::journal
