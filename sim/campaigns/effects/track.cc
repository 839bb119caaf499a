#include "sim/campaigns/effects/track.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <numeric>

#include "protocol/base/units.h"
#include "sim/campaigns/effects/arm_gap.h"
#include "sim/campaigns/effects/closed_loop.h"
#include "sim/campaigns/effects/harness.h"

namespace focalfleet::sim {
namespace {

constexpr double kMissingShareMax = 0.5;
constexpr std::size_t kNeighboursMax = 6;

double MedianOf(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Ranks are against at most some kSamples of the values, which is fine enough for a smooth curve.
void Rank(FilledColumn* column) {
  constexpr std::size_t kSamples = 2048;
  const std::size_t rows = column->values.size();
  const std::size_t stride = std::max<std::size_t>(1, rows / kSamples);
  const auto samples = static_cast<double>((rows + stride - 1) / stride);
  std::vector<std::pair<double, std::size_t>> ascending;
  ascending.reserve(rows);
  for (std::size_t row = 0; row < rows; ++row) ascending.emplace_back(column->values[row], row);
  std::sort(ascending.begin(), ascending.end());
  column->rank.resize(rows);
  double below = 0;
  for (std::size_t begin = 0, end = 0; begin < rows; begin = end) {
    double upto = below;
    for (; end < rows && ascending[end].first == ascending[begin].first; ++end)
      if (ascending[end].second % stride == 0) upto += 1;
    for (std::size_t k = begin; k < end; ++k)
      column->rank[ascending[k].second] = static_cast<float>((below + upto) / 2 / samples);
    below = upto;
  }
}

// The exposure's value, where all units that have one agree; NaN elsewhere. Shape: (exposures).
std::vector<double> CommonValues(std::span<const double> raw, const Exposures& exposures) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> low(exposures.size(), kNone), high(exposures.size(), kNone);
  for (std::size_t row = 0; row < raw.size(); ++row) {
    if (!std::isfinite(raw[row])) continue;
    const std::size_t e = exposures.of_row[row];
    low[e] = std::isfinite(low[e]) ? std::min(low[e], raw[row]) : raw[row];
    high[e] = std::isfinite(high[e]) ? std::max(high[e], raw[row]) : raw[row];
  }
  for (std::size_t e = 0; e < low.size(); ++e)
    if (low[e] != high[e]) low[e] = kNone;
  return low;
}

// Fills the gaps along one unit's rows by a straight line from the value before to the value after.
void Interpolate(std::span<double> values) {
  std::size_t before = values.size();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    const std::size_t begin = before == values.size() ? 0 : before + 1;
    const double left = before == values.size() ? values[i] : values[before];
    const auto gap = static_cast<double>(i - begin + 1);
    for (std::size_t k = begin; k < i; ++k)
      values[k] = left + (values[i] - left) * static_cast<double>(k - begin + 1) / gap;
    before = i;
  }
  if (before == values.size()) return;
  for (std::size_t k = before + 1; k < values.size(); ++k) values[k] = values[before];
}

FilledColumn Fill(std::span<const double> raw, const Campaign& campaign,
                  const Exposures& exposures) {
  FilledColumn column;
  std::vector<double> known;
  for (const double value : raw)
    if (std::isfinite(value)) known.push_back(value);
  column.missing_share = 1 - static_cast<double>(known.size()) /
                                 static_cast<double>(std::max<std::size_t>(raw.size(), 1));
  if (known.empty()) return column;
  column.low = *std::min_element(known.begin(), known.end());
  column.high = *std::max_element(known.begin(), known.end());
  column.first = known.front();
  column.mean =
      std::accumulate(known.begin(), known.end(), 0.0) / static_cast<double>(known.size());
  column.values.assign(raw.begin(), raw.end());
  if (column.missing_share > 0) {
    const std::vector<double> common = CommonValues(raw, exposures);
    for (std::size_t row = 0; row < raw.size(); ++row)
      if (!std::isfinite(raw[row])) column.values[row] = common[exposures.of_row[row]];
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
      Interpolate(std::span(column.values)
                      .subspan(campaign.first_row[unit],
                               campaign.first_row[unit + 1] - campaign.first_row[unit]));
    const double median = MedianOf(known);
    for (double& value : column.values)
      if (!std::isfinite(value)) value = median;
  }
  Rank(&column);
  return column;
}

void FindPlate(const Campaign& campaign, CampaignFacts* facts) {
  facts->radius_mm = 1;
  std::vector<double> nearest;
  for (const CampaignUnit& unit : campaign.units) {
    facts->radius_mm = std::max(facts->radius_mm, std::hypot(unit.base_x_mm, unit.base_y_mm));
    if (campaign.units.size() < 2 || nearest.size() >= 200) continue;
    double least_mm2 = std::numeric_limits<double>::infinity();
    for (const CampaignUnit& other : campaign.units) {
      const double dx_mm = unit.base_x_mm - other.base_x_mm;
      const double dy_mm = unit.base_y_mm - other.base_y_mm;
      if (&other != &unit) least_mm2 = std::min(least_mm2, dx_mm * dx_mm + dy_mm * dy_mm);
    }
    nearest.push_back(std::sqrt(least_mm2));
  }
  facts->pitch_mm = MedianOf(nearest);
}

// A command that is written a whole turn off moves the axis as the short one does.
double StepOf(double from_deg, double cmd_deg) {
  const double step_deg = cmd_deg - from_deg;
  const double turns = std::round(step_deg / kTurnDeg);
  // Real moves may be a whole turn long. Longer ones are a slip of the table.
  return std::abs(step_deg) > 1.5 * kTurnDeg ? step_deg - turns * kTurnDeg : step_deg;
}

void FindHistory(const Campaign& campaign, CampaignFacts* facts) {
  const std::size_t rows = campaign.rows();
  const std::span<const double> rehomed = campaign.Find("rehomed");
  facts->restarts.assign(rows, 0);
  for (std::size_t row = 0; row < rows; ++row)
    if (!rehomed.empty() && rehomed[row] > 0.5) {
      facts->restarts[row] = 1;
      ++facts->homings;
    }
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const std::size_t first = campaign.first_row[unit];
    if (first == campaign.first_row[unit + 1]) continue;
    if (facts->restarts[first] != 0) --facts->homings;
    facts->restarts[first] = 1;
  }
  const std::span<const double> measured = campaign.Find("from_measured");
  for (std::size_t row = 0; row < measured.size(); ++row) {
    if (!(measured[row] > 0.5)) continue;
    facts->closed.resize(rows, 0);
    facts->closed[row] = 1;
  }
  for (const std::size_t axis : {kTheta, kPhi}) {
    facts->step_deg[axis].resize(rows);
    for (std::size_t row = 0; row < rows; ++row)
      facts->step_deg[axis][row] =
          StepOf(campaign.from_deg[axis][row], campaign.cmd_deg[axis][row]);
  }
}

