#include "daemon/cli/offline_fleet.h"

#include <fmt/format.h>

#include <map>

#include "daemon/cli/command_line.h"
#include "daemon/cli/table_input.h"
#include "daemon/store/store_reader.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/obstacles_file.h"
#include "fleet/files/state_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/sectors.h"
#include "fleet/targets.h"

namespace focalfleet::cli {
namespace {

std::vector<UnitKnowledge> KnowledgeOf(const StatePoses& state) {
  std::vector<UnitKnowledge> knowledge(state.size());
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state[i]) knowledge[i] = Exactly(Witness::kReported, *state[i]);
  }
  return knowledge;
}

Result<Plan> PlanOf(const PlanRequest& request, const PlanOptions& options, std::uint32_t wanted,
                    std::uint32_t* sectors) {
  if (wanted <= 1) return MakePlan(request, options);
  FOCALFLEET_TRY_ASSIGN(SectoredPlan made, PlanBySectors(request, options, {.count = wanted}));
  *sectors = static_cast<std::uint32_t>(made.sectors.size());
  return std::move(made.plan);
}

}  // namespace

void AddFleetFiles(CLI::App* command, FleetFiles* files) {
  AddFile(command, "--units", &files->units, "units.csv: the focal plane")->required();
  AddFile(command, "--obstacles", &files->obstacles,
          "obstacles.csv: what stands still on the plate");
  command
      ->add_option("--clearance-mm", files->clearance_mm,
                   "Distance to keep between arms (default: 0.012 of the pitch)")
      ->check(NumberBetween(0, 1000));
}

void AddTunedStore(CLI::App* command, std::string* store) {
  AddFile(command, "--store", store,
          "The daemon's store: units have the parameters and loads that were tuned");
}

Status TakeTuned(const std::string& store, OfflineFleet* fleet) {
  if (store.empty()) return {};
  FOCALFLEET_TRY_ASSIGN(const auto reader, StoreReader::Open(store));
  FOCALFLEET_TRY_ASSIGN(const StoredFleet stored, reader->Load());
  std::map<SerialNumber, PositionerIndex> place_of;
  for (const StoredFleet::StoredUnit& unit : stored.units)
    if (const auto i = fleet->layout.Find(unit.unit); i && unit.serial.value != 0)
      place_of[unit.serial] = *i;
  for (const ParameterRow& row : stored.parameters) {
    const auto place = place_of.find(row.serial);
    if (place == place_of.end()) continue;
    TakeParameter(row, &fleet->drives[place->second.value]);
  }
  fleet->tunings.resize(fleet->layout.size());
  for (const TuningRow& row : stored.tunings) {
    const auto place = place_of.find(row.serial);
    if (place == place_of.end()) continue;
    fleet->tunings[place->second.value][Index(row.axis)] = row;
    fleet->drives[place->second.value].v_bus_V = row.v_bus_V;
  }
  return {};
}

Result<OfflineFleet> LoadFleet(const Context& context, const FleetFiles& files) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTable(context, files.units, "unit_id"));
  Layout::Options options{.clearance_mm = files.clearance_mm};
  if (!files.obstacles.empty()) {
    FOCALFLEET_TRY_ASSIGN(const std::string obstacles,
                          ReadTable(context, files.obstacles, "obstacle_id"));
    FOCALFLEET_TRY_ASSIGN(options.obstacles, ReadObstacles(obstacles, files.obstacles));
  }
  // Ignored columns are reported: a misspelt column would otherwise be ignored without a message.
  FOCALFLEET_TRY_ASSIGN(const UnitsFile units, ReadUnits(text, files.units));
  ReportPassedOver(context, files.units, units.ignored_columns);
  FOCALFLEET_TRY_ASSIGN(Layout layout, ReadLayout(text, files.units, std::move(options)));
  std::vector<UnitDrive> drives(layout.size());
  return OfflineFleet{std::move(layout), std::move(drives)};
}

Result<StatePoses> LoadState(const std::string& path, const OfflineFleet& fleet,
                             WhoseState required) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(path, "unit_id"));
  FOCALFLEET_TRY_ASSIGN(StatePoses poses, ReadState(text, path, fleet.layout, fleet.drives));
  FOCALFLEET_TRY(RequirePoses(path, fleet.layout, poses, required));
  return poses;
}

