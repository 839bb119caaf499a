#include "daemon/plane/plane_table.h"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

void PutNumber(const char* name, double value, fmt::appender out) {
  if (std::isfinite(value))
    fmt::format_to(out, FMT_COMPILE(",\"{}\":{}"), name, value);
  else
    fmt::format_to(out, FMT_COMPILE(",\"{}\":null"), name);
}

void PutPlace(const UnitStatusValue& unit, fmt::appender out) {
  constexpr const char* kLow[] = {"theta_low_deg", "phi_low_deg"};
  constexpr const char* kHigh[] = {"theta_high_deg", "phi_high_deg"};
  for (const Axis axis : kAxes) {
    const std::size_t a = Index(axis);
    fmt::format_to(out, FMT_COMPILE(",\"{}_witness\":\"{}\""), Name(axis), Name(unit.witness[a]));
    PutNumber(kLow[a], unit.low_deg[a], out);
    PutNumber(kHigh[a], unit.high_deg[a], out);
  }
  PutNumber("x_mm", unit.x_fp_mm, out);
  PutNumber("y_mm", unit.y_fp_mm, out);
}

void PutTarget(const Unit& unit, const UnitStatusValue& value, fmt::appender out) {
  const PointFp aim = std::isfinite(value.target_deg[0]) && std::isfinite(value.target_deg[1])
                          ? FibreAt(unit, AxisAngles{value.target_deg[0], value.target_deg[1]})
                          : PointFp{kNoNumber, kNoNumber};
  fmt::format_to(out, FMT_COMPILE(",\"outcome\":\"{}\""), Name(value.outcome));
  PutNumber("target_x_mm", aim.x_mm, out);
  PutNumber("target_y_mm", aim.y_mm, out);
}

void PutDrive(const SectorPlaces* places, std::uint32_t local, fmt::appender out) {
  // Offsets stay with the sector.
  fmt::format_to(out, FMT_COMPILE(",\"theta_offset_deg\":null,\"phi_offset_deg\":null"));
  if (places == nullptr) {
    fmt::format_to(
        out, FMT_COMPILE(",\"counter1\":null,\"repeat\":null,\"mode\":null,\"v_bus_V\":null"));
    return;
  }
  const UnitDrive& drive = places->drives[local];
  fmt::format_to(out, FMT_COMPILE(",\"counter1\":{},\"repeat\":{},\"mode\":\"{}\""),
                 drive.axis[0].counter1, drive.axis[0].repeat, Name(drive.mode));
  PutNumber("v_bus_V", drive.v_bus_V, out);
}

}  // namespace

void PlaneTable::Absorb(const StatusUpdate& update, SteadyTime now) {
  const auto known = [this](const SectorOfValue& sector) {
    return sector && *sector < sectors_.size();
  };
  for (const FleetStatusValue& fleet : update.fleets) {
    if (!known(fleet.sector)) continue;
    sectors_[*fleet.sector].fleet = fleet;
    sectors_[*fleet.sector].heard = now;
  }
  for (const ConfigurationProgressValue& value : update.configurations)
    if (known(value.sector)) sectors_[*value.sector].configuration = value;
  for (const UnitStatusValue& unit : update.units)
    if (const auto i = plane_.layout().Find(unit.unit)) units_[i->value] = unit;
}

std::optional<double> PlaneTable::AgeOf(std::uint32_t sector, SteadyTime now) const {
  if (!sectors_[sector].fleet) return std::nullopt;
  return std::chrono::duration<double>(now - sectors_[sector].heard).count();
}

bool PlaneTable::IsSilent(std::uint32_t sector, SteadyTime now) const {
  return !sectors_[sector].fleet || now - sectors_[sector].heard > kSilentAfter;
}

PlaneTable::Counts PlaneTable::Count(SteadyTime now) const {
  Counts counts;
  std::vector<std::uint8_t> silent(sectors_.size());
  for (std::uint32_t n = 0; n < sectors_.size(); ++n) {
    silent[n] = IsSilent(n, now) ? 1 : 0;
    counts.silent_sectors += silent[n];
    if (silent[n] != 0) continue;
    counts.bus_load_max = std::max(counts.bus_load_max, sectors_[n].fleet->bus_load_max);
    counts.store_failing |= sectors_[n].fleet->store_failing;
  }
  for (std::uint32_t n = 0; n < units_.size(); ++n) {
    const auto& unit = units_[n];
    const bool fresh = unit && silent[plane_.SectorOf({n})] == 0;
    const UnitPhase phase = fresh ? unit->phase : UnitPhase::kSilent;
    const Witness witness =
        fresh ? std::min(unit->witness[0], unit->witness[1]) : Witness::kUnknown;
    ++counts.by_phase[static_cast<std::size_t>(phase)];
    ++counts.by_witness[static_cast<std::size_t>(witness)];
    counts.enabled += fresh && unit->enabled ? 1u : 0u;
  }
  return counts;
}

std::string PlaneTable::StateText(const SectorBook& book, SteadyTime now) const {
  fmt::memory_buffer text;
  const fmt::appender out(text);
  const auto put_age = [&](std::uint32_t sector) {
    const auto age_s = AgeOf(sector, now);
    PutNumber("age_s", age_s.value_or(kNoNumber), out);
    fmt::format_to(out, FMT_COMPILE(",\"silent\":{}"), IsSilent(sector, now));
  };
  fmt::format_to(out, FMT_COMPILE("{{\"rows\":["));
  for (std::uint32_t n = 0; n < units_.size(); ++n) {
    const std::uint32_t sector = plane_.SectorOf({n});
    // Whatever a silent sector said last, its units may have moved since.
    const bool fresh = units_[n] && !IsSilent(sector, now);
    UnitStatusValue unit = fresh ? *units_[n] : UnitStatusValue{};
    if (!fresh) unit.phase = UnitPhase::kSilent;
    fmt::format_to(out,
                   FMT_COMPILE("{}{{\"unit_id\":{},\"sector\":{},\"serial\":{},\"phase\":\"{}\""),
                   n == 0 ? "" : ",", plane_.layout().unit({n}).id.value, sector, unit.serial.value,
                   Name(unit.phase));
    PutPlace(unit, out);
    PutTarget(plane_.layout().unit({n}), unit, out);
    PutDrive(book[sector].places.get(), plane_.Local({n}).value, out);
    put_age(sector);
    fmt::format_to(out, FMT_COMPILE("}}"));
  }
  fmt::format_to(out, FMT_COMPILE("],\"sectors\":["));
  for (std::uint32_t n = 0; n < sectors_.size(); ++n) {
    fmt::format_to(out, FMT_COMPILE("{}{{\"sector\":{}"), n == 0 ? "" : ",", n);
    put_age(n);
    fmt::format_to(out, FMT_COMPILE("}}"));
  }
  fmt::format_to(out, FMT_COMPILE("]}}"));
  return fmt::to_string(text);
}

}  // namespace focalfleet