// Normal equations of a plane over the plate, one for each exposure.
struct PlaneSums {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, t = 0, xt = 0, yt = 0;
  double least = std::numeric_limits<double>::infinity();
  double most = -std::numeric_limits<double>::infinity();
};

std::array<double, 2> Slope(const PlaneSums& s) {
  if (s.n < 6 || s.most - s.least < 1e-6) return {0, 0};
  const double xx = s.xx - s.x * s.x / s.n, yy = s.yy - s.y * s.y / s.n;
  const double xy = s.xy - s.x * s.y / s.n;
  const double xt = s.xt - s.x * s.t / s.n, yt = s.yt - s.y * s.t / s.n;
  const double determinant = xx * yy - xy * xy;
  if (!(determinant > 1e-9 * xx * yy)) return {0, 0};
  return {(yy * xt - xy * yt) / determinant, (xx * yt - xy * xt) / determinant};
}

void FindGradients(const Campaign& campaign, CampaignFacts* facts) {
  const FilledColumn* temperature = facts->Find("temp_C");
  if (temperature == nullptr || campaign.units.size() < 6) return;
  std::vector<PlaneSums> sums(facts->exposures.size());
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const double x = campaign.units[unit].base_x_mm;
    const double y = campaign.units[unit].base_y_mm;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      PlaneSums& s = sums[facts->exposures.of_row[row]];
      const double t = temperature->values[row];
      s.n += 1, s.x += x, s.y += y, s.xx += x * x, s.xy += x * y, s.yy += y * y;
      s.t += t, s.xt += x * t, s.yt += y * t;
      s.least = std::min(s.least, t), s.most = std::max(s.most, t);
    }
  }
  std::vector<double> gradient[2] = {std::vector<double>(campaign.rows()),
                                     std::vector<double>(campaign.rows())};
  bool any = false;
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    const auto slope = Slope(sums[facts->exposures.of_row[row]]);
    gradient[0][row] = slope[0];
    gradient[1][row] = slope[1];
    any = any || slope[0] != 0 || slope[1] != 0;
  }
  if (!any) return;
  facts->columns[std::string(kGradientX)] = Fill(gradient[0], campaign, facts->exposures);
  facts->columns[std::string(kGradientY)] = Fill(gradient[1], campaign, facts->exposures);
}

