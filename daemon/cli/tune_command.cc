// tune: the n that each motor needs, by its own load and always from rest; for one motor, or for a
// fleet into the store.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <tuple>

#include "daemon/cli/command_line.h"
#include "daemon/cli/drive_options.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "daemon/store/store.h"
#include "fleet/files/csv.h"
#include "fleet/files/layout_file.h"
#include "protocol/base/rng.h"
#include "sim/drive/tuning/tuning.h"

namespace focalfleet::cli {
namespace {

// A load is drawn within this many sigmas, and never below a twentieth of the mean.
constexpr double kSigmasMax = 4;
constexpr double kLoadShareMin = 0.05;
constexpr int kPaperRepeat = 108;

struct TuneOptions {
  DriveOptions drive;
  sim::TuningRule rule;
  double ramp_stage_ms = 10;
  std::string minimise;         // empty: nothing is chosen
  std::vector<double> rails_V;  // empty: --v-bus
  std::string units;
  std::string loads;
  double load_spread = 0;
  std::uint64_t seed = 1;
  bool full = false;
  std::string store;
  std::string out;
};

// ---- one motor

struct Candidate {
  DriveChoice choice;
  sim::TuningRule rule;
  sim::Tuning tuning;
};

std::string Because(sim::TuningOutcome outcome, double peak_share, double share_max) {
  switch (outcome) {
    case sim::TuningOutcome::kTuned:
      return "";
    case sim::TuningOutcome::kStalls:
      return "the load stalls from rest with every n up to 255";
    case sim::TuningOutcome::kNoMargin:
      return "no n up to 255 starts the load with the margin";
    case sim::TuningOutcome::kPeak:
      return fmt::format("the current reaches {:.1f} % of 2V/(3r), more than {:.1f} %",
                         peak_share * 100, share_max * 100);
  }
  return "";
}

std::vector<DriveChoice> ChoicesOf(const TuneOptions& options, const DriveChoice& given) {
  if (options.minimise.empty()) return {given};
  std::vector<DriveChoice> choices;
  std::vector<double> rails = options.rails_V;
  if (rails.empty()) rails.push_back(options.drive.v_bus_V);
  for (const double v_bus_V : rails)
    for (const std::string& mode : ModeWords()) {
      DriveChoice choice = given;
      choice.setting.bridge.v_bus_V = v_bus_V;
      choice.modulation.mode = ModeOf(mode);
      choices.push_back(choice);
    }
  return choices;
}

// Without a ramp, and with the one that is given.
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

// The first of the best; none: all are refused.
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

// ---- a fleet

struct AxisLoad {
  UnitId unit;
  RailId rail;
  Axis axis = Axis::kTheta;
  double load_Nm = 0;
};

Result<std::vector<AxisLoad>> LoadsOf(const TuneOptions& options, const DriveChoice& choice) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(options.units));
  FOCALFLEET_TRY_ASSIGN(const UnitsFile file, ReadUnits(text, options.units));
  std::vector<AxisLoad> loads;
  for (const Unit& unit : file.units)
    for (const Axis axis : kAxes) {
      Rng rng = Rng::Stream(options.seed, axis == Axis::kTheta ? "load theta" : "load phi",
                            unit.id.value);
      const double off = std::clamp(rng.Normal(), -kSigmasMax, kSigmasMax) * options.load_spread;
      loads.push_back({unit.id, unit.rail, axis,
                       choice.setting.motor.load_Nm * std::max(kLoadShareMin, 1 + off)});
    }
  if (options.loads.empty()) return loads;
  FOCALFLEET_TRY_ASSIGN(const std::string loads_text, ReadTextFile(options.loads));
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(loads_text, options.loads));
  FOCALFLEET_TRY(table.Require({"unit_id", "axis", "load_uNm"}));
  std::vector<bool> given(loads.size(), false);
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const std::int64_t id = row.Integer("unit_id", {0, UINT32_MAX});
    const double load_uNm = row.Number("load_uNm");
    if (!(load_uNm > 0 && load_uNm <= 1000)) row.Reject("load_uNm", "not above 0 and up to 1000");
    const std::string axis = row.Text("axis");
    if (axis != "theta" && axis != "phi") row.Reject("axis", "neither theta nor phi");
    std::size_t at = 0;
    while (at < loads.size() &&
           (static_cast<std::int64_t>(loads[at].unit.value) != id || axis != Name(loads[at].axis)))
      ++at;
    if (at == loads.size()) row.Reject("unit_id", "not in " + options.units);
    if (at < loads.size() && given[at]) row.Reject("unit_id", "this axis is there twice");
    if (row.error()) return;
    given[at] = true;
    loads[at].load_Nm = load_uNm * 1e-6;
  }));
  return loads;
}

