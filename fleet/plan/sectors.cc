#include "fleet/plan/sectors.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <string>

#include "fleet/plan/candidates.h"
#include "fleet/plan/objective.h"
#include "fleet/plan/proof.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

constexpr std::uint32_t kBusesPerSectorMin = 4;  // with fewer buses a sector, buses may be split
constexpr std::uint32_t kNoSector = 0xffffffffu;

std::vector<std::uint32_t> SectorOfUnits(std::size_t units, std::span<const Sector> sectors) {
  std::vector<std::uint32_t> sector_of(units, kNoSector);
  for (std::uint32_t s = 0; s < sectors.size(); ++s)
    for (const PositionerIndex i : sectors[s].own) sector_of[i.value] = s;
  return sector_of;
}

/// Units within so many hops of `own`, without `own`.
std::vector<PositionerIndex> HaloOf(const Layout& layout, std::span<const PositionerIndex> own,
                                    std::uint32_t hops) {
  std::vector<std::uint8_t> seen(layout.size(), 0);
  for (const PositionerIndex i : own) seen[i.value] = 1;
  std::vector<PositionerIndex> halo;
  std::vector<PositionerIndex> rim(own.begin(), own.end());
  for (std::uint32_t hop = 0; hop < hops; ++hop) {
    std::vector<PositionerIndex> next;
    for (const PositionerIndex i : rim)
      for (const PositionerIndex j : layout.neighbours(i)) {
        if (seen[j.value] != 0) continue;
        seen[j.value] = 1;
        next.push_back(j);
      }
    halo.insert(halo.end(), next.begin(), next.end());
    rim = std::move(next);
  }
  std::sort(halo.begin(), halo.end());
  return halo;
}

/// Fills in halos, turns and predecessors of sectors that have only their own units.
void Arrange(const Layout& layout, std::uint32_t hops, std::vector<Sector>* sectors) {
  const auto sector_of = SectorOfUnits(layout.size(), *sectors);
  for (std::uint32_t s = 0; s < sectors->size(); ++s) {
    Sector& sector = (*sectors)[s];
    sector.halo = HaloOf(layout, sector.own, std::max(hops, 1u));
    std::set<std::uint32_t> taken;
    for (const PositionerIndex i : sector.own)
      for (const PositionerIndex j : layout.neighbours(i))
        if (sector_of[j.value] < s) taken.insert((*sectors)[sector_of[j.value]].turn);
    sector.turn = 0;
    while (taken.contains(sector.turn)) ++sector.turn;
  }
  for (Sector& sector : *sectors) {
    std::set<std::uint32_t> after;
    for (const PositionerIndex i : sector.halo)
      if ((*sectors)[sector_of[i.value]].turn < sector.turn) after.insert(sector_of[i.value]);
    sector.after.assign(after.begin(), after.end());
  }
}

/// Units that must stay together: of a bus or a rail, or a single unit.
struct Group {
  double x_mm = 0;  // mean of its bases
  std::vector<PositionerIndex> units;
};

std::vector<Group> GroupsOf(const Layout& layout, const SectorOptions& options) {
  const bool by_bus = layout.buses().size() >= std::size_t{kBusesPerSectorMin} * options.count;
  std::map<std::uint32_t, Group> groups;
  for (std::uint32_t i = 0; i < layout.size(); ++i) {
    const Unit& unit = layout.unit({i});
    const std::uint32_t key = options.whole_rails ? unit.rail.value : by_bus ? unit.bus.value : i;
    groups[key].units.push_back({i});
    groups[key].x_mm += unit.base_fp.x_mm;
  }
  std::vector<Group> list;
  for (auto& [key, group] : groups) {
    group.x_mm /= static_cast<double>(group.units.size());
    list.push_back(std::move(group));
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const Group& a, const Group& b) { return a.x_mm < b.x_mm; });
  return list;
}

