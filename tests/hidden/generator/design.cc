#include "tests/hidden/generator/design.h"

#include <algorithm>
#include <cmath>

namespace focalfleet::hidden {

namespace {

// A move as it is planned for the whole plate; each unit draws its own angles from it.
struct Step {
  enum class Kind : std::uint8_t {
    kTarget,
    kLadder,
    kArc,
    kStay,
    kReturn,
    kRunUp
  } kind = Kind::kTarget;
  std::size_t axis = kTheta;
  double by_deg = 0;  // ladder, arc, unidirectional approach
  double at = -1;     // arc: share of the range, else by_deg
  double drive = 1;
  double movers = 1;   // share of a rail's units
  double delay_s = 0;  // 0: as usual
  bool rehome = false;
  bool permute_slots = false;
  int session = 0;
  double elevation_deg = 60;
};

double Rounded(double angle_deg) { return std::round(angle_deg * 1e4) / 1e4; }

void Ladder(std::size_t axis, std::size_t count, std::vector<Step>* steps) {
  static constexpr double kRungs_deg[] = {0.1, 0.3, 1, 3, 10};
  for (std::size_t i = 0; i < count; ++i) {
    const double rung = kRungs_deg[(i / 4) % 5];
    const double sign = (i / 2) % 2 == 0 ? 1 : -1;  // twice each way: a reversal, then a repeat
    steps->push_back({.kind = Step::Kind::kLadder, .axis = axis, .by_deg = sign * rung});
  }
}

void Arc(std::size_t axis, std::size_t count, std::vector<Step>* steps) {
  const std::size_t half = std::max<std::size_t>(2, count / 2);
  for (std::size_t i = 0; i < 2 * half; ++i) {
    const double there = i < half ? static_cast<double>(i) : static_cast<double>(2 * half - 1 - i);
    steps->push_back(
        {.kind = Step::Kind::kArc, .axis = axis, .at = there / static_cast<double>(half - 1)});
  }
}

void Levers(std::size_t n, Rng* rng, std::vector<Step>* steps) {
  static constexpr double kDrives[] = {0.6, 1, 1.5};
  static constexpr double kMovers[] = {0.05, 0.25, 0.5, 1};
  static constexpr double kDelays_s[] = {3, 30, 100};
  for (std::size_t i = 0; i < n; ++i) steps->push_back({.drive = kDrives[(i + rng->Below(3)) % 3]});
  for (std::size_t i = 0; i < n; ++i)
    steps->push_back({.movers = kMovers[(i + rng->Below(2)) % 4], .permute_slots = true});
  for (std::size_t i = 0; i < n / 4 + 1; ++i) {
    steps->push_back({.delay_s = 0.3});
    for (const double delay : kDelays_s)
      steps->push_back({.kind = Step::Kind::kStay, .delay_s = delay});
  }
  for (std::size_t i = 0; i < n / 3 + 1; ++i) {  // away and back, to see what repeats
    steps->push_back({});
    steps->push_back({.kind = Step::Kind::kReturn});
  }
}

std::vector<Step> Diagnostic(std::size_t moves, Rng* rng) {
  std::vector<Step> all;
  for (int session = 0; session < 3; ++session) {
    std::vector<Step> steps;
    const std::size_t n = moves / 3;
    steps.push_back({.rehome = true});
    Arc(kTheta, n * 18 / 100, &steps);
    Arc(kPhi, n * 18 / 100, &steps);
    Ladder(kTheta, n * 12 / 100 + 2, &steps);
    steps.push_back({});
    Ladder(kPhi, n * 12 / 100 + 2, &steps);
    Levers(std::max<std::size_t>(2, n * 11 / 100), rng, &steps);
    while (steps.size() < n) steps.push_back({});
    static constexpr double kElevations_deg[] = {80, 20, 50};
    const std::size_t turn = rng->Below(3);
    for (std::size_t i = 0; i < steps.size(); ++i) {
      steps[i].session = session;
      steps[i].elevation_deg = kElevations_deg[(i / 5 + turn) % 3];
    }
    all.insert(all.end(), steps.begin(), steps.end());
  }
  while (all.size() < moves) all.push_back({.session = 2});
  all.resize(moves);
  return all;
}

std::vector<Step> Survey(std::size_t moves, Rng* rng) {
  std::vector<Step> all;
  const bool one_sided = rng->Uniform() < 0.35;
  double elevation_deg = rng->Uniform(35, 85);
  while (all.size() < moves) {
    if (rng->Uniform() < 0.2) elevation_deg = rng->Uniform(35, 85);
    const bool home = all.empty() || rng->Uniform() < 0.02;
    all.push_back({.rehome = home, .elevation_deg = elevation_deg});
    if (!one_sided) continue;
    all.push_back({.kind = Step::Kind::kRunUp, .by_deg = 3, .elevation_deg = elevation_deg});
  }
  all.resize(moves);
  return all;
}

std::vector<Step> Arcs(std::size_t moves, Rng* rng) {
  static constexpr double kStrides_deg[] = {8, 15, 22, 30};
  std::vector<Step> all;
  std::size_t axis = rng->Below(2);
  while (all.size() < moves) {
    const double stride = kStrides_deg[rng->Below(4)];
    const double range_deg = axis == kTheta ? 370 : 176;
    const auto half = static_cast<std::size_t>(std::min(10.0, range_deg / stride));
    all.push_back({.axis = axis, .rehome = true});
    for (std::size_t i = 0; i < 2 * half; ++i)
      all.push_back(
          {.kind = Step::Kind::kLadder, .axis = axis, .by_deg = i < half ? stride : -stride});
    axis = 1 - axis;
  }
  all.resize(moves);
  return all;
}

// Conditions of the hall and of the telescope, in time.
struct Climate {
  ByAxis gradient_speed{};
  double start_C = 12;
  double fall_C = 6;
  std::array<double, 3> session_C{};
  double wander_C = 0;
};

Climate DrawClimate(Rng* rng) {
  Climate climate;
  climate.start_C = rng->Uniform(6, 20);
  climate.fall_C = rng->Uniform(2, 9);
  climate.session_C = {rng->Uniform(-5, 3), rng->Uniform(7, 12), rng->Uniform(16, 24)};
  for (std::size_t i = 2; i > 0; --i)
    std::swap(climate.session_C[i], climate.session_C[rng->Below(i + 1)]);
  climate.gradient_speed = {rng->Uniform(0.5, 1.5), rng->Uniform(0.5, 1.5)};
  return climate;
}

void FillExposures(const std::vector<Step>& steps, const std::string& design, Rng* rng,
                   Campaign* campaign) {
  Climate climate = DrawClimate(rng);
  const double gradient = rng->Uniform(0.5, 2.0) / campaign->plate_radius_mm;
  const double phases[] = {rng->Uniform(0, 2 * kPi), rng->Uniform(0, 2 * kPi)};
  double t_s = 0;
  double humidity = rng->Uniform(30, 70);
  double wind = rng->Uniform(0, 6);
  double wander = 0;
  for (std::size_t m = 0; m < steps.size(); ++m) {
    const Step& step = steps[m];
    const bool new_session = m > 0 && step.session != steps[m - 1].session;
    t_s += new_session ? rng->Uniform(3600, 9000) : rng->Uniform(18, 60);
    t_s += step.delay_s;
    wander = 0.95 * wander + 0.08 * rng->Normal();
    humidity = std::clamp(humidity + 2.5 * rng->Normal(), 15.0, 90.0);
    wind = std::clamp(wind + 0.9 * rng->Normal(), 0.0, 14.0);
    Exposure exposure;
    exposure.t_s = std::round(t_s * 10) / 10;
    exposure.elevation_deg = design == "arcs" ? 0 : step.elevation_deg;
    exposure.drive_amplitude = step.drive;
    const double night = climate.start_C - climate.fall_C * (1 - std::exp(-t_s / 5000));
    exposure.air_C =
        (design == "diagnostic" ? climate.session_C[static_cast<std::size_t>(step.session)]
                                : night) +
        wander;
    const double hours = t_s / 3600;
    exposure.gradient_C_per_mm =
        gradient * Place(std::cos(climate.gradient_speed[0] * hours + phases[0]),
                         std::sin(climate.gradient_speed[1] * hours + phases[1]));
    exposure.humidity = humidity;
    exposure.wind_m_s = wind;
    exposure.pump_deg = 360 * std::fmod(t_s / 97.3 + phases[0], 1.0);
    campaign->exposures.push_back(exposure);
  }
}

// The angles of a unit in a step. `before`: its last two poses.
ByAxis Goal(const Step& step, const Unit& unit, const std::array<ByAxis, 2>& before, Rng* rng) {
  ByAxis goal = before[1];
  const auto inside = [&](std::size_t axis, double angle_deg) {
    return Rounded(std::clamp(angle_deg, unit.min_deg[axis], unit.max_deg[axis]));
  };
  const std::size_t axis = step.axis;
  const double range_deg = unit.max_deg[axis] - unit.min_deg[axis];
  switch (step.kind) {
    case Step::Kind::kStay:
      break;
    case Step::Kind::kReturn:
      goal = before[0];
      break;
    case Step::Kind::kLadder:
      goal[axis] = inside(axis, goal[axis] + step.by_deg);
      break;
    case Step::Kind::kRunUp:
      for (std::size_t a = 0; a < kAxes; ++a) goal[a] = inside(a, goal[a] + step.by_deg);
      break;
    case Step::Kind::kArc:  // not on a grid of motor revolutions
      goal[axis] = inside(
          axis, unit.min_deg[axis] + 0.5 + step.at * (range_deg - 1) + rng->Uniform(-0.45, 0.45));
      break;
    case Step::Kind::kTarget:
      goal[kTheta] = inside(kTheta, rng->Uniform(-178, 178));
      goal[kPhi] = inside(kPhi, rng->Uniform(6, 174));
      break;
  }
  return goal;
}

void FillRows(const std::vector<Step>& steps, Rng* rng, Campaign* campaign) {
  const std::size_t units = campaign->unit_count();
  campaign->rows.resize(steps.size() * units);
  const bool arcs = campaign->design == "arcs";
  std::vector<std::array<ByAxis, 2>> pose(units);
  std::vector<ByAxis> cycles(units);
  std::vector<double> rest_s(units, 0.3);
  for (std::size_t u = 0; u < units; ++u)
    cycles[u] = {std::round(rng->Uniform(0, 400)), std::round(rng->Uniform(0, 400))};
  for (std::size_t m = 0; m < steps.size(); ++m) {
    const Step& step = steps[m];
    const double usual_delay_s = std::round(rng->Uniform(0.25, 1.2) * 100) / 100;
    const double since_s = m == 0 ? 0 : campaign->exposures[m].t_s - campaign->exposures[m - 1].t_s;
    for (std::size_t u = 0; u < units; ++u) {
      const Unit& unit = campaign->units[u];
      Row& row = campaign->At(m, u);
      row.rehomed = step.rehome || m == 0;
      if (row.rehomed) pose[u][1] = {unit.min_deg[kTheta], unit.max_deg[kPhi]};
      row.from_deg = pose[u][1];
      const bool moves = step.movers >= 1 || row.rehomed || rng->Uniform() < step.movers;
      row.cmd_deg = moves ? Goal(step, unit, pose[u], rng) : pose[u][1];
      if (arcs &&
          row.rehomed) {  // to the beginning of an arc: the other axis at a place of its own
        row.cmd_deg = {unit.min_deg[kTheta] + 4, unit.max_deg[kPhi]};
        if (step.axis == kPhi) row.cmd_deg = {Rounded(rng->Uniform(-170, 170)), unit.min_deg[kPhi]};
        if (step.axis == kTheta) row.cmd_deg[kPhi] = Rounded(rng->Uniform(20, 150));
      }
      const bool moved = row.Moved(kTheta) || row.Moved(kPhi) || row.rehomed;
      rest_s[u] = moved ? (step.delay_s > 0 ? step.delay_s : usual_delay_s) : rest_s[u] + since_s;
      row.delay_s = std::round(rest_s[u] * 100) / 100;
      for (std::size_t a = 0; a < kAxes; ++a)
        cycles[u][a] += std::abs(row.cmd_deg[a] - row.from_deg[a]) / 360;
      row.cycles = cycles[u];
      pose[u] = {pose[u][1], row.cmd_deg};
      const bool run_up_follows = m + 1 < steps.size() && steps[m + 1].kind == Step::Kind::kRunUp;
      row.exposed = !run_up_follows;
    }
  }
}

void FillSupply(const std::vector<Step>& steps, Rng* rng, Campaign* campaign) {
  const std::size_t units = campaign->unit_count();
  campaign->v_nominal_V = 1.8;
  const double fall = rng->Uniform(0.03, 0.12);
  const double wave = rng->Uniform(0.01, 0.04);
  const double end_s = campaign->exposures.back().t_s;
  std::vector<int> rank(units);
  for (std::size_t m = 0; m < campaign->move_count(); ++m) {
    Exposure& exposure = campaign->exposures[m];
    const double v =
        campaign->v_nominal_V * (1 - fall * exposure.t_s / end_s +
                                 wave * std::sin(exposure.t_s / 1400) + 0.002 * rng->Normal());
    std::vector<int> movers(64, 0);
    std::vector<std::uint64_t> lot(units);
    for (std::size_t u = 0; u < units; ++u) {
      const Row& row = campaign->At(m, u);
      if (row.Moved(kTheta) || row.Moved(kPhi))
        ++movers[static_cast<std::size_t>(campaign->units[u].rail)];
      lot[u] = rng->Bits();
    }
    for (std::size_t u = 0; u < units; ++u) {
      Row& row = campaign->At(m, u);
      row.v_bus_V = std::round(v * 1e4) / 1e4;
      row.movers_on_rail = movers[static_cast<std::size_t>(campaign->units[u].rail)];
      row.temp_C =
          exposure.air_C +
          (std::conj(exposure.gradient_C_per_mm) * campaign->units[u].believed.base_mm).real();
      row.bus_slot = campaign->units[u].bus_slot;
      if (!steps[m].permute_slots) continue;
      int slot = 0;  // the rank of this unit's lot among those of its bus
      for (std::size_t o = 0; o < units; ++o)
        slot += campaign->units[o].bus == campaign->units[u].bus && lot[o] < lot[u] ? 1 : 0;
      row.bus_slot = slot;
    }
  }
}

}  // namespace

Campaign MakeCampaign(const DesignOptions& options, std::uint64_t seed) {
  Rng plate = Rng::Stream(seed, "plate");
  Rng moves = Rng::Stream(seed, "moves");
  Rng climate = Rng::Stream(seed, "climate");
  Rng supply = Rng::Stream(seed, "supply");
  Campaign campaign;
  campaign.design = options.design;
  campaign.units = MakePlate(options.type, options.units, &plate, &campaign.pitch_mm);
  for (const Unit& unit : campaign.units)
    campaign.plate_radius_mm =
        std::max(campaign.plate_radius_mm, std::abs(unit.believed.base_mm) + campaign.pitch_mm / 2);
  campaign.pixel_mm = std::round(plate.Uniform(0.025, 0.06) * 1e5) / 1e5;
  campaign.pixel_origin_mm = {plate.Uniform(-0.03, 0.03), plate.Uniform(-0.03, 0.03)};
  const auto steps = options.design == "survey" ? Survey(options.moves, &moves)
                     : options.design == "arcs" ? Arcs(options.moves, &moves)
                                                : Diagnostic(options.moves, &moves);
  FillExposures(steps, options.design, &climate, &campaign);
  FillRows(steps, &moves, &campaign);
  FillSupply(steps, &supply, &campaign);
  const auto rows = static_cast<double>(campaign.rows.size());
  for (const Row& row : campaign.rows) {
    campaign.temp_mean_C += row.temp_C / rows;
    campaign.v_mean_V += row.v_bus_V / rows;
  }
  return campaign;
}

}  // namespace focalfleet::hidden