// What all loads need with one voltage and mode.
struct FleetChoice {
  DriveChoice choice;
  std::vector<sim::LoadTuning> tunings;  // Shape: as the loads
};

// Which of the choices an axis gets, and what it needs there.
struct AxisTuning {
  const DriveChoice* choice;
  sim::LoadTuning tuning;
};

// Of one unit with one choice: its axes have one mode, and a rail has one voltage.
struct UnitCost {
  int refused = 0;  // axes
  double cost = 0;  // J, or s until both axes are there
  bool operator<(const UnitCost& other) const {
    return std::tie(refused, cost) < std::tie(other.refused, other.cost);
  }
};
UnitCost CostOf(const FleetChoice& of, std::size_t first, const std::string& minimise) {
  UnitCost unit;
  for (std::size_t k = first; k < first + kAxisCount; ++k) {
    const sim::LoadTuning& tuning = of.tunings[k];
    if (tuning.outcome != sim::TuningOutcome::kTuned) {
      ++unit.refused;
      continue;
    }
    unit.cost =
        minimise == "energy" ? unit.cost + tuning.move_J : std::max(unit.cost, tuning.move_s);
  }
  return unit;
}

// The voltage of each rail that costs its units least in sum, and of each unit the mode that costs
// it least there. Fewer axes that are refused come first. Pre: loads go unit by unit, axis by axis.
std::vector<AxisTuning> ChooseFor(const std::vector<AxisLoad>& loads,
                                  const std::vector<FleetChoice>& all,
                                  const std::string& minimise) {
  std::map<std::pair<RailId, double>, UnitCost> rails;
  const auto best_at = [&](std::size_t first, double v_bus_V) {
    const FleetChoice* best = nullptr;
    for (const FleetChoice& of : all) {
      if (of.choice.setting.bridge.v_bus_V != v_bus_V) continue;
      if (best == nullptr || CostOf(of, first, minimise) < CostOf(*best, first, minimise))
        best = &of;
    }
    return best;
  };
  std::set<double> voltages;
  for (const FleetChoice& of : all) voltages.insert(of.choice.setting.bridge.v_bus_V);
  for (std::size_t first = 0; first < loads.size(); first += kAxisCount)
    for (const double v_bus_V : voltages) {
      const UnitCost unit = CostOf(*best_at(first, v_bus_V), first, minimise);
      UnitCost& rail = rails[{loads[first].rail, v_bus_V}];
      rail.refused += unit.refused;
      rail.cost += unit.cost;
    }
  std::map<RailId, double> chosen_V;
  for (const auto& [key, cost] : rails) {
    const auto& [rail, v_bus_V] = key;
    const auto known = chosen_V.find(rail);
    if (known == chosen_V.end() || cost < rails[{rail, known->second}]) chosen_V[rail] = v_bus_V;
  }
  std::vector<AxisTuning> chosen;
  chosen.reserve(loads.size());
  for (std::size_t first = 0; first < loads.size(); first += kAxisCount) {
    const FleetChoice* const best = best_at(first, chosen_V[loads[first].rail]);
    for (std::size_t k = first; k < first + kAxisCount; ++k)
      chosen.push_back({&best->choice, best->tunings[k]});
  }
  return chosen;
}

