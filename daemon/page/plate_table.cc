#include "daemon/page/plate_table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/status/status_snapshot.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

using Json = nlohmann::json;

/// Nothing that is not finite goes into JSON.
Json NumberOrNull(double value) { return std::isfinite(value) ? Json(value) : Json(); }

std::uint16_t ErrorCode16(double error_mm) {
  constexpr double kStepsPerMm = 2000;
  constexpr double kMost = kNoCode - 1;
  if (!std::isfinite(error_mm)) return kNoCode;
  return static_cast<std::uint16_t>(std::min(kMost, std::round(error_mm * kStepsPerMm)));
}

/// The middle of an interval; of a known place the place itself.
AxisAngles PlaceIn(const UnitStatusValue& status) {
  return {(status.low_deg[0] + status.high_deg[0]) / 2,
          (status.low_deg[1] + status.high_deg[1]) / 2};
}

}  // namespace

std::uint16_t AngleCode(double angle_deg) {
  if (!std::isfinite(angle_deg)) return kNoCode;
  const double turns = angle_deg / 360;
  const double steps = std::round((turns - std::floor(turns)) * kTurnSteps);
  return static_cast<std::uint16_t>(static_cast<std::uint32_t>(steps) % kTurnSteps);
}

PlateTable::PlateTable(const Layout* layout) : layout_(layout), units_(layout->size()) {
  for (const BusId bus : layout->buses()) buses_.push_back({.bus = bus});
}

PlateUnit PlateTable::CodeOf(PositionerIndex i, const UnitStatusValue& status) const {
  const Unit& unit = layout_->unit(i);
  const Witness witness = std::min(status.witness[0], status.witness[1]);
  const AxisAngles place = PlaceIn(status);
  const AxisAngles target = {status.target_deg[0], status.target_deg[1]};
  PlateUnit code{.theta = AngleCode(place.theta_deg + unit.theta().zero_deg),
                 .phi = AngleCode(place.phi_deg + unit.phi().zero_deg),
                 .target_theta = AngleCode(target.theta_deg + unit.theta().zero_deg),
                 .target_phi = AngleCode(target.phi_deg + unit.phi().zero_deg),
                 .phase = static_cast<std::uint8_t>(status.phase),
                 .witness = static_cast<std::uint8_t>(witness),
                 .outcome = static_cast<std::uint8_t>(status.outcome),
                 .flags = static_cast<std::uint8_t>((status.enabled ? 1 : 0) |
                                                    (static_cast<int>(status.fault) << 1))};
  if (std::isfinite(status.measured_error_um)) {
    code.error = ErrorCode16(1e-3 * status.measured_error_um);
  } else if (witness >= Witness::kReported && code.target_theta != kNoCode) {
    const PointFp stands = FibreAt(unit, place);
    const PointFp wanted = FibreAt(unit, target);
    code.error = ErrorCode16(std::hypot(stands.x_mm - wanted.x_mm, stands.y_mm - wanted.y_mm));
  }
  return code;
}

void PlateTable::Take(const StatusBatch& batch) {
  for (const UnitStatusValue& status : batch.units)
    if (const auto i = layout_->Find(status.unit)) units_[i->value] = CodeOf(*i, status);
  for (const BusStatusValue& status : batch.buses) {
    const auto bus = std::ranges::find(buses_, status.bus, &BusStatusValue::bus);
    if (bus != buses_.end()) *bus = status;
  }
  if (batch.fleet) {
    fleet_ = *batch.fleet;
    at_ = fleet_.at;
  }
  if (batch.configuration) {
    configuration_ = *batch.configuration;
    makespan_s_ = batch.makespan_s;
  }
}

std::uint64_t PlateTable::urgent() const {
  const ConfigurationView& view = configuration_.view;
  return (view.id << 32) ^ (std::uint64_t{view.round} << 24) ^
         (static_cast<std::uint64_t>(view.state) << 20) ^ (std::uint64_t{fleet_.busy} << 19) ^
         (alarms_ << 48) ^ view.measured.size();
}

nlohmann::json PlateTable::ConfigurationFacts() const {
  const ConfigurationView& view = configuration_.view;
  Json measured = Json::array();
  for (const MeasuredRound& round : view.measured)
    measured.push_back({{"exposure", round.exposure},
                        {"measured", round.measured},
                        {"unknown", round.unknown},
                        {"within_tolerance", round.within_tolerance},
                        {"median_um", NumberOrNull(round.median_um)},
                        {"worst_um", NumberOrNull(round.worst_um)}});
  return {{"id", view.id},
          {"kind", Name(view.kind)},
          {"source", view.source},
          {"state", Name(view.state)},
          {"round", view.round},
          {"targeted", view.counts.targeted},
          {"arrived", view.counts.arrived},
          {"refused", view.counts.refused},
          {"failed", view.counts.failed},
          {"stopped", view.counts.stopped},
          {"unmeasured", view.counts.unmeasured},
          {"makespan_predicted_s", NumberOrNull(view.makespan_predicted_s)},
          {"makespan_s", NumberOrNull(makespan_s_)},
          {"peak_power_W", NumberOrNull(view.peak_power_W)},
          {"waiting_for", view.waiting_for},
          {"measured", std::move(measured)},
          {"not_measured", view.not_measured}};
}

nlohmann::json PlateTable::BusFacts() const {
  Json buses = Json::array();
  for (const BusStatusValue& bus : buses_)
    buses.push_back({{"bus_id", bus.bus.value},
                     {"link", Name(bus.view.link)},
                     {"load", NumberOrNull(std::round(1000 * bus.view.load) / 1000)},
                     {"retries", bus.view.retries},
                     {"malformed", bus.view.malformed}});
  return buses;
}

std::string PlateTable::Facts() const {
  const Json facts{{"version", fleet_.version},
                   {"units", fleet_.units},
                   {"enabled", fleet_.enabled},
                   {"phases", fleet_.units_by_phase},
                   {"witnesses", fleet_.units_by_witness},
                   {"busy", fleet_.busy},
                   {"store_failing", fleet_.store_failing},
                   {"alarms", alarms_},
                   {"configuration", ConfigurationFacts()},
                   {"buses", BusFacts()}};
  return facts.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace focalfleet