namespace {

/// The changes that compensation makes to a request.
struct Reported {
  std::vector<Pose> offsets;  // Shape: (n)
  std::size_t compensated = 0;
  std::vector<PositionerIndex> beyond_range;
};

bool CanCount(const Unit& unit, const UnitDrive& drive, const Pose& place, const Pose& offset) {
  return InRange(unit, drive, {place[0] - offset[0], place[1] - offset[1]});
}

/// Converts `state` and `targets` from counts to positions by the model.
Reported ReportByModel(const Compensation& compensation, const OfflineFleet& fleet,
                       StatePoses* state, StatePoses* targets) {
  Reported reported{
      .offsets = std::vector<Pose>(fleet.layout.size()), .compensated = 0, .beyond_range = {}};
  for (std::uint32_t i = 0; i < fleet.layout.size(); ++i) {
    const Unit& unit = fleet.layout.unit({i});
    auto& target = (*targets)[i];
    auto& stands = (*state)[i];
    if (!unit.enabled || !target || !stands) continue;
    const auto offset = compensation.OffsetFor(
        {i}, {.unit = &unit, .drive = &fleet.drives[i], .place = *stands}, *target);
    if (!offset) continue;
    if (!CanCount(unit, fleet.drives[i], *target, *offset)) {
      reported.beyond_range.push_back({i});
      target.reset();
      continue;
    }
    ++reported.compensated;
    reported.offsets[i] = *offset;
    for (const Axis axis : kAxes) (*stands)[Index(axis)] += (*offset)[Index(axis)];
  }
  return reported;
}

}  // namespace

Result<OfflinePlan> PlanOffline(const Context& context, const OfflineFleet& fleet,
                                const StatePoses& state, const PlanFiles& files) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTable(context, files.targets, "unit_id"));
  FOCALFLEET_TRY_ASSIGN(const Targets targets, ReadTargets(text, files.targets));
  ReportPassedOver(context, files.targets, targets.ignored_columns);
  FOCALFLEET_TRY_ASSIGN(StatePoses poses,
                        ResolveTargets(targets, fleet.layout, fleet.drives, KnowledgeOf(state)));
  StatePoses places = state;
  Reported reported;
  PlanOptions options = files.plan;
  if (files.compensation != nullptr) {
    reported = ReportByModel(*files.compensation, fleet, &places, &poses);
    // Two units that are clear of each other by their counts may be nearer by the model.
    options.lead_apart = true;
  }
  std::vector<std::uint8_t> frozen(fleet.layout.size());
  for (std::uint32_t i = 0; i < frozen.size(); ++i) {
    frozen[i] = fleet.layout.unit({i}).enabled ? 0 : 1;
  }
  OfflinePlan made{.plan = {},
                   .targets = {},
                   .targeted = targets.rows.size(),
                   .compensated = reported.compensated,
                   .beyond_range = std::move(reported.beyond_range)};
  auto plan = PlanOf({.layout = &fleet.layout,
                      .drives = fleet.drives,
                      .start = KnowledgeOf(places),
                      .targets = poses,
                      .frozen = frozen,
                      .offsets = reported.offsets},
                     options, files.sectors, &made.sectors);
  if (!plan) {
    return Fail(plan.error().code,
                fmt::format("{} from {}: {}", files.targets, files.from, plan.error().text));
  }
  made.plan = std::move(*plan);
  made.targets = std::move(poses);
  return made;
}

namespace {

Json ProofJson(const std::optional<NoWay>& proof, const Layout& layout) {
  if (!proof) return nullptr;
  Json walls = Json::array();
  for (const PositionerIndex unit : proof->walls) walls.push_back(layout.unit(unit).id.value);
  return {{"grid_deg", proof->grid_deg}, {"walls", walls}, {"obstacle", proof->obstacle}};
}

}  // namespace

Json UnservedJson(const Plan& plan, const Layout& layout) {
  Json rows = Json::array();
  for (const Unserved& unserved : plan.unserved) {
    Json by = nullptr;
    if (unserved.by) by = layout.unit(*unserved.by).id.value;
    rows.push_back({{"unit_id", layout.unit(unserved.unit).id.value},
                    {"why", Name(unserved.why)},
                    {"by", by},
                    {"proof", ProofJson(unserved.proof, layout)}});
  }
  return rows;
}

std::string DescribeUnserved(const Json& unserved) {
  std::string text;
  for (const Json& row : unserved) {
    text += fmt::format("\n  unit {}: {}", row["unit_id"].get<std::uint32_t>(),
                        row["why"].get<std::string>());
    if (!row["by"].is_null()) text += fmt::format(" (unit {})", row["by"].get<std::uint32_t>());
    if (row["proof"].is_null()) continue;
    std::string walls = row["proof"]["obstacle"].get<bool>() ? ", what stands" : "";
    for (const Json& unit : row["proof"]["walls"])
      walls += fmt::format(", unit {}", unit.get<std::uint32_t>());
    text += fmt::format("; proven: no way leads past {}",
                        walls.empty() ? "its range" : walls.substr(2));
  }
  return text;
}

}  // namespace focalfleet::cli
