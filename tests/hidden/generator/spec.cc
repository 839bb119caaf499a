#include "tests/hidden/generator/spec.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace focalfleet::hidden {

namespace {

double LogUniform(Rng* rng, double low, double high) {
  return low * std::exp(rng->Uniform() * std::log(high / low));
}

template <class T>
void Shuffle(std::vector<T>* items, Rng* rng) {
  for (std::size_t i = items->size(); i > 1; --i)
    std::swap((*items)[i - 1], (*items)[rng->Below(i)]);
}

std::vector<std::string> Causes(bool foreign) {
  std::vector<std::string> causes;
  for (const EffectKind& kind : Catalogue())
    if (IsForeign(kind) == foreign) causes.emplace_back(kind.cause);
  return causes;
}

struct Slot {
  std::string kind;
  std::uint64_t which = 0;  // its number within its kind in the suite
};

Slot SlotOf(std::uint64_t suite_seed, std::uint64_t index) {
  static constexpr std::array<std::pair<const char*, std::uint64_t>, 4> kShares = {
      {{"null", 4}, {"single", 9}, {"composite", 4}, {"unknown", 3}}};
  std::vector<Slot> block;
  const std::uint64_t blocks = index / 20;
  for (const auto& [kind, share] : kShares)
    for (std::uint64_t i = 0; i < share; ++i) block.push_back({kind, blocks * share + i});
  Rng rng = Rng::Stream(suite_seed, "kinds", blocks);
  Shuffle(&block, &rng);
  return block[index % 20];
}

// The next cause of a shuffled list, which is shuffled anew in every round.
std::string ByTurns(std::uint64_t suite_seed, bool foreign, std::uint64_t which) {
  auto causes = Causes(foreign);
  Rng rng = Rng::Stream(suite_seed, foreign ? "foreign" : "causes", which / causes.size());
  Shuffle(&causes, &rng);
  return causes[which % causes.size()];
}

// Whether the cause can show in the design. Others are not drawn for it.
bool Shows(const std::string& cause, const std::string& design) {
  static const std::vector<std::string> levers = {
      "load_angle_lag", "relaxation",      "supply_droop", "gravity_torque",
      "gravity_sag",    "start_skew",      "stiction",     "mode_threshold",
      "cogging",        "friction_windup", "hard_stop"};
  static const std::vector<std::string> arcs_only_not = {
      "collision_contact", "neighbour_coupling", "camera_similarity",  "plate_gradient",
      "plate_expansion",   "sensor_bias",        "thermal_arm_growth", "air_turbulence",
      "camera_distortion", "supply_drift",       "self_heating",       "thermal_backlash"};
  const auto in = [&](const std::vector<std::string>& list) {
    return std::find(list.begin(), list.end(), cause) != list.end();
  };
  if (design == "arcs") return !in(levers) && !in(arcs_only_not);
  if (design == "survey") return !in(levers) || cause == "gravity_sag" || cause == "gravity_torque";
  return true;
}

double DrawLambda(const std::string& kind, Rng* rng) {
  if (kind == "composite") return LogUniform(rng, 110, 8000);
  if (kind == "unknown") return LogUniform(rng, 100, 8000);
  const double lot = rng->Uniform();
  if (lot < 0.35) return LogUniform(rng, 15, 100);
  return lot < 0.8 ? LogUniform(rng, 100, 2000) : LogUniform(rng, 2000, 30000);
}

void DrawDesign(const std::string& wished, Rng* rng, Spec* spec) {
  const double lot = rng->Uniform();
  std::string design = lot < 0.65 ? "diagnostic" : lot < 0.9 ? "survey" : "arcs";
  if (!wished.empty()) design = wished;
  const bool shows = std::all_of(spec->causes.begin(), spec->causes.end(),
                                 [&](const std::string& cause) { return Shows(cause, design); });
  // Sometimes the design stays: the diagnosis has to report that these moves cannot show the cause.
  if (!shows && wished.empty() && rng->Uniform() < 0.85) design = "diagnostic";
  spec->design.design = design;
  const bool diagnostic = design == "diagnostic";
  spec->design.moves =
      static_cast<std::size_t>(diagnostic ? LogUniform(rng, 120, 250) : LogUniform(rng, 50, 140));
  const double most = std::min(300.0, 18000.0 / static_cast<double>(spec->design.moves));
  spec->design.units = static_cast<std::size_t>(LogUniform(rng, 8, most));
  const double type = rng->Uniform();
  spec->design.type = type < 0.6   ? PositionerType::kEqualLong
                      : type < 0.8 ? PositionerType::kLongPhi
                                   : PositionerType::kEqualShort;
  // Short arms on their pitch hardly meet.
  for (const std::string& cause : spec->causes)
    if (cause == "collision_contact" && spec->design.type == PositionerType::kEqualShort)
      spec->design.type = PositionerType::kLongPhi;
}

void DrawNoise(Rng* rng, Spec* spec) {
  spec->centroid_um = rng->Uniform(1, 3);
  spec->actuation_um = rng->Uniform() < 0.2 ? 0 : rng->Uniform(1, 6);
  const double exact = rng->Uniform();
  if (exact >= 0.3 && exact < 0.95) {
    if (rng->Uniform() < 0.8) spec->static_errors.base_um = rng->Uniform(3, 40);
    if (rng->Uniform() < 0.7) spec->static_errors.arm_um = rng->Uniform(3, 30);
    if (rng->Uniform() < 0.8) spec->static_errors.zero_deg = rng->Uniform(0.02, 0.4);
  }
  spec->sigma_column = rng->Uniform() < 0.75;
  spec->pixel_columns = rng->Uniform() < 0.6;
}

void DrawNuisances(Rng* rng, Spec* spec) {
  Nuisances& n = spec->nuisances;
  const auto with = [&](double chance) { return rng->Uniform() < chance; };
  if (with(0.7)) n.outlier_share = LogUniform(rng, 0.002, 0.02);
  if (with(0.6)) n.missing_share = LogUniform(rng, 0.003, 0.05);
  if (with(0.3)) n.missing_cells = LogUniform(rng, 0.002, 0.03);
  if (with(0.4)) n.tail_freedom = rng->Uniform(3, 6);
  if (with(0.5)) n.unit_spread = rng->Uniform(0.15, 0.5);
  if (with(0.4)) n.picture_spread = rng->Uniform(0.1, 0.4);
  if (with(0.3)) n.turbulence_um = rng->Uniform(0.5, 3);
  n.turbulence_memory = with(0.5) ? rng->Uniform(0.3, 0.8) : 0;
  if (with(0.1)) n.night_shift_um = rng->Uniform(3, 20);
  if (with(0.15)) n.wrapped_units = 1 + static_cast<int>(rng->Below(2));
  if (with(0.1)) n.swapped_pairs = 1;
  if (with(0.2)) n.stuck_units = 1 + static_cast<int>(rng->Below(2));
}

void DropColumns(Rng* rng, Spec* spec) {
  static const std::vector<std::string> all = {
      "temp_C",  "v_bus_V",         "elevation_deg", "movers_on_rail", "delay_s",
      "rail_id", "drive_amplitude", "cycles_theta",  "bus_id",         "t_s"};
  if (rng->Uniform() >= (spec->dirty ? 0.35 : 0.2)) return;
  const std::uint64_t count = 1 + rng->Below(3);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string& column = all[rng->Below(all.size())];
    bool needed = false;
    for (const std::string& cause : spec->causes)
      for (const std::string_view need : FindKind(cause)->columns) needed |= need == column;
    // Sometimes exactly the needed column is dropped: the diagnosis has to report it.
    if (needed && rng->Uniform() < 0.7) continue;
    if (std::find(spec->dropped.begin(), spec->dropped.end(), column) == spec->dropped.end())
      spec->dropped.push_back(column);
  }
}

