#include "fleet/layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <utility>

#include "fleet/files/bad_rows.h"
#include "fleet/geometry/segment.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr double kClearanceShare = 0.012;  // of the pitch
constexpr std::size_t kUnitsPerBus = 100;
/// A joint that tilts 45 degrees takes the tip this share of its arms' length away.
constexpr double kFibreCarrierOverArms = 1.4143;
constexpr double kArmMaxMm = 1e4;
constexpr double kNearestMinMm = 1e-3;  // two bases nearer than this are one place

std::string Text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string Named(UnitId id) { return "unit " + std::to_string(id.value); }

std::uint64_t AddressKey(BusId bus, NodeId node) {
  return std::uint64_t{bus.value} << 8 | node.value;
}

bool Within(double value, double limit) {  // false for nan
  return value >= -limit && value <= limit;
}

std::string FaultOf(const AxisGeometry& axis, const std::string& name) {
  if (!(axis.arm_mm > 0 && axis.arm_mm <= kArmMaxMm))
    return "arm_" + name + "_mm " + Text(axis.arm_mm) + " is not a length between 0 and " +
           Text(kArmMaxMm);
  if (!Within(axis.zero_deg, kAngleMaxDeg))
    return name + "_zero_deg " + Text(axis.zero_deg) + " is not an angle within " +
           Text(kAngleMaxDeg);
  if (!Within(axis.min_deg, kAngleMaxDeg) || !Within(axis.max_deg, kAngleMaxDeg))
    return name + " range " + Text(axis.min_deg) + ".." + Text(axis.max_deg) +
           " deg is not within " + Text(kAngleMaxDeg);
  if (!(axis.min_deg < axis.max_deg))
    return name + " range " + Text(axis.min_deg) + ".." + Text(axis.max_deg) + " deg is empty";
  // The ends of the range must be whole vectors that fit the wire, at the usual subdivision.
  const double end_vectors =
      std::max(std::abs(axis.min_deg), std::abs(axis.max_deg)) * 96 * axis.gear / 360;
  if (!(axis.gear > 0) || !(end_vectors <= limits::kPositionMax))
    return name + "_gear " + Text(axis.gear) + " is not a ratio above 0 whose vectors fit the wire";
  return {};
}

struct Box {
  PointFp low;
  PointFp high;
  [[nodiscard]] double width_mm() const { return high.x_mm - low.x_mm; }
  [[nodiscard]] double height_mm() const { return high.y_mm - low.y_mm; }
};

Box BoxOf(const std::vector<Unit>& units) {
  Box box{units.front().base_fp, units.front().base_fp};
  for (const Unit& unit : units) {
    const PointFp p = unit.base_fp;
    box.low = {std::min(box.low.x_mm, p.x_mm), std::min(box.low.y_mm, p.y_mm)};
    box.high = {std::max(box.high.x_mm, p.x_mm), std::max(box.high.y_mm, p.y_mm)};
  }
  return box;
}

// About one unit a cell. A plate with one far stray, or all on a line, must not cost an unlimited
// number of cells.
double CellMm(const Box& box, std::size_t count) {
  const auto units = static_cast<double>(count);
  const double cells_per_side_max = 2 * std::sqrt(units) + 2;
  return std::max({std::sqrt(box.width_mm() * box.height_mm() / units),
                   box.width_mm() / cells_per_side_max, box.height_mm() / cells_per_side_max,
                   kNearestMinMm});
}

