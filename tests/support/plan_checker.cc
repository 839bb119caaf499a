#include "tests/support/plan_checker.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace focalfleet::test {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kQuantumMm = 1e-3;
constexpr double kJoinDeg = 1e-6;
constexpr double kRangeDeg = 1e-6;
constexpr double kJoinS = 1e-9;

using Point = std::complex<double>;

double Dot(Point a, Point b) { return a.real() * b.real() + a.imag() * b.imag(); }

/// Returns the distance of segments p0-p1 and q0-q1. The minimum of a convex quadratic over the
/// unit square lies inside the square or on one of its four edges. On an edge, one parameter is
/// minimised in closed form and clamped.
double SegmentDistance(Point p0, Point p1, Point q0, Point q1) {
  const Point u = p1 - p0;
  const Point v = q1 - q0;
  const Point w = p0 - q0;
  const double a = Dot(u, u);
  const double b = Dot(u, v);
  const double c = Dot(v, v);
  const double d = Dot(u, w);
  const double e = Dot(v, w);
  const auto square_at = [&](double s, double t) {
    const Point r = w + s * u - t * v;
    return Dot(r, r);
  };
  const auto best_s = [&](double t) { return a > 0 ? std::clamp((b * t - d) / a, 0.0, 1.0) : 0.0; };
  const auto best_t = [&](double s) { return c > 0 ? std::clamp((b * s + e) / c, 0.0, 1.0) : 0.0; };
  double best = std::min({square_at(best_s(0), 0), square_at(best_s(1), 1), square_at(0, best_t(0)),
                          square_at(1, best_t(1))});
  const double determinant = a * c - b * b;
  if (determinant > 0) {
    const double s = (b * e - c * d) / determinant;
    const double t = (a * e - b * d) / determinant;
    if (s >= 0 && s <= 1 && t >= 0 && t <= 1) best = std::min(best, square_at(s, t));
  }
  return std::sqrt(std::max(best, 0.0));
}

struct Knot {
  double t_s = 0;  // by the unit's own clock
  double theta_deg = 0;
  double phi_deg = 0;
};

/// The track is one unit over time: straight between knots, at rest before the first and after the
/// last.
struct Track {
  std::vector<Knot> knots;
};

struct Clock {
  double skew_s = 0;
  double rate = 1;  // own seconds per true second
};

class Walker {
 public:
  Walker(const CheckedUnit& unit, const Track& track, Clock clock)
      : unit_(unit), track_(track), clock_(clock) {}

  /// Moves on to true time `t_s`, which never decreases.
  void To(double t_s) {
    const double own = Own(t_s);
    const auto& knots = track_.knots;
    while (next_ < knots.size() && knots[next_].t_s <= own) ++next_;
    double theta = 0;
    double phi = 0;
    theta_rate_ = phi_rate_ = 0;
    if (next_ == 0 || next_ == knots.size()) {
      const Knot& k = next_ == 0 ? knots.front() : knots.back();
      theta = k.theta_deg;
      phi = k.phi_deg;
    } else {
      const Knot& k0 = knots[next_ - 1];
      const Knot& k1 = knots[next_];
      const double span = k1.t_s - k0.t_s;
      const double f = (own - k0.t_s) / span;
      theta = k0.theta_deg + f * (k1.theta_deg - k0.theta_deg);
      phi = k0.phi_deg + f * (k1.phi_deg - k0.phi_deg);
      theta_rate_ = std::abs(k1.theta_deg - k0.theta_deg) / span * kDegree * clock_.rate;
      phi_rate_ = std::abs(k1.phi_deg - k0.phi_deg) / span * kDegree * clock_.rate;
    }
    const double t = (theta + unit_.axis[0].zero_deg) * kDegree;
    const double p = (phi + unit_.axis[1].zero_deg) * kDegree;
    elbow = Point(unit_.base_x_mm, unit_.base_y_mm) + std::polar(unit_.axis[0].arm_mm, t);
    fibre = elbow + std::polar(unit_.axis[1].arm_mm, t + p);
  }
  /// A bound on the speed of every point of the arm until NextChange. Units: mm/s.
  [[nodiscard]] double SpeedBound() const {
    return theta_rate_ * (unit_.axis[0].arm_mm + unit_.axis[1].arm_mm) +
           phi_rate_ * unit_.axis[1].arm_mm;
  }
  /// The true time of the next knot.
  [[nodiscard]] double NextChange() const {
    if (next_ >= track_.knots.size()) return 1e18;
    return track_.knots[next_].t_s / clock_.rate + clock_.skew_s;
  }

