#include "daemon/status/state_rows.h"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <cmath>
#include <iterator>

namespace focalfleet {

StateRows TakeStateRows(const FleetView& view) {
  auto rows = std::make_shared<std::vector<StateRow>>(view.layout->size());
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) {
    const Unit& unit = view.layout->unit({n});
    const UnitView& seen = view.coordinator->unit({n});
    const UnitDrive& drive = view.coordinator->drives()[n];
    StateRow& row = (*rows)[n];
    row.unit = SnapshotUnit(view, {n});
    for (std::size_t a = 0; a < kAxisCount; ++a)
      row.offset_deg[a] = AngleDeg(seen.offset[a], unit.axis[a], drive.axis[a]);
    row.target = seen.target ? FibreAt(unit, drive, *seen.target) : PointFp{kNoNumber, kNoNumber};
    row.drive = drive;
  }
  return rows;
}

std::string StateText(const std::vector<StateRow>& rows) {
  fmt::memory_buffer text;
  const fmt::appender out(text);
  const auto number = [&](const char* name, double value) {
    if (std::isfinite(value))
      fmt::format_to(out, FMT_COMPILE(",\"{}\":{}"), name, value);
    else
      fmt::format_to(out, FMT_COMPILE(",\"{}\":null"), name);
  };
  fmt::format_to(out, FMT_COMPILE("{{\"rows\":["));
  for (const StateRow& row : rows) {
    const UnitStatusValue& unit = row.unit;
    fmt::format_to(out, FMT_COMPILE("{}{{\"unit_id\":{},\"serial\":{},\"phase\":\"{}\""),
                   &row == &rows.front() ? "" : ",", unit.unit.value, unit.serial.value,
                   Name(unit.phase));
    for (const Axis axis : kAxes) {
      const char* name = Name(axis);
      const std::size_t a = Index(axis);
      fmt::format_to(out, FMT_COMPILE(",\"{}_witness\":\"{}\""), name, Name(unit.witness[a]));
      number(fmt::format(FMT_COMPILE("{}_low_deg"), name).c_str(), unit.low_deg[a]);
      number(fmt::format(FMT_COMPILE("{}_high_deg"), name).c_str(), unit.high_deg[a]);
      number(fmt::format(FMT_COMPILE("{}_offset_deg"), name).c_str(), row.offset_deg[a]);
    }
    number("x_mm", unit.x_fp_mm);
    number("y_mm", unit.y_fp_mm);
    fmt::format_to(out, FMT_COMPILE(",\"outcome\":\"{}\""), Name(unit.outcome));
    number("target_x_mm", row.target.x_mm);
    number("target_y_mm", row.target.y_mm);
    fmt::format_to(out, FMT_COMPILE(",\"counter1\":{},\"repeat\":{},\"mode\":\"{}\""),
                   row.drive.axis[0].counter1, row.drive.axis[0].repeat, Name(row.drive.mode));
    number("v_bus_V", row.drive.v_bus_V);
    fmt::format_to(out, FMT_COMPILE("}}"));
  }
  fmt::format_to(out, FMT_COMPILE("]}}"));
  return fmt::to_string(text);
}

}  // namespace focalfleet