// Bases sorted into square cells, so that the units near a place are found in a few cells.
class Grid {
 public:
  explicit Grid(const std::vector<Unit>& units)
      : units_(units),
        box_(BoxOf(units)),
        cell_mm_(CellMm(box_, units.size())),
        columns_(static_cast<std::size_t>(box_.width_mm() / cell_mm_) + 1),
        rows_(static_cast<std::size_t>(box_.height_mm() / cell_mm_) + 1) {
    begin_.assign(columns_ * rows_ + 1, 0);
    for (const Unit& unit : units) ++begin_[CellOf(unit.base_fp) + 1];
    for (std::size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
    std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
    member_.resize(units.size());
    for (std::uint32_t i = 0; i < units.size(); ++i) member_[next[CellOf(units[i].base_fp)]++] = i;
  }

  /// Calls `visit(j)` for every unit whose base is in a cell within `radius_mm` of the point's.
  template <class Visit>
  void ForNear(PointFp p, double radius_mm, Visit visit) const {
    const auto [column0, column1] = Range(p.x_mm - box_.low.x_mm, radius_mm, columns_);
    const auto [row0, row1] = Range(p.y_mm - box_.low.y_mm, radius_mm, rows_);
    for (std::size_t row = row0; row <= row1; ++row)
      for (std::size_t k = begin_[row * columns_ + column0];
           k < begin_[row * columns_ + column1 + 1]; ++k)
        visit(member_[k]);
  }

  /// Distance from unit i's base to the nearest other one.
  [[nodiscard]] std::pair<double, std::uint32_t> Nearest(std::uint32_t i) const {
    const double everywhere = box_.width_mm() + box_.height_mm() + cell_mm_;
    for (double radius = cell_mm_;; radius *= 2) {
      double best2 = std::numeric_limits<double>::infinity();
      std::uint32_t who = i;
      ForNear(units_[i].base_fp, radius, [&](std::uint32_t j) {
        const double d2 = SquaredDistance(units_[i].base_fp, units_[j].base_fp);
        if (j != i && d2 < best2) {
          best2 = d2;
          who = j;
        }
      });
      // Outside the tested cells nothing is nearer than the radius.
      if (best2 <= radius * radius || radius > everywhere) return {std::sqrt(best2), who};
    }
  }

 private:
  [[nodiscard]] std::size_t CellOf(PointFp p) const {
    const auto column = static_cast<std::size_t>((p.x_mm - box_.low.x_mm) / cell_mm_);
    const auto row = static_cast<std::size_t>((p.y_mm - box_.low.y_mm) / cell_mm_);
    return std::min(row, rows_ - 1) * columns_ + std::min(column, columns_ - 1);
  }
  [[nodiscard]] std::pair<std::size_t, std::size_t> Range(double offset_mm, double radius_mm,
                                                          std::size_t count) const {
    const auto last = static_cast<double>(count - 1);
    const double low = std::clamp(std::floor((offset_mm - radius_mm) / cell_mm_), 0.0, last);
    const double high = std::clamp(std::floor((offset_mm + radius_mm) / cell_mm_), 0.0, last);
    return {static_cast<std::size_t>(low), static_cast<std::size_t>(high)};
  }

  const std::vector<Unit>& units_;
  Box box_;
  double cell_mm_;
  std::size_t columns_;
  std::size_t rows_;
  std::vector<std::uint32_t> begin_;
  std::vector<std::uint32_t> member_;
};

double MedianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

void SpreadOverBuses(std::vector<Unit>* units) {
  std::uint32_t next = 0;
  for (const Unit& unit : *units)
    if (unit.bus != kNoBus && unit.bus.value < kNoBus.value - 1)
      next = std::max(next, unit.bus.value + 1);
  std::size_t on_bus = 0;
  for (Unit& unit : *units) {
    if (unit.bus != kNoBus) continue;
    if (on_bus == kUnitsPerBus) {
      ++next;
      on_bus = 0;
    }
    unit.bus = BusId{next};
    ++on_bus;
  }
}

// Given nodes keep their place; the others take the lowest free ones in order.
Status AssignNodes(std::vector<Unit>* units,
                   std::unordered_map<std::uint64_t, PositionerIndex>* by_address) {
  BadRows bad;
  for (std::uint32_t i = 0; i < units->size(); ++i) {
    const Unit& unit = (*units)[i];
    if (unit.node == kNoNode) continue;
    if (unit.node.value > limits::kNodesPerBus) {
      bad.Add(Named(unit.id) + ": node " + std::to_string(unit.node.value) +
                  " is not between 1 and " + std::to_string(limits::kNodesPerBus),
              "node_id out of bounds");
      continue;
    }
    const auto [it, fresh] =
        by_address->emplace(AddressKey(unit.bus, unit.node), PositionerIndex{i});
    if (!fresh)
      bad.Add(Named(unit.id) + ": bus " + std::to_string(unit.bus.value) + " node " +
                  std::to_string(unit.node.value) + " is also that of " +
                  Named((*units)[it->second.value].id),
              "address of another unit");
  }
  FOCALFLEET_TRY(bad.Check());
  std::map<BusId, std::uint32_t> next;
  for (std::uint32_t i = 0; i < units->size(); ++i) {
    Unit& unit = (*units)[i];
    std::uint32_t& node = next[unit.bus];
    if (unit.node != kNoNode) continue;
    do {
      if (++node > limits::kNodesPerBus)
        return Fail(ErrorCode::kInvalid, Named(unit.id) + ": bus " +
                                             std::to_string(unit.bus.value) + " has more than " +
                                             std::to_string(limits::kNodesPerBus) + " units");
      unit.node = NodeId{static_cast<std::uint8_t>(node)};
    } while (!by_address->emplace(AddressKey(unit.bus, unit.node), PositionerIndex{i}).second);
  }
  if (next.size() > limits::kBuses)
    return Fail(ErrorCode::kInvalid, std::to_string(next.size()) + " buses, at most " +
                                         std::to_string(limits::kBuses) + " are possible");
  return {};
}

Status CheckUnits(const std::vector<Unit>& units,
                  std::unordered_map<UnitId, PositionerIndex>* by_id) {
  if (units.empty()) return Fail(ErrorCode::kInvalid, "a layout needs at least one unit");
  if (units.size() > limits::kUnits)
    return Fail(ErrorCode::kInvalid, std::to_string(units.size()) + " units, at most " +
                                         std::to_string(limits::kUnits) + " are possible");
  BadRows bad;
  for (std::uint32_t i = 0; i < units.size(); ++i) {
    const std::string name = Named(units[i].id);
    if (const std::string fault = FaultOf(units[i]); !fault.empty())
      bad.Add(name + ": " + fault, fault.substr(0, fault.find(' ')) + " out of bounds");
    else if (units[i].bus == kNoBus && units[i].node != kNoNode)
      bad.Add(name + ": a node without a bus", "a node without a bus");
    else if (!by_id->emplace(units[i].id, PositionerIndex{i}).second)
      bad.Add(name + " is there twice", "is there twice");
  }
  return bad.Check();
}

Status CheckObstacles(const std::vector<Obstacle>& obstacles) {
  for (const Obstacle& obstacle : obstacles)
    if (!Within(obstacle.centre_fp.x_mm, kCoordinateMaxMm) ||
        !Within(obstacle.centre_fp.y_mm, kCoordinateMaxMm) || !(obstacle.radius_mm >= 0) ||
        !(obstacle.radius_mm <= kCoordinateMaxMm))
      return Fail(ErrorCode::kInvalid, "obstacle " + std::to_string(obstacle.id) +
                                           ": place and radius must be numbers within " +
                                           Text(kCoordinateMaxMm));
  return {};
}

}  // namespace

