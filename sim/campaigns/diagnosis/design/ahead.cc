#include "sim/campaigns/diagnosis/design/ahead.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "protocol/base/units.h"

namespace focalfleet::sim {
namespace {

constexpr double kMargin_deg = 3;
constexpr double kNominalDrive = 1, kNominalDelay_s = 3;
constexpr double kBetweenExposures_s = 45;

// The unit's last value in the column; NaN where it has none.
double LastOf(std::span<const double> rows) {
  for (std::size_t i = rows.size(); i-- > 0;)
    if (std::isfinite(rows[i])) return rows[i];
  return std::numeric_limits<double>::quiet_NaN();
}

bool HasColumn(const Campaign& campaign, std::string_view name) {
  return std::ranges::find(campaign.covariates, name, &Covariate::name) !=
         campaign.covariates.end();
}

// The campaign with the columns that hold a proposed move's conditions.
Campaign WithLevers(const Campaign& made) {
  Campaign reported = made;
  for (const auto& [name, value] : {std::pair("drive_amplitude", kNominalDrive),
                                    {"delay_s", kNominalDelay_s},
                                    {"rehomed", 0.0}})
    if (!HasColumn(reported, name))
      reported.covariates.push_back({name, std::vector<double>(made.rows(), value)});
  return reported;
}

double RailOf(const CampaignUnit& unit) { return std::isfinite(unit.rail) ? unit.rail : -1; }

// The number of units of each rail that make the move.
std::map<double, double> MoversOf(const std::vector<CampaignUnit>& units, const PlateMove& move) {
  std::map<double, double> movers;
  for (std::size_t u = 0; u < units.size(); ++u) movers[RailOf(units[u])] += move.to_deg[u] ? 1 : 0;
  return movers;
}

// A unit on its way through the proposed moves.
struct Walker {
  double at_deg[2];
  double cycles[2];
  double time_s;
};

double ValueOf(std::string_view name, const MoveConditions& move, const Walker& walker,
               double movers, double last) {
  if (name == "drive_amplitude") return move.drive_amplitude;
  if (name == "delay_s") return move.delay_s;
  if (name == "rehomed") return move.home_first ? 1 : 0;
  if (name == "elevation_deg") return std::isfinite(move.elevation_deg) ? move.elevation_deg : last;
  if (name == "movers_on_rail") return movers;
  if (name == "t_s") return walker.time_s;
  if (name == "cycles_theta") return walker.cycles[kTheta];
  if (name == "cycles_phi") return walker.cycles[kPhi];
  return last;
}

template <class Value>
void CopyRows(const std::vector<Value>& from, std::size_t begin, std::size_t end,
              std::vector<Value>* to) {
  to->insert(to->end(), from.begin() + static_cast<std::ptrdiff_t>(begin),
             from.begin() + static_cast<std::ptrdiff_t>(end));
}

std::array<double, 2> AnglesAt(const CampaignUnit& unit, const ProposedMove& move) {
  const double wanted[2] = {move.theta_fp_deg, move.phi_fp_deg};
  std::array<double, 2> angles{};
  for (const std::size_t axis : {kTheta, kPhi}) {
    const double middle = (unit.min_deg[axis] + unit.max_deg[axis]) / 2;
    const double own = wanted[axis] - unit.zero_deg[axis];
    const double low = std::min(unit.min_deg[axis] + kMargin_deg, middle);
    const double high = std::max(unit.max_deg[axis] - kMargin_deg, middle);
    angles[axis] = std::clamp(own - kTurnDeg * std::round((own - middle) / kTurnDeg), low, high);
  }
  return angles;
}

}  // namespace

std::vector<PlateMove> SpreadOver(const std::vector<CampaignUnit>& units,
                                  const std::vector<ProposedMove>& moves) {
  std::map<double, std::size_t> seen;
  std::vector<std::size_t> place;  // of a unit among those of its rail
  for (const CampaignUnit& unit : units) place.push_back(seen[RailOf(unit)]++);
  std::vector<PlateMove> spread;
  for (std::size_t m = 0; m < moves.size(); ++m) {
    // The way out and the way back are moves of the same units; the next two are those of others.
    const std::size_t turn = m / 2 % moves[m].every;
    PlateMove& move = spread.emplace_back();
    move.conditions = moves[m].conditions;
    for (std::size_t u = 0; u < units.size(); ++u) {
      move.to_deg.emplace_back();
      if (units[u].enabled && place[u] % moves[m].every == turn)
        move.to_deg.back() = AnglesAt(units[u], moves[m]);
    }
  }
  return spread;
}

Campaign Ahead(const Campaign& made, const std::vector<PlateMove>& moves) {
  const Campaign reported = WithLevers(made);
  const std::int64_t last_id =
      reported.move_id.empty()
          ? 0
          : *std::max_element(reported.move_id.begin(), reported.move_id.end());
  std::vector<std::map<double, double>> movers;
  for (const PlateMove& move : moves) movers.push_back(MoversOf(reported.units, move));
  Campaign ahead;
  ahead.name = reported.name, ahead.units = reported.units, ahead.first_row = {0};
  for (const Covariate& column : reported.covariates) ahead.covariates.push_back({column.name, {}});
  for (const WordColumn& column : reported.word_columns)
    ahead.word_columns.push_back({column.name, column.words, {}});
  for (std::size_t u = 0; u < reported.units.size(); ++u) {
    const std::size_t begin = reported.first_row[u], end = reported.first_row[u + 1];
    CopyRows(reported.move_id, begin, end, &ahead.move_id);
    CopyRows(reported.x_mm, begin, end, &ahead.x_mm);
    CopyRows(reported.y_mm, begin, end, &ahead.y_mm);
    for (const std::size_t axis : {kTheta, kPhi}) {
      CopyRows(reported.from_deg[axis], begin, end, &ahead.from_deg[axis]);
      CopyRows(reported.cmd_deg[axis], begin, end, &ahead.cmd_deg[axis]);
    }
    std::vector<double> last;
    for (std::size_t c = 0; c < reported.covariates.size(); ++c) {
      const std::vector<double>& values = reported.covariates[c].values;
      CopyRows(values, begin, end, &ahead.covariates[c].values);
      last.push_back(LastOf(std::span(values).subspan(begin, end - begin)));
    }
    for (std::size_t c = 0; c < reported.word_columns.size(); ++c)
      CopyRows(reported.word_columns[c].values, begin, end, &ahead.word_columns[c].values);
    const auto last_of = [&](std::string_view name) {
      for (std::size_t c = 0; c < last.size(); ++c)
        if (reported.covariates[c].name == name) return last[c];
      return 0.0;
    };
    Walker walker{{0, 0}, {last_of("cycles_theta"), last_of("cycles_phi")}, last_of("t_s")};
    if (end > begin)
      for (const std::size_t axis : {kTheta, kPhi})
        walker.at_deg[axis] = reported.cmd_deg[axis][end - 1];
    for (std::size_t m = 0; m < moves.size() && end > begin; ++m) {
      const std::optional<std::array<double, 2>>& to = moves[m].to_deg[u];
      ahead.move_id.push_back(last_id + 1 + static_cast<std::int64_t>(m));
      ahead.x_mm.push_back(0), ahead.y_mm.push_back(0);
      for (const std::size_t axis : {kTheta, kPhi}) {
        ahead.from_deg[axis].push_back(walker.at_deg[axis]);
        const double next = to ? (*to)[axis] : walker.at_deg[axis];
        ahead.cmd_deg[axis].push_back(next);
        walker.cycles[axis] += std::abs(next - walker.at_deg[axis]) / kTurnDeg;
        walker.at_deg[axis] = next;
      }
      walker.time_s += kBetweenExposures_s + moves[m].conditions.delay_s;
      for (std::size_t c = 0; c < reported.covariates.size(); ++c)
        ahead.covariates[c].values.push_back(
            ValueOf(reported.covariates[c].name, moves[m].conditions, walker,
                    movers[m].at(RailOf(reported.units[u])), last[c]));
      for (WordColumn& column : ahead.word_columns)
        column.values.push_back(column.values.empty() ? -1 : column.values.back());
    }
    ahead.first_row.push_back(ahead.move_id.size());
  }
  return ahead;
}

}  // namespace focalfleet::sim