// The first few units within reach of each unit that has rows, in the order of the table. The
// window along x keeps the cost far below that of all pairs.
std::vector<std::vector<std::size_t>> NeighboursOf(const Campaign& campaign, double reach_mm) {
  const std::vector<CampaignUnit>& units = campaign.units;
  std::vector<std::size_t> by_x(units.size());
  std::iota(by_x.begin(), by_x.end(), std::size_t{0});
  const auto x_mm = [&](std::size_t unit) { return units[unit].base_x_mm; };
  std::ranges::sort(by_x, {}, x_mm);
  std::vector<std::vector<std::size_t>> neighbours(units.size());
  for (std::size_t u = 0; u < units.size(); ++u) {
    if (campaign.first_row[u] == campaign.first_row[u + 1]) continue;
    std::vector<std::size_t>& near = neighbours[u];
    for (auto at = std::ranges::lower_bound(by_x, x_mm(u) - reach_mm, {}, x_mm);
         at != by_x.end() && x_mm(*at) <= x_mm(u) + reach_mm; ++at) {
      const double dx = x_mm(u) - x_mm(*at);
      const double dy = units[u].base_y_mm - units[*at].base_y_mm;
      if (u != *at && dx * dx + dy * dy < reach_mm * reach_mm) near.push_back(*at);
    }
    std::ranges::sort(near);
    near.resize(std::min(near.size(), kNeighboursMax));
  }
  return neighbours;
}

void AddModes(const Campaign& campaign, CampaignFacts* facts) {
  const auto words = std::ranges::find(campaign.word_columns, kMode, &WordColumn::name);
  if (words == campaign.word_columns.end()) return;
  std::vector<double> modes;
  for (const int word : words->values) {
    const auto known =
        word < 0 ? std::end(kDriveModes)
                 : std::ranges::find(kDriveModes, words->words[static_cast<std::size_t>(word)]);
    modes.push_back(known == std::end(kDriveModes)
                        ? std::numeric_limits<double>::quiet_NaN()
                        : static_cast<double>(known - std::begin(kDriveModes)));
  }
  FilledColumn column = Fill(modes, campaign, facts->exposures);
  if (column.missing_share <= kMissingShareMax)
    facts->columns[std::string(kMode)] = std::move(column);
}

