#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <tuple>

#include "daemon/cli/command_line.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "daemon/store/store.h"
#include "daemon/study/tune.h"
#include "fleet/drive_choice.h"
#include "fleet/files/csv.h"
#include "fleet/files/layout_file.h"
#include "protocol/base/rng.h"

namespace focalfleet::cli {
namespace {

// Limits of a drawn load: this many sigmas, and a twentieth of the mean.
constexpr double kSigmasMax = 4;
constexpr double kLoadShareMin = 0.05;

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

/// The tunings of all loads with one voltage and mode.
struct FleetChoice {
  DriveChoice choice;
  std::vector<sim::LoadTuning> tunings;  // Shape: as the loads
};

/// The choice of an axis, and its tuning there.
struct AxisTuning {
  const DriveChoice* choice;
  sim::LoadTuning tuning;
};

/// The choice of each axis: the voltage of each rail and the mode of each unit. Pre: loads go unit
/// by unit, axis by axis.
std::vector<AxisTuning> ChooseFor(const std::vector<AxisLoad>& loads,
                                  const std::vector<FleetChoice>& all,
                                  const std::string& minimise) {
  std::vector<DriveCandidate> candidates;
  for (const FleetChoice& of : all) {
    DriveCandidate& candidate = candidates.emplace_back();
    candidate.v_bus_V = of.choice.setting.bridge.v_bus_V;
    for (const sim::LoadTuning& tuning : of.tunings)
      candidate.axes.push_back({.tuned = tuning.outcome == sim::TuningOutcome::kTuned,
                                .move_s = tuning.move_s,
                                .move_J = tuning.move_J});
  }
  std::vector<RailId> rails;
  for (std::size_t first = 0; first < loads.size(); first += kAxisCount)
    rails.push_back(loads[first].rail);
  const std::vector<std::size_t> best =
      ChooseDrives(rails, candidates, minimise == "energy" ? Minimise::kEnergy : Minimise::kTime);
  std::vector<AxisTuning> chosen;
  chosen.reserve(loads.size());
  for (std::size_t k = 0; k < loads.size(); ++k) {
    const FleetChoice& of = all[best[k / kAxisCount]];
    chosen.push_back({&of.choice, of.tunings[k]});
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

struct RefusedAxis {
  AxisLoad of;
  std::string why;
};

/// Writes the tunings into the store, in one transaction. Units without a serial number there are
/// refused.
Status WriteStore(const TuneOptions& options, const std::vector<AxisLoad>& loads,
                  const std::vector<AxisTuning>& chosen, std::vector<RefusedAxis>* refused) {
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

/// Axes of each rail by voltage and mode, with time and energy of their moves.
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

}  // namespace

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
  std::vector<RefusedAxis> refused;
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
  for (const RefusedAxis& one : refused) {
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

}  // namespace focalfleet::cli