Status DrawCauses(std::uint64_t suite_seed, const Slot& slot, const Wishes& wishes, Rng* rng,
                  Spec* spec) {
  if (!wishes.cause.empty()) {
    if (FindKind(wishes.cause) == nullptr)
      return Fail(ErrorCode::kInvalid, "no cause is called " + wishes.cause);
    spec->causes = {wishes.cause};
    spec->kind = IsForeign(*FindKind(wishes.cause)) ? "unknown" : "single";
  } else if (spec->kind == "single") {
    spec->causes = {ByTurns(suite_seed, false, slot.which)};
  } else if (spec->kind == "unknown") {
    spec->causes = {ByTurns(suite_seed, true, slot.which)};
  } else if (spec->kind == "composite") {
    const double lot = rng->Uniform();
    const std::size_t count = lot < 0.6 ? 2 : lot < 0.85 ? 3 : 4;
    auto causes = Causes(false);
    Shuffle(&causes, rng);
    for (const std::string& cause : causes)
      if (spec->causes.size() < count && !FindKind(cause)->is_event &&
          cause != "sensor_bias")  // brings the arms' growth along by itself
        spec->causes.push_back(cause);
  }
  const auto has = [&](const char* cause) {
    return std::find(spec->causes.begin(), spec->causes.end(), cause) != spec->causes.end();
  };
  if (has("sensor_bias") && !has("thermal_arm_growth")) {
    spec->causes.emplace_back("thermal_arm_growth");
    spec->kind = "composite";
  }
  return {};
}

}  // namespace

