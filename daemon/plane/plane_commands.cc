#include "daemon/plane/plane_commands.h"

#include <string>
#include <utility>
#include <vector>

#include "daemon/plane/plane_table.h"
#include "daemon/verbs/requested_command.h"
#include "fleet/files/line_limit.h"
#include "fleet/files/targets_file.h"
#include "fleet/targets.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

/// Places and drives of all units as their sectors last reported them.
struct Standing {
  std::vector<UnitKnowledge> places;
  std::vector<UnitDrive> drives;
  std::vector<std::uint8_t> known;
};

Standing StandingOf(const PlaneInstant& plane) {
  Standing standing;
  const std::size_t units = plane.plane->layout().size();
  standing.places.resize(units);
  standing.drives.resize(units);
  standing.known.resize(units);
  for (std::uint32_t n = 0; n < units; ++n) {
    const SectorBook::Entry& entry = plane.coordinator->sectors()[plane.plane->SectorOf({n})];
    if (entry.places == nullptr) continue;
    const std::uint32_t local = plane.plane->Local({n}).value;
    standing.places[n] = entry.places->places[local];
    standing.drives[n] = entry.places->drives[local];
    standing.known[n] = 1;
  }
  return standing;
}

/// Errors: kRefused where the unit's drive is not known.
Status CheckKnown(const PlaneInstant& plane, const Standing& standing, PositionerIndex i) {
  if (standing.known[i.value] != 0) return {};
  return Fail(ErrorCode::kRefused,
              "unit " + std::to_string(plane.plane->layout().unit(i).id.value) + " is of " +
                  NameOfSector(plane.plane->SectorOf(i)) +
                  ", which has not said since this coordinator started where its units stand: try "
                  "again when the sector is idle (focalfleet status)");
}

Status CheckCamera(const PlaneInstant& plane) {
  if (plane.has_camera) return {};
  return Fail(ErrorCode::kRefused,
              "there is no camera to measure with: [camera] of the plane's coordinator");
}

Result<PlaneApplyCommand> PlaneApplyOf(const PlaneInstant& plane, const Json& args) {
  PlaneApplyCommand command;
  FOCALFLEET_TRY_ASSIGN(command.measure, MeasureArgument(args));
  if (command.measure) FOCALFLEET_TRY(CheckCamera(plane));
  FOCALFLEET_TRY_ASSIGN(command.source, TextArgumentOr(args, "source", "targets"));
  FOCALFLEET_TRY_ASSIGN(command.fixed, FlagArgumentOr(args, "fixed", false));
  FOCALFLEET_TRY_ASSIGN(const std::string csv,
                        TextArgument(args, "targets_csv", limits::kControlLineBytes));
  FOCALFLEET_TRY(CheckLines(csv, command.source, std::size_t{2} * limits::kUnits));
  FOCALFLEET_TRY_ASSIGN(const Targets targets, ReadTargets(csv, command.source));
  const Layout& layout = plane.plane->layout();
  const Standing standing = StandingOf(plane);
  command.target_ids.resize(layout.size());
  for (const TargetRow& row : targets.rows) {
    const auto i = layout.Find(row.unit);
    if (!i) continue;  // ResolveTargets names it
    command.target_ids[i->value] = row.target_id;
    FOCALFLEET_TRY(CheckKnown(plane, standing, *i));
  }
  FOCALFLEET_TRY_ASSIGN(command.targets,
                        ResolveTargets(targets, layout, standing.drives, standing.places));
  return command;
}

Result<PlaneRetargetCommand> PlaneRetargetOf(const PlaneInstant& plane, const Json& args) {
  const Layout& layout = plane.plane->layout();
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(args, layout));
  Standing standing = StandingOf(plane);
  FOCALFLEET_TRY(CheckKnown(plane, standing, i));
  // The elbow side of the unit is chosen by where the others will stand.
  if (const PlaneConfiguration* under_way = plane.coordinator->under_way())
    for (std::uint32_t n = 0; n < layout.size(); ++n)
      if (const std::optional<Pose>& target = under_way->targets[n])
        standing.places[n] = Exactly(Witness::kReported, *target);
  FOCALFLEET_TRY_ASSIGN(const Pose pose,
                        TargetArgument(args, i, layout, standing.drives, standing.places));
  return PlaneRetargetCommand{i, pose};
}

/// The units whose place is not known and that can be homed now.
std::vector<PositionerIndex> NotKnown(const PlaneInstant& plane) {
  std::vector<PositionerIndex> units;
  const Standing standing = StandingOf(plane);
  for (std::uint32_t n = 0; n < standing.places.size(); ++n) {
    const UnitStatusValue* unit = plane.table->unit({n});
    const bool ready = unit != nullptr &&
                       !plane.table->IsSilent(plane.plane->SectorOf({n}), plane.steady) &&
                       unit->enabled && unit->phase == UnitPhase::kReady;
    if (ready && standing.known[n] != 0 && !IsPlace(standing.places[n])) units.push_back({n});
  }
  return units;
}

