#include <fmt/format.h>

#include "daemon/cli/command_line.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table.h"
#include "daemon/study/tune.h"

namespace focalfleet::cli {
namespace {

constexpr int kPaperRepeat = 108;

struct Candidate {
  DriveChoice choice;
  sim::TuningRule rule;
  sim::Tuning tuning;
};

/// No ramp, and the given one.
std::vector<sim::Ramp> RampsOf(const TuneOptions& options) {
  std::vector<sim::Ramp> ramps = {options.rule.ramp};
  if (!options.minimise.empty() && options.rule.ramp.stages > 0) ramps.insert(ramps.begin(), {{}});
  return ramps;
}

std::vector<Candidate> TryAll(const Context& context, const TuneOptions& options,
                              const DriveChoice& given) {
  ProgressBar bar(context);
  const std::vector<DriveChoice> choices = ChoicesOf(options, given);
  const std::vector<sim::Ramp> ramps = RampsOf(options);
  std::vector<Candidate> candidates;
  for (const DriveChoice& choice : choices)
    for (const sim::Ramp& ramp : ramps) {
      sim::TuningRule rule = options.rule;
      rule.ramp = ramp;
      bar.Show(
          static_cast<double>(candidates.size()) /
              static_cast<double>(choices.size() * ramps.size()),
          "tuning",
          fmt::format("{:g} V, {}", choice.setting.bridge.v_bus_V, WordOf(choice.modulation.mode)));
      candidates.push_back({choice, rule, Tune(choice.setting, choice.modulation, rule)});
    }
  return candidates;
}

/// The first of the best candidates; none: all are refused.
const Candidate* Best(const std::vector<Candidate>& candidates, const std::string& minimise) {
  const Candidate* best = nullptr;
  const auto cost = [&](const Candidate& candidate) {
    return minimise == "energy" ? candidate.tuning.move_J : candidate.tuning.move_s;
  };
  for (const Candidate& candidate : candidates) {
    if (candidate.tuning.outcome != sim::TuningOutcome::kTuned) continue;
    if (best == nullptr || cost(candidate) < cost(*best)) best = &candidate;
  }
  return best;
}

Json TuningJson(const Candidate& candidate) {
  const sim::Tuning& tuning = candidate.tuning;
  return {{"outcome", Name(tuning.outcome)},
          {"v_bus_V", candidate.choice.setting.bridge.v_bus_V},
          {"mode", WordOf(candidate.choice.modulation.mode)},
          {"ramp_stages", candidate.rule.ramp.stages},
          {"critical", tuning.critical},
          {"critical_reduced", tuning.critical_reduced},
          {"repeat", tuning.repeat},
          {"margin", tuning.margin},
          {"peak_A", tuning.peak_A},
          {"blocked_peak_A", tuning.blocked_peak_A},
          {"limit_linear_A", tuning.limit_A},
          {"limit_reachable_A", tuning.reachable_A},
          {"peak_share", tuning.peak_share},
          {"copper_W", tuning.copper_W},
          {"winding_C", tuning.winding_C},
          {"resistance_ohm", tuning.resistance_ohm},
          {"move_s", tuning.move_s},
          {"move_J", tuning.move_J}};
}

std::string Describe(const Candidate& best, const Json& margin_at_108) {
  const sim::Tuning& tuning = best.tuning;
  const std::string wound =
      best.rule.winding_K_per_W
          ? fmt::format("{:.1f} degrees Celsius, {:.3f} ohm", tuning.winding_C,
                        tuning.resistance_ohm)
          : fmt::format("20 degrees Celsius, {:.3f} ohm", tuning.resistance_ohm);
  return AlignColumns(
      {{"critical n",
        fmt::format("{} (reduced drive: {})", tuning.critical, tuning.critical_reduced)},
       {"n", fmt::format("{}, margin {:.2f} of the load", tuning.repeat, tuning.margin)},
       {"margin of n = 108",
        margin_at_108.is_null() ? "-" : fmt::format("{:.2f}", margin_at_108.get<double>())},
       {"at", fmt::format("{:g} V, {}, {} ramp stages", best.choice.setting.bridge.v_bus_V,
                          WordOf(best.choice.modulation.mode), best.rule.ramp.stages)},
       {"peak, mA",
        fmt::format("{:.1f} turning, {:.1f} blocked; V/(sqrt3 r) {:.1f}, 2V/(3r) {:.1f}",
                    tuning.peak_A * 1e3, tuning.blocked_peak_A * 1e3, tuning.limit_A * 1e3,
                    tuning.reachable_A * 1e3)},
       {"winding", wound},
       {fmt::format("move of {:g} degrees", best.rule.move_deg),
        fmt::format("{:.2f} s, {:.3f} J", tuning.move_s, tuning.move_J)}});
}

}  // namespace

ExitCode TuneOne(const Context& context, const TuneOptions& options, const DriveChoice& given) {
  const std::vector<Candidate> candidates = TryAll(context, options, given);
  const Candidate* best = Best(candidates, options.minimise);
  if (best == nullptr) {
    const Candidate& first = candidates.front();
    return Report(context,
                  {ErrorCode::kInvalid,
                   fmt::format("no tuning: {}{}",
                               Because(first.tuning.outcome, first.tuning.peak_share,
                                       options.rule.peak_share),
                               candidates.size() > 1 ? "; nor do the other choices serve" : "")});
  }
  Json margin_at_108 = nullptr;
  if (best->choice.setting.motor.load_Nm > 0) {
    sim::Modulation at = best->choice.modulation;
    at.repeat = kPaperRepeat;
    sim::Drive::Setting setting = best->choice.setting;
    setting.motor.resistance_ohm = best->tuning.resistance_ohm;
    margin_at_108 = MarginOf(setting, at);
  }
  if (context.json) {
    Json reported = TuningJson(*best);
    reported["margin_at_108"] = margin_at_108;
    reported["candidates"] = Json::array();
    for (const Candidate& candidate : candidates)
      reported["candidates"].push_back(TuningJson(candidate));
    reported["settings"] = SettingsJson(options.drive, given);
    reported["settings"].erase("repeat");
    PrintJson(reported);
  }
  Say(context, Describe(*best, margin_at_108));
  return ExitCode::kOk;
}

}  // namespace focalfleet::cli