// The pull is the sum of sin(psi_u - psi_v) (pitch / distance)^3 over the neighbours, with psi the
// motor's angle.
void FindNeighbourPull(const Campaign& campaign, CampaignFacts* facts) {
  if (campaign.units.size() < 2) return;
  for (const auto& [axis, name] : {std::pair(kTheta, kNeighbourTheta), {kPhi, kNeighbourPhi}}) {
    std::vector<double> pull(campaign.rows());
    for (std::size_t u = 0; u < campaign.units.size(); ++u)
      for (const std::size_t v : facts->neighbours[u])
        for (const PullingPair& pair : PullOf(*facts, u, v, axis))
          pull[pair.row] += pair.nearness * std::sin(pair.angle_rad);
    facts->columns[std::string(name)] = Fill(pull, campaign, facts->exposures);
  }
}

void FindContacts(const Campaign& campaign, CampaignFacts* facts) {
  if (campaign.units.size() < 2) return;
  const ArmGaps gaps = FindArmGaps(campaign, facts->exposures, facts->neighbours, facts->pitch_mm);
  if (*std::min_element(gaps.gap_mm.begin(), gaps.gap_mm.end()) > kThickestArm * facts->pitch_mm)
    return;
  facts->columns[std::string(kArmGap)] = Fill(gaps.gap_mm, campaign, facts->exposures);
  facts->columns[std::string(kArmGapSide)] = Fill(gaps.side, campaign, facts->exposures);
}

void FindRailLoads(const Campaign& campaign, CampaignFacts* facts) {
  const FilledColumn* rail = facts->Find("rail_id");
  const FilledColumn* movers = facts->Find("movers_on_rail");
  if (rail == nullptr || movers == nullptr) return;
  const FilledColumn* slot = facts->Find("rail_slot");
  const HarnessLoads loads =
      FindHarnessLoads(facts->exposures, facts->step_deg, rail->values,
                       slot == nullptr ? std::vector<double>() : slot->values, movers->values);
  facts->columns[std::string(kRailMotors)] = Fill(loads.motors, campaign, facts->exposures);
  if (!loads.shared_motors.empty())
    facts->columns[std::string(kSharedMotors)] =
        Fill(loads.shared_motors, campaign, facts->exposures);
}

// Adds columns that the units' table has and the moves' table lacks.
void AddUnitColumns(const Campaign& campaign, CampaignFacts* facts) {
  struct UnitColumn {
    const char* name;
    double CampaignUnit::*value;
  };
  constexpr UnitColumn kColumns[] = {{"rail_id", &CampaignUnit::rail},
                                     {"rail_slot", &CampaignUnit::rail_slot},
                                     {"bus_id", &CampaignUnit::bus},
                                     {"bus_slot", &CampaignUnit::bus_slot}};
  for (const UnitColumn& column : kColumns) {
    if (facts->Has(column.name)) continue;
    std::vector<double> values(campaign.rows());
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
      for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
        values[row] = campaign.units[unit].*column.value;
    FilledColumn filled = Fill(values, campaign, facts->exposures);
    if (filled.missing_share <= kMissingShareMax) facts->columns[column.name] = std::move(filled);
  }
}

}  // namespace

const FilledColumn* CampaignFacts::Find(std::string_view name) const {
  const auto it = columns.find(name);
  return it == columns.end() ? nullptr : &it->second;
}

namespace {

// Tables call the camera's pixels by many names: x_px, pixel_x, xpix ... The canonical columns are
// pixel_x and pixel_y.
bool IsPixelOf(std::string_view name, char letter) {
  std::string plain;
  for (const char c : name)
    if (c != '_' && c != '-' && c != ' ') plain += static_cast<char>(std::tolower(c));
  for (const std::string_view word : {"pixels", "pixel", "pix", "px"}) {
    const std::size_t at = plain.find(word);
    if (at == std::string::npos) continue;
    plain.erase(at, word.size());
    if (plain.starts_with("ccd") || plain.starts_with("cam")) plain.erase(0, 3);
    return plain == std::string(1, letter);
  }
  return false;
}

void AddPixelColumns(CampaignFacts* facts) {
  for (const char letter : {'x', 'y'}) {
    const std::string canonical = std::string("pixel_") + letter;
    if (facts->Has(canonical)) continue;
    for (const auto& [name, column] : facts->columns)
      if (IsPixelOf(name, letter)) {
        FilledColumn copy = column;
        facts->columns[canonical] = std::move(copy);
        break;
      }
  }
}

}  // namespace