std::string TunedText(const std::vector<AxisLoad>& loads, const std::vector<AxisTuning>& chosen) {
  CsvWriter csv({"unit_id", "axis", "load_uNm", "outcome", "critical", "repeat", "margin",
                 "peak_share", "counter1", "subdivision", "mode", "v_bus_V", "move_s", "move_J",
                 "origin"});
  for (std::size_t k = 0; k < loads.size(); ++k) {
    const auto& [choice, tuning] = chosen[k];
    const bool tuned = tuning.outcome == sim::TuningOutcome::kTuned;
    csv.Integer(loads[k].unit.value).Text(Name(loads[k].axis)).Number(loads[k].load_Nm * 1e6);
    csv.Text(Name(tuning.outcome));
    if (tuning.critical > 0) csv.Integer(tuning.critical);
    if (tuning.critical == 0) csv.Missing();
    if (tuned) csv.Integer(tuning.repeat).Number(tuning.margin);
    if (!tuned) csv.Missing().Missing();
    csv.Number(tuning.peak_share).Integer(choice->modulation.counter1);
    csv.Integer(choice->modulation.subdivision).Text(Name(choice->modulation.mode));
    csv.Number(choice->setting.bridge.v_bus_V);
    const bool measured = tuned && tuning.move_s > 0;
    if (measured) csv.Number(tuning.move_s).Number(tuning.move_J);
    if (!measured) csv.Missing().Missing();
    csv.Text("tuning").EndRow();
  }
  return csv.Take();
}

struct Refused {
  AxisLoad of;
  std::string why;
};

// What the store takes, as rows of one transaction; who is not bound there has no parameters.
Status WriteStore(const TuneOptions& options, const std::vector<AxisLoad>& loads,
                  const std::vector<AxisTuning>& chosen, std::vector<Refused>* refused) {
  if (!std::filesystem::exists(options.store)) {
    return Fail(ErrorCode::kUnavailable, options.store + ": no such store");
  }
  FOCALFLEET_TRY_ASSIGN(const auto store, Store::Open(options.store));
  FOCALFLEET_TRY_ASSIGN(const StoredFleet stored, store->Load());
  std::map<UnitId, SerialNumber> serial_of;
  for (const StoredFleet::StoredUnit& unit : stored.units) serial_of[unit.unit] = unit.serial;
  std::vector<Row> rows;
  for (std::size_t k = 0; k < loads.size(); ++k) {
    const auto& [choice, tuning] = chosen[k];
    if (tuning.outcome != sim::TuningOutcome::kTuned) continue;
    const SerialNumber serial = serial_of[loads[k].unit];
    if (serial.value == 0) {
      refused->push_back({loads[k], "no serial number is bound to it in the store"});
      continue;
    }
    const auto add = [&](Parameter parameter, int value) {
      rows.emplace_back(ParameterRow{serial, loads[k].axis, parameter, value, Origin::kTuning});
    };
    const sim::Modulation& modulation = choice->modulation;
    add(Parameter::kCounter1, modulation.counter1);
    add(Parameter::kRepeat, tuning.repeat);
    add(Parameter::kSubdivision, modulation.subdivision);
    add(Parameter::kMode, static_cast<int>(modulation.mode));
    rows.emplace_back(TuningRow{.serial = serial,
                                .axis = loads[k].axis,
                                .critical = static_cast<std::uint16_t>(tuning.critical),
                                .repeat = static_cast<std::uint16_t>(tuning.repeat),
                                .margin = tuning.margin,
                                .load_uNm = loads[k].load_Nm * 1e6,
                                .v_bus_V = choice->setting.bridge.v_bus_V,
                                .counter1 = static_cast<std::uint16_t>(modulation.counter1),
                                .subdivision = static_cast<std::uint16_t>(modulation.subdivision),
                                .mode = modulation.mode});
  }
  return store->Commit(rows, WallTime::Now());
}

// How many axes of a rail got which voltage and mode, and what their moves take.
Json ChoicesJson(const std::vector<AxisLoad>& loads, const std::vector<AxisTuning>& chosen) {
  struct Group {
    int axes = 0;
    double move_s_max = 0;
    double move_J = 0;
  };
  std::map<std::tuple<RailId, double, WaveMode>, Group> groups;
  for (std::size_t k = 0; k < loads.size(); ++k) {
    const auto& [choice, tuning] = chosen[k];
    if (tuning.outcome != sim::TuningOutcome::kTuned) continue;
    Group& group = groups[{loads[k].rail, choice->setting.bridge.v_bus_V, choice->modulation.mode}];
    ++group.axes;
    group.move_s_max = std::max(group.move_s_max, tuning.move_s);
    group.move_J += tuning.move_J;
  }
  Json rows = Json::array();
  for (const auto& [key, group] : groups)
    rows.push_back({{"rail_id", std::get<0>(key).value},
                    {"v_bus_V", std::get<1>(key)},
                    {"mode", Name(std::get<2>(key))},
                    {"axes", group.axes},
                    {"move_s_max", group.move_s_max},
                    {"move_J", group.move_J}});
  return rows;
}