Result<Spec> DrawSpec(std::uint64_t suite_seed, std::uint64_t index, const Wishes& wishes) {
  const Slot slot = SlotOf(suite_seed, index);
  Rng rng = Rng::Stream(suite_seed, "spec", index);
  Spec spec;
  spec.seed = Rng::Stream(suite_seed, "campaign", index).Bits();
  spec.physics = wishes.physics;
  spec.kind = wishes.kind.empty() ? slot.kind : wishes.kind;
  for (const auto& [wish, allowed] :
       {std::pair{spec.kind, std::string(" null single composite unknown ")},
        std::pair{wishes.design, std::string(" survey diagnostic arcs ")},
        std::pair{wishes.purity, std::string(" clean dirty ")}})
    if (!wish.empty() && allowed.find(" " + wish + " ") == std::string::npos)
      return Fail(ErrorCode::kInvalid, "'" + wish + "' is none of" + allowed);
  FOCALFLEET_TRY(DrawCauses(suite_seed, slot, wishes, &rng, &spec));
  for (std::size_t i = 0; i < spec.causes.size(); ++i)
    spec.lambda_wanted.push_back(DrawLambda(spec.kind, &rng));
  if (wishes.lambda > 0)
    for (double& lambda : spec.lambda_wanted) lambda = wishes.lambda;
  DrawDesign(wishes.design, &rng, &spec);
  if (wishes.units > 0) spec.design.units = wishes.units;
  if (wishes.moves > 0) spec.design.moves = wishes.moves;
  DrawNoise(&rng, &spec);
  spec.dirty = rng.Uniform() < (spec.kind == "null" ? 0.5 : 0.3);
  if (!wishes.purity.empty()) spec.dirty = wishes.purity == "dirty";
  if (spec.dirty) DrawNuisances(&rng, &spec);
  if (wishes.cause.empty()) DropColumns(&rng, &spec);
  for (const std::string& cause : spec.causes)
    if (cause == "centroid_bias") spec.pixel_columns = spec.pixel_columns || rng.Uniform() < 0.7;
  return spec;
}

namespace {

Owner DrawOwner(const EffectKind& kind, Rng* rng) {
  // A phase belongs to one gear or magnet; only a lean can be that of the whole plate.
  if (kind.phases > 1 && kind.cause != "axis_tilt") return Owner::kUnit;
  if (kind.owners.size() == 1) return kind.owners[0];
  return kind.owners[rng->Uniform() < 0.7 ? 0 : 1];
}

void DrawConcerned(const Campaign& campaign, Rng* rng, Effect* effect) {
  const std::size_t units = campaign.unit_count();
  effect->weight.assign(units, 0);
  switch (effect->owner) {
    case Owner::kPlate:
    case Owner::kCamera:
      effect->weight.assign(units, 1);
      return;
    case Owner::kRail:
    case Owner::kBus: {
      const bool rail = effect->owner == Owner::kRail;
      const Unit& one = campaign.units[rng->Below(units)];
      for (std::size_t u = 0; u < units; ++u) {
        const Unit& unit = campaign.units[u];
        if (rail ? unit.rail == one.rail : unit.bus == one.bus) effect->weight[u] = 1;
      }
      return;
    }
    case Owner::kUnit:
      break;
  }
  if (rng->Uniform() < 0.4 && !effect->kind->is_event) {  // all, each by an amount of its own
    for (double& weight : effect->weight) weight = std::exp(0.3 * rng->Normal());
    return;
  }
  const std::uint64_t most = std::min<std::uint64_t>(5, 1 + units / 8);
  const std::uint64_t few = 1 + rng->Below(most);
  for (std::uint64_t i = 0; i < few; ++i)
    effect->weight[rng->Below(units)] = std::exp(0.2 * rng->Normal());
}

}  // namespace

Effect DrawEffect(const EffectKind& kind, const Campaign& campaign, Rng* rng) {
  Effect effect;
  effect.kind = &kind;
  effect.axis = kind.axis == AxisUse::kEither ? rng->Below(2) : static_cast<std::size_t>(kTheta);
  effect.owner = DrawOwner(kind, rng);
  effect.seed = rng->Bits();
  for (double& value : effect.shape) value = rng->Uniform();
  effect.size = kind.either_sign && rng->Uniform() < 0.5 ? -1 : 1;
  DrawConcerned(campaign, rng, &effect);
  const double common = rng->Uniform(0, 2 * kPi);
  for (std::size_t u = 0; u < campaign.unit_count(); ++u)
    effect.phase_rad.push_back(effect.owner == Owner::kUnit ? rng->Uniform(0, 2 * kPi) : common);
  if (kind.cause == "identity_swap") {  // a pair; equal weights mark it
    std::fill(effect.weight.begin(), effect.weight.end(), 0.0);
    const std::size_t one = rng->Below(campaign.unit_count());
    const std::size_t other =
        (one + 1 + rng->Below(campaign.unit_count() - 1)) % campaign.unit_count();
    effect.weight[one] = effect.weight[other] = 1;
    effect.size = 1;
  }
  return effect;
}

}  // namespace focalfleet::hidden