std::vector<PullingPair> PullOf(const CampaignFacts& facts, std::size_t unit, std::size_t neighbour,
                                std::size_t axis) {
  const Campaign& campaign = *facts.campaign;
  const CampaignUnit &a = campaign.units[unit], &b = campaign.units[neighbour];
  const double near =
      facts.pitch_mm / std::hypot(a.base_x_mm - b.base_x_mm, a.base_y_mm - b.base_y_mm);
  std::vector<PullingPair> pairs;
  std::size_t other = campaign.first_row[neighbour];
  const std::size_t end = campaign.first_row[neighbour + 1];
  const std::vector<std::int64_t>& move_id = campaign.move_id;  // ascends in each unit
  for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
    while (other < end && move_id[other] < move_id[row]) ++other;
    if (other == end) break;
    if (move_id[other] != move_id[row]) continue;
    pairs.push_back({row,
                     kRadiansPerDegree * (a.gear[axis] * campaign.cmd_deg[axis][row] -
                                          b.gear[axis] * campaign.cmd_deg[axis][other]),
                     near * near * near});
  }
  return pairs;
}

CampaignFacts MakeFacts(const Campaign& campaign) {
  CampaignFacts facts;
  facts.campaign = &campaign;
  facts.exposures = FindExposures(campaign);
  facts.frames = FindFrames(campaign);
  for (const Covariate& covariate : campaign.covariates) {
    FilledColumn column = Fill(covariate.values, campaign, facts.exposures);
    if (column.missing_share <= kMissingShareMax) facts.columns[covariate.name] = std::move(column);
  }
  AddModes(campaign, &facts);
  AddUnitColumns(campaign, &facts);
  AddPixelColumns(&facts);
  FindPlate(campaign, &facts);
  FindHistory(campaign, &facts);
  std::vector<double> order(campaign.rows());
  for (std::size_t row = 0; row < order.size(); ++row)
    order[row] = static_cast<double>(facts.exposures.of_row[row]);
  facts.columns[std::string(kOrder)] = Fill(order, campaign, facts.exposures);
  for (const std::size_t axis : {kTheta, kPhi}) {
    facts.columns[std::string(kCommand[axis])] =
        Fill(campaign.cmd_deg[axis], campaign, facts.exposures);
    facts.columns[std::string(kFrom[axis])] =
        Fill(campaign.from_deg[axis], campaign, facts.exposures);
    facts.columns[std::string(kStep[axis])] = Fill(facts.step_deg[axis], campaign, facts.exposures);
  }
  FindGradients(campaign, &facts);
  if (campaign.units.size() > 1) facts.neighbours = NeighboursOf(campaign, 1.3 * facts.pitch_mm);
  FindNeighbourPull(campaign, &facts);
  FindContacts(campaign, &facts);
  FindRailLoads(campaign, &facts);
  return facts;
}

std::size_t UnitTrack::RowOf(std::size_t move) const {
  return of_beginnings == nullptr ? first_row + move : of_beginnings->row[move];
}

bool UnitTrack::IsBeginning(std::size_t move) const {
  return of_beginnings != nullptr && move % 2 == 0;
}

std::span<const double> UnitTrack::Column(std::string_view name) const {
  if (of_beginnings != nullptr) {
    const auto [made, fresh] = of_beginnings->columns.try_emplace(std::string(name));
    if (fresh)
      for (const std::size_t row : of_beginnings->row)
        made->second.push_back(facts->Find(name)->values[row]);
    return made->second;
  }
  return std::span<const double>(facts->Find(name)->values).subspan(first_row, moves);
}