/// The part of a request that a sector sees. Indices within are positions in `units`.
struct LocalRequest {
  std::vector<PositionerIndex> units;  // own and halo, ascending
  std::optional<Layout> layout;
  std::vector<UnitDrive> drives;
  std::vector<UnitKnowledge> start;
  std::vector<std::optional<Pose>> targets;
  std::vector<std::uint8_t> frozen;
  std::vector<AxisPaths> motions;
  std::vector<std::uint8_t> given;
  std::vector<Pose> offsets;  // empty where the request has none

  [[nodiscard]] std::uint32_t LocalOf(PositionerIndex unit) const {
    const auto it = std::lower_bound(units.begin(), units.end(), unit);
    return it == units.end() || *it != unit ? kNoSector
                                            : static_cast<std::uint32_t>(it - units.begin());
  }
  [[nodiscard]] PlanRequest request() const {
    const bool any = std::find(given.begin(), given.end(), 1) != given.end();
    return {.layout = &*layout,
            .drives = drives,
            .start = start,
            .targets = targets,
            .frozen = frozen,
            .motions = motions,
            .given = any ? std::span<const std::uint8_t>(given) : std::span<const std::uint8_t>(),
            .offsets = offsets};
  }
};

Result<LocalRequest> LocalOf(const PlanRequest& request, const Sector& sector) {
  LocalRequest local;
  std::merge(sector.own.begin(), sector.own.end(), sector.halo.begin(), sector.halo.end(),
             std::back_inserter(local.units));
  for (const PositionerIndex i : local.units) {
    local.drives.push_back(request.drives[i.value]);
    local.start.push_back(request.start[i.value]);
    local.targets.push_back(request.targets[i.value]);
    local.frozen.push_back(request.frozen[i.value]);
    if (!request.offsets.empty()) local.offsets.push_back(request.offsets[i.value]);
  }
  FOCALFLEET_TRY_ASSIGN(local.layout, request.layout->Part(local.units));
  local.motions.resize(local.units.size());
  local.given.assign(local.units.size(), 0);
  return local;
}

/// Takes the motions of earlier turns and their proposals.
void TakeEarlier(const PlanRequest& request, std::span<const Sector> sectors,
                 std::span<const std::optional<SectorPlan>> plans, std::uint32_t which,
                 LocalRequest* local) {
  const auto sector_of = SectorOfUnits(request.layout->size(), sectors);
  const Sector& sector = sectors[which];
  std::vector<std::uint32_t> after = sector.after;
  // The latest turn has the most information: its proposals replace earlier ones.
  std::stable_sort(after.begin(), after.end(), [&](std::uint32_t a, std::uint32_t b) {
    return sectors[a].turn < sectors[b].turn;
  });
  for (const std::uint32_t s : after) {
    FOCALFLEET_CHECK(plans[s].has_value());
    for (const UnitPlan& proposal : plans[s]->proposals)
      if (sector_of[proposal.unit.value] == which)
        local->motions[local->LocalOf(proposal.unit)] = proposal.path;
    for (const UnitPlan& move : plans[s]->plan.moves)
      if (const std::uint32_t k = local->LocalOf(move.unit); k != kNoSector)
        local->motions[k] = move.path;
  }
  for (const PositionerIndex i : sector.halo) {
    const bool planned =
        std::binary_search(sector.after.begin(), sector.after.end(), sector_of[i.value]);
    if (planned && IsPlace(request.start[i.value])) local->given[local->LocalOf(i)] = 1;
  }
}

double BoundOf(const PlanRequest& request) {
  double bound_s = 0;
  for (std::uint32_t i = 0; i < request.layout->size(); ++i)
    if (request.targets[i] && IsPlace(request.start[i]) && request.frozen[i] == 0)
      bound_s = std::max(
          bound_s,
          Straight(request.drives[i], PlaceOf(request.start[i]), *request.targets[i]).end_s);
  return bound_s;
}