  Point elbow;
  Point fibre;

 private:
  [[nodiscard]] double Own(double t_s) const { return (t_s - clock_.skew_s) * clock_.rate; }

  const CheckedUnit& unit_;
  const Track& track_;
  Clock clock_;
  std::size_t next_ = 0;
  double theta_rate_ = 0;
  double phi_rate_ = 0;
};

class Checker {
 public:
  Checker(std::vector<CheckedUnit> units, const std::vector<CheckedRow>& rows,
          const std::vector<CheckedObstacle>& obstacles, const CheckOptions& options)
      : units_(std::move(units)), rows_(rows), obstacles_(obstacles), options_(options) {}

  CheckReport Run() {
    FillIn();
    Lay();
    CheckPairs();
    CheckObstacles();
    return std::move(report_);
  }

 private:
  void FillIn();
  void Lay();
  void LayUnit(std::size_t i, std::vector<CheckedRow> rows);
  bool CheckAxis(const CheckedUnit& unit, int axis, const std::vector<CheckedRow>& rows);
  void CheckPairs();
  void CheckPair(std::size_t i, std::size_t j, double need_mm);
  void WalkPair(std::size_t i, std::size_t j, double need_mm, Clock ci, Clock cj);
  void CheckObstacles();
  void WalkObstacle(std::size_t i, const CheckedObstacle& obstacle, double need_mm);
  void Saw(double margin_mm, std::uint32_t a, std::uint32_t b, double t_s);
  [[nodiscard]] double Reach(std::size_t i) const {
    return units_[i].axis[0].arm_mm + units_[i].axis[1].arm_mm;
  }
  [[nodiscard]] double Apart(std::size_t i, std::size_t j) const {
    return std::hypot(units_[i].base_x_mm - units_[j].base_x_mm,
                      units_[i].base_y_mm - units_[j].base_y_mm);
  }

  std::vector<CheckedUnit> units_;
  const std::vector<CheckedRow>& rows_;
  const std::vector<CheckedObstacle>& obstacles_;
  CheckOptions options_;
  std::vector<Track> tracks_;
  std::vector<std::pair<std::size_t, std::size_t>> near_;  // pairs of bases whose arms can meet
  CheckReport report_;
};

/// Fills in half-widths and clearance that are not given, and finds the pairs near each other.
void Checker::FillIn() {
  double reach_max = 0;
  for (std::size_t i = 0; i < units_.size(); ++i) reach_max = std::max(reach_max, Reach(i));
  // Widths are at most a twelfth of a distance that is itself below this horizon.
  const double horizon = 3 * reach_max + 1;
  std::vector<std::size_t> by_x(units_.size());
  for (std::size_t i = 0; i < by_x.size(); ++i) by_x[i] = i;
  std::sort(by_x.begin(), by_x.end(), [&](std::size_t a, std::size_t b) {
    return units_[a].base_x_mm < units_[b].base_x_mm;
  });
  std::vector<double> nearest(units_.size(), 1e18);
  for (std::size_t a = 0; a < by_x.size(); ++a) {
    for (std::size_t b = a + 1; b < by_x.size(); ++b) {
      const std::size_t i = by_x[a];
      const std::size_t j = by_x[b];
      if (units_[j].base_x_mm - units_[i].base_x_mm > horizon) break;
      const double apart = Apart(i, j);
      if (apart > horizon) continue;
      near_.emplace_back(i, j);
      nearest[i] = std::min(nearest[i], apart);
      nearest[j] = std::min(nearest[j], apart);
    }
  }
  for (std::size_t i = 0; i < units_.size(); ++i)
    if (units_[i].half_width_mm <= 0 && nearest[i] < 1e17)
      units_[i].half_width_mm = 0.08 * nearest[i];
  if (options_.clearance_mm <= 0 && !nearest.empty()) {
    std::sort(nearest.begin(), nearest.end());
    const std::size_t half = nearest.size() / 2;
    const double median =
        nearest.size() % 2 == 1 ? nearest[half] : (nearest[half - 1] + nearest[half]) / 2;
    options_.clearance_mm = 0.012 * (median < 1e17 ? median : 0);
  }
}