std::string DescribeChoices(const Json& choices) {
  std::vector<std::vector<std::string>> rows = {
      {"  rail", "V_bus, V", "mode", "axes", "longest move, s", "all moves, J"}};
  for (const Json& row : choices)
    rows.push_back({fmt::format("  {}", row["rail_id"].get<std::uint32_t>()),
                    fmt::format("{:g}", row["v_bus_V"].get<double>()),
                    row["mode"].get<std::string>(), std::to_string(row["axes"].get<int>()),
                    fmt::format("{:.2f}", row["move_s_max"].get<double>()),
                    fmt::format("{:.1f}", row["move_J"].get<double>())});
  return AlignColumns(rows);
}

ExitCode TuneFleet(const Context& context, const TuneOptions& options, const DriveChoice& choice) {
  const auto loads = LoadsOf(options, choice);
  if (!loads) return Report(context, loads.error());
  std::vector<double> loads_Nm;
  for (const AxisLoad& load : *loads) loads_Nm.push_back(load.load_Nm);
  sim::TuningRule rule = options.rule;
  rule.cross_check = options.full;
  rule.measure_move = !options.minimise.empty();
  std::vector<FleetChoice> all;
  {
    ProgressBar bar(context);
    const std::vector<DriveChoice> choices = ChoicesOf(options, choice);
    for (const DriveChoice& one : choices) {
      const std::string what =
          choices.size() == 1
              ? Count(loads->size(), "axis", "axes")
              : fmt::format("{:g} V, {}", one.setting.bridge.v_bus_V, WordOf(one.modulation.mode));
      all.push_back({one, TuneLoads(one.setting, one.modulation, rule, loads_Nm, [&](double share) {
                       bar.Show((static_cast<double>(all.size()) + share) /
                                    static_cast<double>(choices.size()),
                                "tuning", what);
                     })});
    }
  }
  const std::vector<AxisTuning> chosen = ChooseFor(*loads, all, options.minimise);
  std::vector<Refused> refused;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const sim::LoadTuning& tuning = chosen[k].tuning;
    if (tuning.outcome == sim::TuningOutcome::kTuned) continue;
    refused.push_back({(*loads)[k], Because(tuning.outcome, tuning.peak_share, rule.peak_share)});
  }
  if (!options.store.empty()) {
    const auto written = WriteStore(options, *loads, chosen, &refused);
    if (!written) return Report(context, written.error());
  }
  if (!options.out.empty()) {
    const auto written = WriteFileAtomically(options.out, TunedText(*loads, chosen));
    if (!written) return Report(context, written.error());
  }
  Json named = Json::array();
  std::string lines;
  for (const Refused& one : refused) {
    named.push_back({{"unit_id", one.of.unit.value},
                     {"axis", Name(one.of.axis)},
                     {"load_uNm", one.of.load_Nm * 1e6},
                     {"why", one.why}});
    lines += fmt::format("{}  unit {} {}: {}", lines.empty() ? "" : "\n", one.of.unit.value,
                         Name(one.of.axis), one.why);
  }
  const Json chosen_rows = ChoicesJson(*loads, chosen);
  if (context.json) {
    PrintJson({{"axes", loads->size()},
               {"tuned", loads->size() - refused.size()},
               {"refused", named},
               {"choices", chosen_rows},
               {"settings", SettingsJson(options.drive, choice)},
               {"store", options.store.empty() ? Json(nullptr) : Json(options.store)},
               {"out", options.out.empty() ? Json(nullptr) : Json(options.out)}});
  }
  std::string text = fmt::format("{} of {} tuned", loads->size() - refused.size(),
                                 Count(loads->size(), "axis", "axes"));
  if (!options.minimise.empty()) text += "\n" + DescribeChoices(chosen_rows);
  Say(context, text + (lines.empty() ? "" : "\n") + lines);
  NameUnserved(context, lines);
  return refused.empty() ? ExitCode::kOk : ExitCode::kSomeUnserved;
}