/// The part of these units in the energy of all straight ways.
double EnergyShare(const PlanRequest& request, const PlanOptions& options,
                   std::span<const PositionerIndex> own) {
  PowerLedger ledger(*request.layout, request.drives, options.motor, {}, {});
  const auto energy = [&](PositionerIndex i) {
    if (!request.targets[i.value] || !IsPlace(request.start[i.value])) return 0.0;
    const Pose from = PlaceOf(request.start[i.value]);
    return ledger.Energy(i.value,
                         Straight(request.drives[i.value], from, *request.targets[i.value]).path);
  };
  double all_J = 0;
  double own_J = 0;
  for (std::uint32_t i = 0; i < request.layout->size(); ++i) all_J += energy({i});
  for (const PositionerIndex i : own) own_J += energy(i);
  return all_J > 0 ? own_J / all_J : 1;
}

}  // namespace

Result<std::vector<Sector>> SplitIntoSectors(const Layout& layout, const SectorOptions& options) {
  const std::vector<Group> groups = GroupsOf(layout, options);
  if (options.count == 0 || options.count > groups.size())
    return Fail(ErrorCode::kInvalid,
                std::to_string(options.count) + " sectors: between 1 and " +
                    std::to_string(groups.size()) + " are possible" +
                    (options.whole_rails ? ", with limits of power per rail one a rail" : ""));
  std::vector<Sector> sectors(options.count);
  std::size_t before = 0;
  std::size_t s = 0;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const std::size_t size = groups[g].units.size();
    // The next sector begins where the middle of the group is beyond this sector's even share. The
    // same holds where only one group is left for each of the sectors that follow.
    const bool full = !sectors[s].own.empty() &&
                      (2 * before + size) * options.count > 2 * (s + 1) * layout.size();
    const bool needed = !sectors[s].own.empty() && groups.size() - g == options.count - s - 1;
    if (s + 1 < options.count && (full || needed)) ++s;
    auto& own = sectors[s].own;
    own.insert(own.end(), groups[g].units.begin(), groups[g].units.end());
    before += size;
  }
  for (Sector& sector : sectors) std::sort(sector.own.begin(), sector.own.end());
  Arrange(layout, options.halo_hops, &sectors);
  return sectors;
}

std::vector<Sector> MergeSector(const Layout& layout, const SectorOptions& options,
                                std::span<const Sector> sectors, std::uint32_t which) {
  std::vector<std::uint32_t> one = sectors[which].after;
  one.insert(std::lower_bound(one.begin(), one.end(), which), which);
  std::vector<Sector> merged;
  for (std::uint32_t s = 0; s < sectors.size(); ++s) {
    if (s != one.front() && std::binary_search(one.begin(), one.end(), s)) continue;
    merged.emplace_back();
    merged.back().own = sectors[s].own;
    if (s != one.front()) continue;
    auto& own = merged.back().own;
    for (const std::uint32_t other : one)
      if (other != s) own.insert(own.end(), sectors[other].own.begin(), sectors[other].own.end());
    std::sort(own.begin(), own.end());
  }
  Arrange(layout, options.halo_hops, &merged);
  return merged;
}

Result<SectorPlan> PlanSector(const PlanRequest& request, const PlanOptions& options,
                              std::span<const Sector> sectors,
                              std::span<const std::optional<SectorPlan>> plans,
                              std::uint32_t which) {
  const Sector& sector = sectors[which];
  FOCALFLEET_TRY_ASSIGN(LocalRequest local, LocalOf(request, sector));
  TakeEarlier(request, sectors, plans, which, &local);
  PlanOptions own_options = options;
  own_options.objective = Objective::kSoonest;  // another objective is for the whole plan
  own_options.within_s = std::max(options.within_s, BoundOf(request));
  if (options.power.total_W > 0)
    own_options.power.total_W *= EnergyShare(request, options, sector.own);
  FOCALFLEET_TRY_ASSIGN(Plan made, MakePlan(local.request(), own_options));
  const auto is_own = [&](PositionerIndex i) {
    return std::binary_search(sector.own.begin(), sector.own.end(), i);
  };
  SectorPlan mine;
  mine.plan.too_near = made.too_near;
  for (UnitPlan& move : made.moves) {
    const std::uint32_t k = move.unit.value;
    move.unit = local.units[k];
    move.followers.clear();
    if (is_own(move.unit))
      mine.plan.moves.push_back(std::move(move));
    else if (local.given[k] == 0)
      mine.proposals.push_back(std::move(move));
  }
  for (Unserved unserved : made.unserved) {
    unserved.unit = local.units[unserved.unit.value];
    if (unserved.by) unserved.by = local.units[unserved.by->value];
    if (unserved.proof)
      for (PositionerIndex& wall : unserved.proof->walls) wall = local.units[wall.value];
    if (is_own(unserved.unit)) mine.plan.unserved.push_back(unserved);
  }
  return mine;
}