Result<PlaneHomeCommand> PlaneHomeOf(const PlaneInstant& plane, const Json& args) {
  PlaneHomeCommand command;
  FOCALFLEET_TRY_ASSIGN(const bool not_known, FlagArgumentOr(args, "not_known", false));
  FOCALFLEET_TRY_ASSIGN(command.unproven, FlagArgumentOr(args, "unproven", false));
  if (not_known) {
    command.units = NotKnown(plane);
    if (command.units.empty())
      return Fail(ErrorCode::kRefused, "every unit that could be homed knows where it stands");
    return command;
  }
  FOCALFLEET_TRY_ASSIGN(const auto ids, UnsignedListArgument(args, "unit_ids"));
  FOCALFLEET_TRY_ASSIGN(command.units, UnitsArgument(plane.plane->layout(), ids));
  return command;
}

/// Why the unit cannot go anywhere now; empty: it can, as far as it alone is concerned.
std::string WhyNotNow(const PlaneInstant& plane, const Standing& standing, PositionerIndex i) {
  const std::uint32_t sector = plane.plane->SectorOf(i);
  const SectorBook& book = plane.coordinator->sectors();
  if (!book.IsUsable(sector)) return NameOfSector(sector) + " " + book[sector].trouble;
  for (const std::uint32_t beyond : plane.plane->beyond(i))
    if (!book.IsUsable(beyond)) return "a sector in its reach takes no part";
  const UnitStatusValue* unit = plane.table->unit(i);
  if (unit == nullptr || plane.table->IsSilent(sector, plane.steady)) return "it is not heard";
  if (!unit->enabled) return "disabled";
  if (unit->phase != UnitPhase::kReady) return std::string("it is ") + Name(unit->phase);
  if (!IsPlace(standing.places[i.value])) return "its place is not known";
  return {};
}

template <class T>
Result<PlaneCommand> AsCommand(Result<T> what) {
  if (!what) return tl::unexpected<Error>(std::move(what).error());
  return PlaneCommand{0, std::move(*what)};
}

}  // namespace

Result<PlanePreview> PlanePreviewOf(const PlaneInstant& plane, const Json& args) {
  if (plane.coordinator->busy())
    return Fail(ErrorCode::kRefused, "configuration " +
                                         std::to_string(plane.coordinator->view().configuration) +
                                         " is under way: stop it or wait until it ends");
  FOCALFLEET_TRY_ASSIGN(const PlaneApplyCommand command, PlaneApplyOf(plane, args));
  const Standing standing = StandingOf(plane);
  PlanePreview made{.preview = {.job = {.purpose = PlanPurpose::kPreview,
                                        .start = standing.places,
                                        .targets = {},
                                        .frozen = {},
                                        .offsets = {},
                                        .options = {}},
                                .refused = {}},
                    .drives = standing.drives};
  PlanJob& job = made.preview.job;
  job.options = plane.options;
  job.options.fixed = command.fixed;
  job.offsets.resize(standing.places.size());
  for (std::uint32_t n = 0; n < standing.places.size(); ++n) {
    std::string why = WhyNotNow(plane, standing, {n});
    const std::optional<Pose>& target = command.targets[n];
    job.frozen.push_back(why.empty() ? 0 : 1);
    job.targets.push_back(why.empty() ? target : std::nullopt);
    if (!target) continue;
    ++made.preview.targeted;
    if (!why.empty()) made.preview.refused.push_back({{n}, std::move(why)});
  }
  return made;
}

bool IsPlaneCommand(const std::string& verb) {
  return verb == "apply" || verb == "home" || verb == "retarget" || verb == "stop" ||
         verb == "measure";
}

Result<PlaneCommand> PlaneCommandOf(const PlaneInstant& plane, const ControlRequest& request) {
  const std::string& verb = request.verb;
  if (verb == "apply") return AsCommand(PlaneApplyOf(plane, request.args));
  if (verb == "home") return AsCommand(PlaneHomeOf(plane, request.args));
  if (verb == "measure") {
    FOCALFLEET_TRY(CheckCamera(plane));
    return PlaneCommand{0, PlaneMeasureCommand{}};
  }
  if (verb == "retarget") return AsCommand(PlaneRetargetOf(plane, request.args));
  return PlaneCommand{0, PlaneStopCommand{}};
}

}  // namespace focalfleet
