// The second phase of a night: what is broken is mended, operators do what the runbook says, and
// the fleet must then carry out a configuration.
#include <fmt/format.h>

#include <algorithm>

#include "daemon/soak/night.h"
#include "daemon/soak/virtual_time.h"

namespace focalfleet::soak {
namespace {

constexpr double kIdentifyS = 40;
constexpr double kConfigurationS = 600;
constexpr int kHomingsMax = 12;

}  // namespace

std::vector<std::uint32_t> Night::UnitsThat(
    const std::function<bool(const UnitView&)>& wanted) const {
  std::vector<std::uint32_t> units;
  if (life_ == nullptr) return units;
  for (std::uint32_t n = 0; n < plant_->layout().size(); ++n)
    if (wanted(life_->coordinator().unit({n})))
      units.push_back(plant_->layout().unit({n}).id.value);
  return units;
}

bool Night::WaitFor(std::uint64_t request, double seconds) {
  RunUntil(now_ + Seconds(seconds), [&] { return operators_->Answer(request) != nullptr; });
  return operators_->Answer(request) != nullptr;
}

/// No configuration is under way, and no unit is being asked who it is.
bool Night::Settle(double seconds) {
  const auto settled = [this] {
    if (life_ == nullptr || life_->coordinator().busy()) return false;
    return UnitsThat([](const UnitView& unit) {
             return unit.phase != UnitPhase::kReady && unit.phase != UnitPhase::kFault &&
                    unit.phase != UnitPhase::kForeign;
           })
        .empty();
  };
  RunUntil(now_ + Seconds(seconds), settled);
  return settled();
}

void Night::Converge() {
  Tell("liveness");
  faults_->Heal(now_);
  // The wall clock may be anywhere; people set it right.
  t_virtual_time.wall_less_host_ns =
      std::max(t_virtual_time.wall_less_host_ns, std::int64_t{1'700'000'000'000'000'000});
  RunUntil(now_ + Seconds(200), [this] { return life_ != nullptr; });
  if (life_ == nullptr) return judge_->Broken("liveness", "the daemon does not start");
  if (!Settle(kConfigurationS)) {
    WaitFor(operators_->Ask("stop", Json::object()), 30);
    if (!Settle(kIdentifyS)) {
      const auto units = UnitsThat([](const UnitView& unit) {
        return unit.phase != UnitPhase::kReady && unit.phase != UnitPhase::kFault &&
               unit.phase != UnitPhase::kForeign;
      });
      std::string which;
      for (const std::uint32_t unit : units)
        which += fmt::format(
            " {} ({})", unit,
            Name(life_->coordinator().unit(*plant_->layout().Find(UnitId{unit})).phase));
      return judge_->Broken("liveness", fmt::format("not settled: busy {}, units not asked:{}",
                                                    life_->coordinator().busy(), which));
    }
  }
  SetRight();
  if (judge_->broken().empty()) CheckEnd();
}

/// A person reads an answer before the next command.
void Night::Pause() {
  RunUntil(now_ + Seconds(3), [] { return false; });
}

void Night::ClearFaults() {
  const auto in_fault =
      UnitsThat([](const UnitView& unit) { return unit.phase == UnitPhase::kFault; });
  if (in_fault.empty()) return;
  WaitFor(operators_->Ask("enable", {{"unit_ids", in_fault}}), 30);
  Settle(kIdentifyS);
}

/// The operator follows the runbook: units are enabled, hardware is adopted, units are homed.
void Night::SetRight() {
  const auto all = [](const UnitView&) { return true; };
  WaitFor(operators_->Ask("enable", {{"unit_ids", UnitsThat(all)}}), 30);
  Settle(kIdentifyS);
  constexpr int kAdoptions = 3;
  for (int n = 0; n < kAdoptions; ++n) {
    for (const std::uint32_t unit :
         UnitsThat([](const UnitView& view) { return view.phase == UnitPhase::kForeign; }))
      WaitFor(operators_->Ask("adopt", {{"unit_id", unit}}), 30);
    Settle(kIdentifyS);
  }
  HomeLost();
}

void Night::HomeLost() {
  const auto lost = [this] {
    return UnitsThat([](const UnitView& unit) { return !IsPlace(unit.knowledge); });
  };
  std::vector<std::uint32_t> before = lost();
  int in_vain = 0;
  for (int n = 0; n < kHomingsMax && !before.empty() && judge_->broken().empty(); ++n) {
    Json args{{"unit_ids", before}, {"wait", true}};
    // Where the proof fails again and again, people look and take the risk.
    if (in_vain >= 2) {
      args["unproven"] = true;
      judge_->RiskTaken();
    }
    if (n > 0) Pause();
    ClearFaults();
    Tell(fmt::format("{} units are homed{}", before.size(), in_vain >= 2 ? ", unproven" : ""));
    WaitFor(operators_->Ask("home", std::move(args)), kConfigurationS);
    Settle(kConfigurationS);
    std::vector<std::uint32_t> after = lost();
    in_vain = after == before ? in_vain + 1 : 0;
    before = std::move(after);
  }
  if (!before.empty())
    judge_->Broken("liveness", fmt::format("{} units stay lost, unit {} among them", before.size(),
                                           before.front()));
}

/// Arms that a fault has driven into each other are parted by hand by day. Until then people leave
/// them out, as the runbook says of units that may touch. Returns how many units are left out.
std::size_t Night::LeaveOutTouching() {
  const std::vector<std::uint32_t> units = judge_->TouchingUnits();
  if (units.empty()) return 0;
  Tell(fmt::format("{} units touch, and are left out", units.size()));
  WaitFor(operators_->Ask("disable", {{"unit_ids", units}, {"reason", "they touch"}}), 30);
  return units.size();
}

/// The fleet carries out a configuration whole, and the store, the truth and the answer agree.
void Night::CheckEnd() {
  const std::size_t left_out = LeaveOutTouching();
  constexpr int kTries = 4;
  std::string why = "no try";
  bool arrived = false;
  for (int n = 0; n < kTries && !arrived && judge_->broken().empty(); ++n) {
    if (n > 0) {
      // The answer names units in fault and units of unknown place.
      Pause();
      ClearFaults();
      HomeLost();
      if (!judge_->broken().empty()) return;
    }
    const std::uint64_t request =
        operators_->Ask("apply", {{"targets_csv", operators_->DrawTargets(1)}, {"wait", true}});
    if (!WaitFor(request, kConfigurationS)) {
      why = "no answer to apply";
      break;
    }
    const ControlAnswer* answer = operators_->Answer(request);
    if (answer->kind == ControlAnswer::Kind::kError) {
      why = answer->error.text;
      continue;
    }
    why = answer->body.dump();
    arrived = answer->body.value("arrived", 0u) == plant_->layout().size() - left_out;
  }
  if (judge_->broken().empty() && !arrived)
    judge_->Broken("liveness", "no configuration is carried out whole: " + why);
  Pause();
  if (!judge_->broken().empty()) return;
  if (const std::size_t open = judge_->IntentsOpen(); open > 0)
    judge_->Broken("liveness", fmt::format("{} intents stay open", open));
  for (std::size_t row = 0; row < plant_->layout().size(); ++row)
    if (!judge_->OffPlace(row))
      judge_->Broken("liveness", fmt::format("unit {} has no exact place in the store",
                                             plant_->layout().units()[row].id.value));
}

}  // namespace focalfleet::soak