std::string FaultOf(const Unit& unit) {
  if (!Within(unit.base_fp.x_mm, kCoordinateMaxMm) || !Within(unit.base_fp.y_mm, kCoordinateMaxMm))
    return "base " + Text(unit.base_fp.x_mm) + ", " + Text(unit.base_fp.y_mm) +
           " mm is not a place within " + Text(kCoordinateMaxMm);
  for (const Axis axis : kAxes)
    if (std::string fault = FaultOf(unit.axis[Index(axis)], Name(axis)); !fault.empty())
      return fault;
  if (!(unit.arm_half_width_mm >= 0 && unit.arm_half_width_mm <= kArmMaxMm))
    return "arm_half_width_mm " + Text(unit.arm_half_width_mm) + " is not a length between 0 and " +
           Text(kArmMaxMm);
  const double arms_mm = unit.theta().arm_mm + unit.phi().arm_mm;
  const bool tilts =
      unit.carrier_mm >= kFibreCarrierOverArms * arms_mm && unit.carrier_mm <= kArmMaxMm;
  if (unit.sensors > 0 && !tilts)
    return "spine_mm " + Text(unit.carrier_mm) + " is not a length between " +
           Text(kFibreCarrierOverArms * arms_mm) + " (its joint tilts 45 degrees at most) and " +
           Text(kArmMaxMm);
  return {};
}

Result<Layout> Layout::Create(std::vector<Unit> units, Options options) {
  Layout layout;
  FOCALFLEET_TRY(CheckUnits(units, &layout.by_id_));
  FOCALFLEET_TRY(CheckObstacles(options.obstacles));
  if (!(options.clearance_mm >= 0 && options.clearance_mm <= kArmMaxMm))
    return Fail(ErrorCode::kInvalid,
                "clearance " + Text(options.clearance_mm) + " mm is not a length");
  SpreadOverBuses(&units);
  FOCALFLEET_TRY(AssignNodes(&units, &layout.by_address_));
  for (const Unit& unit : units) layout.buses_.push_back(unit.bus);
  std::sort(layout.buses_.begin(), layout.buses_.end());
  layout.buses_.erase(std::unique(layout.buses_.begin(), layout.buses_.end()), layout.buses_.end());
  layout.units_ = std::move(units);
  layout.obstacles_ = std::move(options.obstacles);
  FOCALFLEET_TRY(layout.MeasurePitch(options.clearance_mm));
  FOCALFLEET_TRY(layout.FindNeighbours());
  return layout;
}

