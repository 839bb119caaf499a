#include "daemon/soak/liveness.h"

#include <fmt/format.h>

namespace focalfleet::soak {
namespace {

constexpr double kIdentifyS = 40;
constexpr double kConfigurationS = 600;
constexpr int kHomingsMax = 12;

}  // namespace

std::vector<std::uint32_t> Liveness::UnitsThat(
    const std::function<bool(const UnitView&)>& wanted) const {
  std::vector<std::uint32_t> units;
  const Coordinator* const coordinator = parts_.coordinator();
  if (coordinator == nullptr) return units;
  for (std::uint32_t n = 0; n < parts_.layout->size(); ++n)
    if (wanted(coordinator->unit({n}))) units.push_back(parts_.layout->unit({n}).id.value);
  return units;
}

bool Liveness::WaitFor(std::uint64_t request, double seconds) {
  parts_.run(seconds, [&] { return parts_.operators->Answer(request) != nullptr; });
  return parts_.operators->Answer(request) != nullptr;
}

bool Liveness::Settle(double seconds) {
  const auto settled = [this] {
    const Coordinator* const coordinator = parts_.coordinator();
    if (coordinator == nullptr || coordinator->busy()) return false;
    return UnitsThat([](const UnitView& unit) {
             return unit.phase != UnitPhase::kReady && unit.phase != UnitPhase::kFault &&
                    unit.phase != UnitPhase::kForeign;
           })
        .empty();
  };
  parts_.run(seconds, settled);
  return settled();
}

void Liveness::Converge() {
  parts_.run(200, [this] { return parts_.coordinator() != nullptr; });
  if (parts_.coordinator() == nullptr)
    return parts_.judge->Broken("liveness", "the daemon does not start");
  if (!Settle(kConfigurationS)) {
    WaitFor(parts_.operators->Ask("stop", Json::object()), 30);
    if (!Settle(kIdentifyS)) {
      const auto units = UnitsThat([](const UnitView& unit) {
        return unit.phase != UnitPhase::kReady && unit.phase != UnitPhase::kFault &&
               unit.phase != UnitPhase::kForeign;
      });
      std::string which;
      for (const std::uint32_t unit : units)
        which +=
            fmt::format(" {} ({})", unit,
                        Name(parts_.coordinator()->unit(*parts_.layout->Find(UnitId{unit})).phase));
      return parts_.judge->Broken("liveness",
                                  fmt::format("not settled: busy {}, units not asked:{}",
                                              parts_.coordinator()->busy(), which));
    }
  }
  SetRight();
  if (good()) CheckEnd();
}

void Liveness::Pause() {
  parts_.run(3, [] { return false; });
}

void Liveness::ClearFaults() {
  const auto in_fault = UnitsThat(
      [](const UnitView& unit) { return unit.phase == UnitPhase::kFault && unit.enabled; });
  if (in_fault.empty()) return;
  WaitFor(parts_.operators->Ask("enable", {{"unit_ids", in_fault}}), 30);
  Settle(kIdentifyS);
}

/// The operator follows the runbook: units are enabled, hardware is adopted, units are homed.
void Liveness::SetRight() {
  const auto all = [](const UnitView&) { return true; };
  WaitFor(parts_.operators->Ask("enable", {{"unit_ids", UnitsThat(all)}}), 30);
  Settle(kIdentifyS);
  constexpr int kAdoptions = 3;
  for (int n = 0; n < kAdoptions; ++n) {
    for (const std::uint32_t unit :
         UnitsThat([](const UnitView& view) { return view.phase == UnitPhase::kForeign; }))
      WaitFor(parts_.operators->Ask("adopt", {{"unit_id", unit}}), 30);
    Settle(kIdentifyS);
  }
  HomeLost();
}

void Liveness::HomeLost() {
  const auto lost = [this] {
    return UnitsThat([](const UnitView& unit) { return !IsPlace(unit.knowledge); });
  };
  std::vector<std::uint32_t> before = lost();
  int in_vain = 0;
  for (int n = 0; n < kHomingsMax && !before.empty() && good(); ++n) {
    Json args{{"unit_ids", before}, {"wait", true}};
    // Where the proof fails again and again, people look and take the risk.
    if (in_vain >= 2) {
      args["unproven"] = true;
      parts_.judge->RiskTaken(true);
    }
    if (n > 0) Pause();
    ClearFaults();
    parts_.tell(
        fmt::format("{} units are homed{}", before.size(), in_vain >= 2 ? ", unproven" : ""));
    WaitFor(parts_.operators->Ask("home", std::move(args)), kConfigurationS);
    Settle(kConfigurationS);
    std::vector<std::uint32_t> after = lost();
    in_vain = after == before ? in_vain + 1 : 0;
    before = std::move(after);
  }
  if (!before.empty())
    parts_.judge->Broken("liveness", fmt::format("{} units stay lost, unit {} among them",
                                                 before.size(), before.front()));
}

/// Arms that a fault has driven into each other are parted by hand by day. Until then people leave
/// them out, as the runbook says of units that may touch. A fault of one unit drives it into one or
/// two others, and one of all buses does so to some of each. Returns the units that are left out.
std::vector<std::uint32_t> Liveness::LeaveOutTouching() {
  // 10 of 5000 were the most in 40 nights; half of it is that, twice of it hides as many more.
  const std::size_t most = std::max<std::size_t>(6, parts_.layout->size() / 250);
  const std::vector<std::uint32_t> units = parts_.judge->TouchingUnits();
  if (units.empty()) return units;
  parts_.tell(fmt::format("{} units touch, and are left out", units.size()));
  const std::uint64_t request =
      parts_.operators->Ask("disable", {{"unit_ids", units}, {"reason", "they touch"}});
  if (!WaitFor(request, 30) ||
      parts_.operators->Answer(request)->kind == ControlAnswer::Kind::kError)
    parts_.judge->Broken("liveness", "units that touch cannot be disabled");
  if (units.size() > most)
    parts_.judge->Broken("liveness", fmt::format("{} units touch", units.size()));
  return units;
}

/// Units that the answer calls blocked by one of those that were left out, or by nobody in
/// particular and that stand beside one of them.
std::size_t Liveness::BlockedBeside(std::span<const std::uint32_t> left_out,
                                    const nlohmann::json& answer) const {
  const Layout& layout = *parts_.layout;
  return static_cast<std::size_t>(std::ranges::count_if(
      answer.value("unserved", nlohmann::json::array()), [&](const nlohmann::json& unserved) {
        const auto unit = layout.Find({unserved.value("unit_id", 0u)});
        const std::string reason = unserved.value("reason", "");
        if (!unit) return false;
        return std::ranges::any_of(layout.neighbours(*unit), [&](PositionerIndex near) {
          const std::uint32_t id = layout.unit(near).id.value;
          return std::ranges::count(left_out, id) > 0 &&
                 (reason == "blocked" || reason == fmt::format("blocked by unit {}", id));
        });
      }));
}

/// The fleet carries out a configuration whole, and the store, the truth and the answer agree.
void Liveness::CheckEnd() {
  parts_.judge->RiskTaken(false);
  const std::vector<std::uint32_t> left_out = LeaveOutTouching();
  constexpr int kTries = 4;
  std::string why = "no try";
  bool arrived = false;
  for (int n = 0; n < kTries && !arrived && good(); ++n) {
    if (n > 0) {
      // The answer names units in fault and units of unknown place.
      Pause();
      ClearFaults();
      HomeLost();
      if (!good()) return;
    }
    const std::uint64_t request = parts_.operators->Ask(
        "apply", {{"targets_csv", parts_.operators->DrawTargets(1)}, {"wait", true}});
    if (!WaitFor(request, kConfigurationS)) {
      why = "no answer to apply";
      break;
    }
    const ControlAnswer* answer = parts_.operators->Answer(request);
    if (answer->kind == ControlAnswer::Kind::kError) {
      why = answer->error.text;
      continue;
    }
    why = answer->body.dump();
    arrived = answer->body.value("arrived", 0u) + BlockedBeside(left_out, answer->body) ==
              parts_.layout->size() - left_out.size();
  }
  if (good() && !arrived)
    parts_.judge->Broken("liveness", "no configuration is carried out whole: " + why);
  Pause();
  if (!good()) return;
  if (const std::size_t open = parts_.judge->IntentsOpen(); open > 0)
    parts_.judge->Broken("liveness", fmt::format("{} intents stay open", open));
  for (std::size_t row = 0; row < parts_.layout->size(); ++row)
    if (!parts_.judge->HasPlace(row))
      parts_.judge->Broken("liveness", fmt::format("unit {} has no exact place in the store",
                                                   parts_.layout->units()[row].id.value));
}

}  // namespace focalfleet::soak