Result<Plan> JoinSectors(const PlanRequest& request, const PlanOptions& options,
                         std::span<const Sector> sectors,
                         std::span<const std::optional<SectorPlan>> plans) {
  Plan whole;
  for (std::uint32_t s = 0; s < sectors.size(); ++s) {
    FOCALFLEET_CHECK(plans[s].has_value());
    const Plan& plan = plans[s]->plan;
    whole.moves.insert(whole.moves.end(), plan.moves.begin(), plan.moves.end());
    whole.unserved.insert(whole.unserved.end(), plan.unserved.begin(), plan.unserved.end());
    // A pair across a border is named by both sides.
    if (whole.too_near.find(plan.too_near) == std::string::npos)
      whole.too_near += (whole.too_near.empty() ? "" : "; ") + plan.too_near;
  }
  const auto by_unit = [](const auto& a, const auto& b) { return a.unit < b.unit; };
  std::sort(whole.moves.begin(), whole.moves.end(), by_unit);
  std::sort(whole.unserved.begin(), whole.unserved.end(), by_unit);
  const Scene scene = SceneOf(request, whole.moves);
  const std::vector<Track> tracks = TracksOf(scene, request, whole.moves);
  const Proof proof = Prove(scene, tracks, ToleranceOf(options));
  // Within a sector an order may have proven more than this test can see.
  const auto sector_of = SectorOfUnits(scene.size(), sectors);
  std::string text;
  for (const auto& [a, b] : proof.unproven) {
    if (sector_of[a] == sector_of[b]) continue;
    text += (text.empty() ? "units " : "; units ") +
            std::to_string(request.layout->unit({a}).id.value) + " and " +
            std::to_string(request.layout->unit({b}).id.value);
  }
  if (!text.empty())
    return Fail(ErrorCode::kRefused, "not clear of each other across a border: " + text);
  FillPromises(request, options, scene, tracks, proof, &whole);
  return ImprovePlan(request, options, std::move(whole));
}

Result<SectoredPlan> PlanBySectors(const PlanRequest& request, const PlanOptions& options,
                                   const SectorOptions& sectors) {
  FOCALFLEET_TRY(CheckPlanRequest(request, options));
  if (!request.given.empty() || !request.motions.empty())
    return Fail(ErrorCode::kInvalid, "sectors find given motions among themselves");
  if (options.stall_tolerant)
    return Fail(ErrorCode::kInvalid,
                "stages that unseen halts leave clear are of the whole plate: "
                "no sectors");
  SectorOptions split = sectors;
  split.whole_rails = sectors.whole_rails || options.power.rail_W > 0;
  SectoredPlan made;
  FOCALFLEET_TRY_ASSIGN(made.sectors, SplitIntoSectors(*request.layout, split));
  for (;;) {
    std::vector<std::uint32_t> order(made.sectors.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return made.sectors[a].turn < made.sectors[b].turn;
    });
    std::vector<std::optional<SectorPlan>> plans(made.sectors.size());
    std::optional<std::uint32_t> failed;
    for (const std::uint32_t s : order) {
      auto plan = PlanSector(request, options, made.sectors, plans, s);
      if (!plan && (plan.error().code != ErrorCode::kRefused || made.sectors[s].after.empty()))
        return tl::unexpected(plan.error());
      if (!plan) failed = s;
      if (failed) break;
      plans[s] = std::move(*plan);
    }
    if (!failed) {
      FOCALFLEET_TRY_ASSIGN(made.plan, JoinSectors(request, options, made.sectors, plans));
      return made;
    }
    made.sectors = MergeSector(*request.layout, split, made.sectors, *failed);
    ++made.merged;
  }
}

}  // namespace focalfleet
