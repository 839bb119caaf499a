// The night as curves, kept in memory within bounds: units by phase and bus load over the hours,
// errors of each exposure, and the power of each plan against its limits. A fresh page gets all of
// it at once, then only what is newer. A new daemon begins with nothing.
//
// A sample each 10 s for 18 hours is 6480 samples of 64 bytes; all together stays below 2 MB.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "daemon/status/status_batch.h"
#include "fleet/coordinate/effects.h"
#include "fleet/drive.h"
#include "fleet/layout.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

/// The power of a plan over its time, drawn down to so many steps a rail that no peak is lost.
struct PlanPower {
  std::uint64_t configuration = 0;
  WallTime at;
  double end_s = 0;
  double rail_limit_W = 0;                       // of each rail; 0: none
  double limit_W = 0;                            // of all rails together; 0: none
  std::map<RailId, std::vector<double>> rail_W;  // the highest power in each even part of the time
  std::vector<double> total_W;                   // likewise
};

/// Pre: the plan was made for `job`. Cost: as Estimate (fleet/estimate.h).
PlanPower PowerOverTime(const Plan& plan, const PlanJob& job, const Layout& layout,
                        std::span<const UnitDrive> drives);

class NightCurves {
 public:
  struct Options {
    std::int64_t period_ns = 10'000'000'000;
    std::size_t samples_max = 6480;
    std::size_t exposures_max = 1000;
    std::size_t plans_max = 1000;
  };
  explicit NightCurves(Options options);
  NightCurves() : NightCurves(Options()) {}

  /// The newest status, of the status thread.
  void Take(const StatusBatch& batch);
  /// The newest plan of a configuration, of the planner's thread.
  void Take(PlanPower power);
  /// The plan of the newest preview, likewise. `plan` is the number that its asker got.
  void TakePreview(std::uint64_t plan, PlanPower power);

  /// All that is newer than an instant: {samples, exposures, plans, power}, as columns. `power` is
  /// the longest plan of the newest configuration over its time. Any thread may ask.
  [[nodiscard]] std::string Text(std::int64_t since_ms) const;
  /// The power of a preview's plan, as `power` above; none: another preview came since, or none
  /// did.
  [[nodiscard]] std::optional<std::string> PreviewText(std::uint64_t plan) const;

 private:
  struct Sample {
    std::int64_t at_ms = 0;
    std::array<std::uint16_t, kUnitPhaseCount> phases{};
    std::uint16_t disabled = 0;
    float load_max = 0;  // of the fullest bus, the most since the sample before
  };
  struct Exposure {
    std::int64_t at_ms = 0;
    std::uint64_t configuration = 0;
    std::uint64_t exposure = 0;
    std::uint32_t measured = 0;
    std::uint32_t unknown = 0;
    float median_um = 0;
    float worst_um = 0;
  };
  struct Peak {
    std::int64_t at_ms = 0;
    std::uint64_t configuration = 0;
    std::map<RailId, float> rail_W;
    float total_W = 0;
  };
  void TakeExposures(const ConfigurationProgressValue& progress);

  const Options options_;
  mutable std::mutex mutex_;
  // ---- under the mutex
  std::deque<Sample> samples_;
  std::deque<Exposure> exposures_;
  std::deque<Peak> peaks_;
  PlanPower power_;
  PlanPower preview_power_;
  std::uint64_t preview_plan_ = 0;  // 0: none
  float load_max_ = 0;
};

}  // namespace focalfleet