bool Checker::CheckAxis(const CheckedUnit& unit, int axis, const std::vector<CheckedRow>& rows) {
  const CheckedAxis& a = unit.axis[axis];
  double at = a.start_deg;
  double until = 0;
  for (const CheckedRow& row : rows) {
    std::string fault;
    if (!(std::isfinite(row.t0_s) && std::isfinite(row.t1_s) && std::isfinite(row.from_deg) &&
          std::isfinite(row.to_deg)))
      fault = "a value is not finite";
    else if (row.t1_s < row.t0_s)
      fault = "ends before it begins";
    else if (row.t0_s < until - kJoinS)
      fault = "overlaps the row before";
    else if (std::abs(row.from_deg - at) > kJoinDeg)
      fault = "does not join up with where the axis stands";
    else if (row.to_deg < std::min(a.min_deg, a.start_deg) - kRangeDeg ||
             row.to_deg > std::max(a.max_deg, a.start_deg) + kRangeDeg)
      fault = "leaves the axis' range";
    else if (row.t1_s == row.t0_s && row.from_deg != row.to_deg)
      fault = "jumps";
    at = row.to_deg;
    until = row.t1_s;
    if (fault.empty()) continue;
    report_.faults.push_back("unit " + std::to_string(unit.id) + " axis " + std::to_string(axis) +
                             " t0 " + std::to_string(row.t0_s) + " s: " + fault);
    return false;
  }
  return true;
}

