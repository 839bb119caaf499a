// StartCheck decides whether the motors of a plan start at all. An estimate knows steady rotation
// only; whether n takes a load along from rest is a question for the drive's model. This layer sees
// both, so the check asks the reduced drive. The load is the one that a tuning found where the
// store has one, else the estimate's own.
#pragma once

#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/cli/context.h"
#include "daemon/cli/offline_fleet.h"
#include "fleet/drive_power.h"
#include "sim/drive/start_study.h"

namespace focalfleet::cli {

struct BelowCritical {
  UnitId unit;
  Axis axis = Axis::kTheta;
  int repeat = 0;
  int critical = 0;  // 0: no n starts the load
};

struct StartVerdict {
  std::size_t axes = 0;              // axes that move
  std::vector<BelowCritical> below;  // ascending by unit
  [[nodiscard]] bool none_starts() const { return axes > 0 && below.size() == axes; }
};

/// Decides for all axes of a plan. Cost: some hundredths of a second for each way in which a motor
/// is driven.
class StartCheck {
 public:
  explicit StartCheck(const MotorModel& motor) : motor_(motor) {}
  StartVerdict Of(const Plan& plan, const OfflineFleet& fleet);

 private:
  using Key = std::tuple<std::uint16_t, std::uint16_t, WaveMode, double>;  // all but n
  int CriticalOf(const Key& feed, double load_Nm);

  MotorModel motor_;
  std::map<Key, sim::CriticalLoads> loads_;
  std::map<std::pair<Key, double>, int> known_;
};

/// The member `below_critical` of the JSON summaries, and a line for human readers after a line
/// break. The line is empty where all motors start.
Json BelowCriticalJson(const StartVerdict& verdict);
std::string DescribeBelowCritical(const StartVerdict& verdict);

}  // namespace focalfleet::cli