ExitCode RunTune(const Context& context, const TuneOptions& given) {
  TuneOptions options = given;
  options.rule.ramp.stage_s = options.ramp_stage_ms * 1e-3;
  const auto choice = ChoiceOf(options.drive);
  if (!choice) return Report(context, choice.error());
  const bool fleet = !options.units.empty();
  const bool for_fleet = !options.loads.empty() || !options.store.empty() || !options.out.empty();
  if (!fleet && for_fleet) {
    return Report(context, {ErrorCode::kInvalid, "--loads, --store and --out need --units"});
  }
  if (fleet && options.store.empty() && options.out.empty()) {
    return Report(context, {ErrorCode::kInvalid, "a fleet's tuning goes to --store or --out"});
  }
  if (fleet && options.rule.ramp.stages > 0) {
    return Report(context, {ErrorCode::kInvalid,
                            "--ramp-stages is for one motor; units start their moves without"});
  }
  if (!options.rails_V.empty() && options.minimise.empty()) {
    return Report(context, {ErrorCode::kInvalid, "--rails are what --minimise chooses from"});
  }
  if (fleet && choice->setting.motor.load_Nm <= 0) {
    return Report(context, {ErrorCode::kInvalid, "--load 0: nothing is to be tuned"});
  }
  return fleet ? TuneFleet(context, options, *choice) : TuneOne(context, options, *choice);
}

void AddRuleOptions(CLI::App* command, TuneOptions* options) {
  sim::TuningRule& rule = options->rule;
  command
      ->add_option("--margin", rule.margin, "Load that n shall start, beyond its own, as a share")
      ->check(NumberBetween(0, 10))
      ->capture_default_str();
  command
      ->add_option("--peak-share", rule.peak_share,
                   "Of 2V/(3r), that no phase current may exceed, turning or blocked")
      ->check(PositiveNumberUpTo(1))
      ->capture_default_str();
  command->add_option("--move-deg", rule.move_deg, "Move for which time and energy are told")
      ->check(PositiveNumberUpTo(3600))
      ->capture_default_str();
  command->add_option("--ramp-stages", rule.ramp.stages, "Stages of a start")
      ->check(CLI::Range(0, 100).description(""))
      ->capture_default_str();
  command->add_option("--ramp-stage-ms", options->ramp_stage_ms, "How long a stage lasts")
      ->check(PositiveNumberUpTo(1e4))
      ->capture_default_str();
  command
      ->add_option("--winding-K-per-W", rule.winding_K_per_W,
                   "Winding above ambient for a watt of copper losses (default: it stays at 20 C)")
      ->check(PositiveNumberUpTo(1e4));
  command->add_option("--ambient-C", rule.ambient_C, "Where the motor stands")
      ->check(NumberBetween(-50, 100))
      ->capture_default_str();
  OneOf(command->add_option("--minimise", options->minimise,
                            "Choose bus voltage, mode and ramp for this; of a fleet the voltage of "
                            "each rail and the mode of each unit"),
        {"energy", "time"});
  command->add_option("--rails", options->rails_V, "Bus voltages to choose from (default: --v-bus)")
      ->delimiter(',')
      ->check(PositiveNumberUpTo(kBridgeMax_V, " V, which the bridge bears"));
}

void AddFleetOptions(CLI::App* command, TuneOptions* options) {
  AddFile(command, "--units", &options->units, "units.csv: tune both axes of every unit");
  AddFile(command, "--loads", &options->loads,
          "loads.csv: unit_id, axis, load_uNm (default: --load for all)");
  command
      ->add_option("--load-spread", options->load_spread,
                   "Standard deviation of the loads that no file gives, as a share")
      ->check(NumberBetween(0, 1))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Same seed, same loads")->capture_default_str();
  command->add_flag("--full", options->full, "Try every n of a fleet at PWM level, too");
  AddFile(command, "--store", &options->store, "The daemon's store, while no daemon has it");
  AddFile(command, "--out", &options->out, "tuned.csv to write");
}

}  // namespace

void AddTuneCommand(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "tune", "Find the n that motors need, always from rest",
      "  focalfleet tune --v-bus 1.8 --margin 0.5\n"
      "  focalfleet tune --minimise energy --rails 1.8,2.5,3.3 --ramp-stages 4\n"
      "  focalfleet tune --units units.csv --load-spread 0.1 --store /var/lib/focalfleet/fleet.db");
  auto options = std::make_shared<TuneOptions>();
  options->drive.load = "fleet";
  AddBridgeOptions(command, &options->drive);
  AddMotorOptions(command, &options->drive);
  AddRuleOptions(command, options.get());
  AddFleetOptions(command, options.get());
  OnChosen(line, command, options, RunTune);
}

}  // namespace focalfleet::cli