void Checker::LayUnit(std::size_t i, std::vector<CheckedRow> rows) {
  const CheckedUnit& unit = units_[i];
  std::stable_sort(rows.begin(), rows.end(),
                   [](const CheckedRow& a, const CheckedRow& b) { return a.t0_s < b.t0_s; });
  std::vector<CheckedRow> of_axis[2];
  std::vector<double> times{0};
  for (const CheckedRow& row : rows) {
    of_axis[row.axis != 0 ? 1 : 0].push_back(row);
    times.push_back(row.t0_s);
    times.push_back(row.t1_s);
    report_.end_s = std::max(report_.end_s, row.t1_s);
  }
  if (!rows.empty() && (!unit.enabled || !unit.known))
    report_.faults.push_back("unit " + std::to_string(unit.id) + " must not move, but has rows");
  if (!CheckAxis(unit, 0, of_axis[0]) || !CheckAxis(unit, 1, of_axis[1])) {
    of_axis[0].clear();
    of_axis[1].clear();
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  const auto angle_at = [&](int axis, double t) {
    double angle = unit.axis[axis].start_deg;
    for (const CheckedRow& row : of_axis[axis]) {
      if (t < row.t0_s) break;
      const double f = t >= row.t1_s ? 1 : (t - row.t0_s) / (row.t1_s - row.t0_s);
      angle = row.from_deg + f * (row.to_deg - row.from_deg);
    }
    return angle;
  };
  for (const double t : times) tracks_[i].knots.push_back({t, angle_at(0, t), angle_at(1, t)});
  const Knot& last = tracks_[i].knots.back();
  if (unit.known) report_.ends_deg[unit.id] = {last.theta_deg, last.phi_deg};
}

void Checker::Lay() {
  std::map<std::uint32_t, std::vector<CheckedRow>> of_unit;
  std::map<std::uint32_t, bool> exists;
  for (const CheckedUnit& unit : units_) exists[unit.id] = true;
  for (const CheckedRow& row : rows_) {
    if (exists.count(row.unit) == 0)
      report_.faults.push_back("a row of unit " + std::to_string(row.unit) +
                               ", which does not exist");
    of_unit[row.unit].push_back(row);
  }
  tracks_.resize(units_.size());
  for (std::size_t i = 0; i < units_.size(); ++i) LayUnit(i, std::move(of_unit[units_[i].id]));
}

void Checker::Saw(double margin_mm, std::uint32_t a, std::uint32_t b, double t_s) {
  ++report_.looks;
  if (margin_mm >= report_.worst_margin_mm) return;
  report_.worst_margin_mm = margin_mm;
  report_.worst_a = a;
  report_.worst_b = b;
  report_.worst_t_s = t_s;
}

void Checker::WalkPair(std::size_t i, std::size_t j, double need_mm, Clock ci, Clock cj) {
  Walker a(units_[i], tracks_[i], ci);
  Walker b(units_[j], tracks_[j], cj);
  const double floor_mm = need_mm - options_.tolerance_mm;
  double t = -2 * options_.start_skew_s;
  for (;;) {
    a.To(t);
    b.To(t);
    const double distance = SegmentDistance(a.elbow, a.fibre, b.elbow, b.fibre);
    Saw(distance - need_mm, units_[i].id, units_[j].id, t);
    if (distance < floor_mm) {
      std::ostringstream text;
      text << "units " << units_[i].id << " and " << units_[j].id << " are " << distance
           << " mm apart at " << t << " s, " << need_mm << " mm needed";
      report_.faults.push_back(text.str());
      return;
    }
    const double change = std::min(a.NextChange(), b.NextChange());
    const double speed = a.SpeedBound() + b.SpeedBound();
    if (speed <= 0) {
      if (change > 1e17) return;
      t = std::max(change, std::nextafter(t, 1e18));
      continue;
    }
    const double step = std::max(distance - floor_mm, kQuantumMm) / speed;
    t = std::max(std::min(t + step, change), std::nextafter(t, 1e18));
  }
}

void Checker::CheckPair(std::size_t i, std::size_t j, double need_mm) {
  const std::size_t faults = report_.faults.size();
  const double s = options_.start_skew_s;
  const double e = options_.clock_error;
  WalkPair(i, j, need_mm, {}, {});
  if (s == 0 && e == 0) return;  // the corners are the middle
  for (const double skew : {-s, s})
    for (const double rate : {-e, e})
      if (report_.faults.size() == faults)
        WalkPair(i, j, need_mm, {skew, 1 + rate}, {-skew, 1 - rate});
}

void Checker::CheckPairs() {
  for (const auto& [i, j] : near_) {
    if (!units_[i].known || !units_[j].known) continue;
    const double need = units_[i].half_width_mm + units_[j].half_width_mm + options_.clearance_mm;
    if (Apart(i, j) > Reach(i) + Reach(j) + need) continue;
    if (!units_[i].enabled && !units_[j].enabled) continue;
    CheckPair(i, j, need);
  }
}

void Checker::WalkObstacle(std::size_t i, const CheckedObstacle& obstacle, double need_mm) {
  Walker a(units_[i], tracks_[i], {});
  const Point centre(obstacle.x_mm, obstacle.y_mm);
  const double floor_mm = need_mm - options_.tolerance_mm;
  double t = 0;
  for (;;) {
    a.To(t);
    const double distance = SegmentDistance(a.elbow, a.fibre, centre, centre);
    Saw(distance - need_mm, units_[i].id, obstacle.id, t);
    if (distance < floor_mm) {
      report_.faults.push_back("unit " + std::to_string(units_[i].id) +
                               " is not clear of obstacle " + std::to_string(obstacle.id) + " at " +
                               std::to_string(t) + " s");
      return;
    }
    const double change = a.NextChange();
    const double speed = a.SpeedBound();
    if (speed <= 0 && change > 1e17) return;
    const double step = speed > 0 ? std::max(distance - floor_mm, kQuantumMm) / speed : 1e18;
    t = std::max(std::min(t + step, change), std::nextafter(t, 1e18));
  }
}

void Checker::CheckObstacles() {
  for (std::size_t i = 0; i < units_.size(); ++i) {
    if (!units_[i].known || !units_[i].enabled) continue;
    for (const CheckedObstacle& obstacle : obstacles_) {
      const double need = units_[i].half_width_mm + obstacle.radius_mm + options_.clearance_mm;
      const double apart =
          std::hypot(units_[i].base_x_mm - obstacle.x_mm, units_[i].base_y_mm - obstacle.y_mm);
      if (apart <= Reach(i) + need) WalkObstacle(i, obstacle, need);
    }
  }
}

using Record = std::map<std::string, std::string>;

bool ReadRecords(const std::string& path, std::vector<Record>* records, CheckReport* report) {
  std::ifstream in(path);
  if (!in) {
    report->faults.push_back("cannot read " + path);
    return false;
  }
  const auto cells_of = [](const std::string& line) {
    std::vector<std::string> cells(1);
    for (const char c : line) {
      if (c == ',')
        cells.emplace_back();
      else if (c != ' ' && c != '\r' && c != '"')
        cells.back() += c;
    }
    return cells;
  };
  std::vector<std::string> header;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::vector<std::string> cells = cells_of(line);
    if (header.empty()) {
      header = cells;
      continue;
    }
    Record record;
    for (std::size_t k = 0; k < cells.size() && k < header.size(); ++k)
      record[header[k]] = cells[k];
    records->push_back(std::move(record));
  }
  return true;
}