std::size_t EndOfHistory(const UnitTrack& track, std::size_t move) {
  std::size_t end = move + 1;
  while (end < track.moves && track.restarts[end] == 0) ++end;
  return end;
}

std::size_t EndOfStep(const UnitTrack& track, std::size_t move) {
  const std::vector<char>& closed = track.facts->closed;
  std::size_t end = move + 1;
  while (end < track.moves && track.restarts[end] == 0 &&
         (closed.empty() || closed[track.first_row + end] == 0))
    ++end;
  return end;
}

namespace {

void SizePoses(UnitTrack* track) {
  for (std::vector<double>* place : {&track->elbow_x_mm, &track->elbow_y_mm, &track->reach_x_mm,
                                     &track->reach_y_mm, &track->fibre_x_mm, &track->fibre_y_mm})
    place->resize(track->moves);
}

void TakePose(double theta_deg, double phi_deg, std::size_t i, UnitTrack* track) {
  const CampaignUnit& geometry = *track->unit;
  const double theta = (theta_deg + geometry.zero_deg[kTheta]) * kRadiansPerDegree;
  const double both = theta + (phi_deg + geometry.zero_deg[kPhi]) * kRadiansPerDegree;
  track->elbow_x_mm[i] = geometry.arm_mm[kTheta] * std::cos(theta);
  track->elbow_y_mm[i] = geometry.arm_mm[kTheta] * std::sin(theta);
  track->reach_x_mm[i] = geometry.arm_mm[kPhi] * std::cos(both);
  track->reach_y_mm[i] = geometry.arm_mm[kPhi] * std::sin(both);
  track->fibre_x_mm[i] = geometry.base_x_mm + track->elbow_x_mm[i] + track->reach_x_mm[i];
  track->fibre_y_mm[i] = geometry.base_y_mm + track->elbow_y_mm[i] + track->reach_y_mm[i];
}

}  // namespace

UnitTrack MakeTrack(const CampaignFacts& facts, std::size_t unit, const CampaignUnit& geometry) {
  const Campaign& campaign = *facts.campaign;
  UnitTrack track;
  track.facts = &facts;
  track.unit = &geometry;
  track.unit_index = unit;
  track.first_row = campaign.first_row[unit];
  track.moves = campaign.first_row[unit + 1] - track.first_row;
  for (const std::size_t axis : {kTheta, kPhi}) {
    track.cmd_deg[axis] = std::span(campaign.cmd_deg[axis]).subspan(track.first_row, track.moves);
    track.from_deg[axis] = std::span(campaign.from_deg[axis]).subspan(track.first_row, track.moves);
    track.step_deg[axis] = std::span(facts.step_deg[axis]).subspan(track.first_row, track.moves);
  }
  track.restarts = std::span(facts.restarts).subspan(track.first_row, track.moves);
  TakePoses(&track);
  if (!facts.closed.empty()) track.beginnings = MakeBegunTrack(track);
  return track;
}

void TakePoses(UnitTrack* track) {
  SizePoses(track);
  for (std::size_t i = 0; i < track->moves; ++i)
    TakePose(track->cmd_deg[kTheta][i], track->cmd_deg[kPhi][i], i, track);
}

void TurnPoses(const std::span<const double> (&off_deg)[2], UnitTrack* track) {
  for (std::size_t i = 0; i < track->moves; ++i)
    if (off_deg[kTheta][i] != 0 || off_deg[kPhi][i] != 0)
      TakePose(track->cmd_deg[kTheta][i] + off_deg[kTheta][i],
               track->cmd_deg[kPhi][i] + off_deg[kPhi][i], i, track);
}

}  // namespace focalfleet::sim