Result<Layout> Layout::Part(std::span<const PositionerIndex> chosen) const {
  std::vector<Unit> units;
  units.reserve(chosen.size());
  for (const PositionerIndex i : chosen) units.push_back(unit(i));
  return Create(std::move(units), {.clearance_mm = clearance_mm_, .obstacles = obstacles_});
}

Status Layout::MeasurePitch(double clearance_mm) {
  nearest_mm_.resize(units_.size());
  if (units_.size() == 1) {
    nearest_mm_[0] = 2 * (units_[0].theta().arm_mm + units_[0].phi().arm_mm);
  } else {
    const Grid grid(units_);
    BadRows bad;
    std::vector<std::uint8_t> named(units_.size());  // in a pair that is listed
    for (std::uint32_t i = 0; i < units_.size(); ++i) {
      const auto [distance, who] = grid.Nearest(i);
      nearest_mm_[i] = distance;
      if (distance >= kNearestMinMm || named[i] != 0) continue;
      named[i] = named[who] = 1;
      bad.Add(Named(units_[i].id) + " and " + Named(units_[who].id) + " sit at one place",
              "at one place");
    }
    FOCALFLEET_TRY(bad.Check());
  }
  for (std::uint32_t i = 0; i < units_.size(); ++i)
    if (units_[i].arm_half_width_mm == 0)
      units_[i].arm_half_width_mm = kHalfWidthShare * nearest_mm_[i];
  pitch_mm_ = units_.size() == 1 ? 2 * units_[0].reach_mm() : MedianOf(nearest_mm_);
  clearance_mm_ = clearance_mm > 0 ? clearance_mm : kClearanceShare * pitch_mm_;
  return {};
}

Status Layout::FindNeighbours() {
  double reach_max = 0;
  for (const Unit& unit : units_) reach_max = std::max(reach_max, unit.reach_mm());
  const Grid grid(units_);
  neighbour_begin_.assign(1, 0);
  for (std::uint32_t i = 0; i < units_.size(); ++i) {
    const Unit& unit = units_[i];
    const std::size_t begin = neighbour_.size();
    grid.ForNear(unit.base_fp, unit.reach_mm() + reach_max + clearance_mm_, [&](std::uint32_t j) {
      const double reach = unit.reach_mm() + units_[j].reach_mm() + clearance_mm_;
      if (j != i && SquaredDistance(unit.base_fp, units_[j].base_fp) < reach * reach &&
          neighbour_.size() - begin <= limits::kNeighboursPerUnit)
        neighbour_.push_back(PositionerIndex{j});
    });
    if (neighbour_.size() - begin > limits::kNeighboursPerUnit)
      return Fail(ErrorCode::kInvalid, Named(unit.id) + ": more than " +
                                           std::to_string(limits::kNeighboursPerUnit) +
                                           " units within its reach; are its arms in mm?");
    std::sort(neighbour_.begin() + static_cast<std::ptrdiff_t>(begin), neighbour_.end());
    neighbour_begin_.push_back(static_cast<std::uint32_t>(neighbour_.size()));
  }
  return {};
}

std::optional<PositionerIndex> Layout::Find(UnitId id) const {
  const auto it = by_id_.find(id);
  if (it == by_id_.end()) return std::nullopt;
  return it->second;
}

std::optional<PositionerIndex> Layout::Find(BusId bus, NodeId node) const {
  const auto it = by_address_.find(AddressKey(bus, node));
  if (it == by_address_.end()) return std::nullopt;
  return it->second;
}

std::span<const PositionerIndex> Layout::neighbours(PositionerIndex i) const {
  const std::span<const PositionerIndex> all = neighbour_;
  const std::uint32_t begin = neighbour_begin_[i.value];
  return all.subspan(begin, neighbour_begin_[i.value + 1] - begin);
}

}  // namespace focalfleet