double Number(const Record& record, const std::string& key, double otherwise) {
  const auto found = record.find(key);
  if (found == record.end() || found->second.empty()) return otherwise;
  return std::strtod(found->second.c_str(), nullptr);
}

std::uint32_t Id(const Record& record, const std::string& key) {
  return static_cast<std::uint32_t>(Number(record, key, 0));
}

CheckedUnit UnitOf(const Record& r) {
  CheckedUnit unit;
  unit.id = Id(r, "unit_id");
  unit.base_x_mm = Number(r, "base_x_mm", 0);
  unit.base_y_mm = Number(r, "base_y_mm", 0);
  const char* names[] = {"theta", "phi"};
  for (int k = 0; k < 2; ++k) {
    const std::string axis = names[k];
    unit.axis[k].arm_mm = Number(r, "arm_" + axis + "_mm", 0);
    unit.axis[k].zero_deg = Number(r, axis + "_zero_deg", 0);
    unit.axis[k].min_deg = Number(r, axis + "_min_deg", 0);
    unit.axis[k].max_deg = Number(r, axis + "_max_deg", 0);
  }
  unit.half_width_mm = Number(r, "arm_half_width_mm", 0);
  unit.enabled = Number(r, "enabled", 1) != 0;
  unit.known = false;
  return unit;
}

}  // namespace

std::string CheckReport::Text() const {
  std::ostringstream text;
  text << "worst margin " << worst_margin_mm * 1000 << " um between " << worst_a << " and "
       << worst_b << " at " << worst_t_s << " s; " << looks << " looks; " << faults.size()
       << " faults";
  for (std::size_t k = 0; k < faults.size() && k < 8; ++k) text << "\n  " << faults[k];
  return text.str();
}

CheckReport CheckPlan(std::vector<CheckedUnit> units, const std::vector<CheckedRow>& rows,
                      const std::vector<CheckedObstacle>& obstacles, const CheckOptions& options) {
  return Checker(std::move(units), rows, obstacles, options).Run();
}

CheckReport CheckPlanFiles(const std::string& units_path, const std::string& state_path,
                           const std::string& plan_path, const std::string& obstacles_path,
                           const CheckOptions& options) {
  CheckReport report;
  std::vector<Record> unit_records;
  std::vector<Record> state_records;
  std::vector<Record> row_records;
  std::vector<Record> obstacle_records;
  if (!ReadRecords(units_path, &unit_records, &report) ||
      !ReadRecords(state_path, &state_records, &report) ||
      !ReadRecords(plan_path, &row_records, &report) ||
      (!obstacles_path.empty() && !ReadRecords(obstacles_path, &obstacle_records, &report)))
    return report;
  std::vector<CheckedUnit> units;
  std::map<std::uint32_t, std::size_t> at;
  for (const Record& r : unit_records) {
    at[Id(r, "unit_id")] = units.size();
    units.push_back(UnitOf(r));
  }
  for (const Record& r : state_records) {
    const auto found = at.find(Id(r, "unit_id"));
    if (found == at.end()) continue;
    CheckedUnit& unit = units[found->second];
    unit.known = true;
    unit.axis[0].start_deg = Number(r, "theta_deg", NAN);
    unit.axis[1].start_deg = Number(r, "phi_deg", NAN);
  }
  std::vector<CheckedRow> rows;
  rows.reserve(row_records.size());
  for (const Record& r : row_records) {
    const auto axis = r.find("axis");
    rows.push_back({Id(r, "unit_id"), axis != r.end() && axis->second == "phi" ? 1 : 0,
                    Number(r, "t0_s", NAN), Number(r, "t1_s", NAN), Number(r, "from_deg", NAN),
                    Number(r, "to_deg", NAN)});
  }
  std::vector<CheckedObstacle> obstacles;
  obstacles.reserve(obstacle_records.size());
  for (const Record& r : obstacle_records)
    obstacles.push_back({Id(r, "obstacle_id"), Number(r, "x_mm", 0), Number(r, "y_mm", 0),
                         Number(r, "radius_mm", 0)});
  return CheckPlan(std::move(units), rows, obstacles, options);
}

}  // namespace focalfleet::test
