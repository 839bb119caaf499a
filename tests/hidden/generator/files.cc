#include "tests/hidden/generator/files.h"

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>

namespace focalfleet::hidden {

namespace {

struct ColumnKind {
  const char* name;
  double (*value)(const Campaign& campaign, const Measurement& measured, std::size_t row);
  const char* format;
  bool may_be_blank = true;
};

const Exposure& ExposureOf(const Campaign& c, std::size_t row) {
  return c.exposures[row / c.unit_count()];
}
const Unit& UnitOf(const Campaign& c, std::size_t row) { return c.units[row % c.unit_count()]; }

Place Pixels(const Campaign& c, const Measurement& m, std::size_t row) {
  return (m.place_mm[row] - c.pixel_origin_mm) / c.pixel_mm;
}

using C = Campaign;
using M = Measurement;
constexpr std::array<ColumnKind, 21> kOptional = {{
    {"t_s", [](const C& c, const M&, std::size_t r) { return ExposureOf(c, r).t_s; }, "%.1f",
     false},
    {"sigma_um",
     [](const C& c, const M& m, std::size_t r) { return m.noise.centroid_um[r % c.unit_count()]; },
     "%.2f"},
    {"rehomed", [](const C& c, const M&, std::size_t r) { return c.rows[r].rehomed ? 1.0 : 0.0; },
     "%.0f", false},
    {"temp_C", [](const C&, const M& m, std::size_t r) { return m.reported_temp_C[r]; }, "%.2f"},
    {"v_bus_V", [](const C& c, const M&, std::size_t r) { return c.rows[r].v_bus_V; }, "%.4f"},
    {"elevation_deg",
     [](const C& c, const M&, std::size_t r) { return ExposureOf(c, r).elevation_deg; }, "%.3f"},
    {"rail_id", [](const C& c, const M&, std::size_t r) { return double(UnitOf(c, r).rail); },
     "%.0f", false},
    {"rail_slot",
     [](const C& c, const M&, std::size_t r) { return double(UnitOf(c, r).rail_slot); }, "%.0f",
     false},
    {"movers_on_rail",
     [](const C& c, const M&, std::size_t r) { return double(c.rows[r].movers_on_rail); }, "%.0f"},
    {"bus_id", [](const C& c, const M&, std::size_t r) { return double(UnitOf(c, r).bus); }, "%.0f",
     false},
    {"bus_slot", [](const C& c, const M&, std::size_t r) { return double(c.rows[r].bus_slot); },
     "%.0f"},
    {"delay_s", [](const C& c, const M&, std::size_t r) { return c.rows[r].delay_s; }, "%.2f"},
    {"drive_amplitude",
     [](const C& c, const M&, std::size_t r) { return ExposureOf(c, r).drive_amplitude; }, "%.2f"},
    {"cycles_theta", [](const C& c, const M&, std::size_t r) { return c.rows[r].cycles[kTheta]; },
     "%.4f"},
    {"cycles_phi", [](const C& c, const M&, std::size_t r) { return c.rows[r].cycles[kPhi]; },
     "%.4f"},
    {"x_px", [](const C& c, const M& m, std::size_t r) { return Pixels(c, m, r).real(); }, "%.4f"},
    {"y_px", [](const C& c, const M& m, std::size_t r) { return Pixels(c, m, r).imag(); }, "%.4f"},
    {"humidity_pct", [](const C& c, const M&, std::size_t r) { return ExposureOf(c, r).humidity; },
     "%.1f"},
    {"wind_m_s", [](const C& c, const M&, std::size_t r) { return ExposureOf(c, r).wind_m_s; },
     "%.2f"},
    {"pump_deg", [](const C& c, const M&, std::size_t r) { return ExposureOf(c, r).pump_deg; },
     "%.1f"},
    {"counter1", [](const C&, const M&, std::size_t) { return 500.0; }, "%.0f"},
}};

bool Has(const Spec& spec, const std::string& name) {
  if (name == "sigma_um" && !spec.sigma_column) return false;
  if ((name == "x_px" || name == "y_px") && !spec.pixel_columns) return false;
  const auto dropped = [&](const char* column) {
    return std::find(spec.dropped.begin(), spec.dropped.end(), column) != spec.dropped.end();
  };
  if (name == "rail_slot") return !dropped("rail_id");
  if (name == "bus_slot") return !dropped("bus_id");
  if (name == "cycles_phi") return !dropped("cycles_theta");
  return !dropped(name.c_str());
}

void Append(std::string* text, const char* format, ...) __attribute__((format(printf, 2, 3)));
void Append(std::string* text, const char* format, ...) {
  std::array<char, 256> line{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line.data(), line.size(), format, arguments);
  va_end(arguments);
  *text += line.data();
}

void AppendNumber(std::string* text, const char* format, double value) {
  std::array<char, 64> cell{};
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  std::snprintf(cell.data(), cell.size(), format, value);
#pragma GCC diagnostic pop
  *text += ',';
  *text += cell.data();
}

std::string Moves(const Spec& spec, const Campaign& campaign, const Measurement& measured) {
  std::string text =
      "unit_id,move_id,theta_from_deg,theta_cmd_deg,phi_from_deg,phi_cmd_deg,x_mm,y_mm";
  std::vector<const ColumnKind*> columns;
  for (const ColumnKind& column : kOptional)
    if (Has(spec, column.name)) columns.push_back(&column);
  for (const ColumnKind* column : columns) (text += ',') += column->name;
  text += '\n';
  for (std::size_t r = 0; r < campaign.rows.size(); ++r) {
    const ByAxis& from = measured.reported_from_deg[r];
    const ByAxis& cmd = measured.reported_cmd_deg[r];
    Append(&text, "%d,%zu,%.4f,%.4f,%.4f,%.4f", UnitOf(campaign, r).id,
           r / campaign.unit_count() + 1, from[kTheta], cmd[kTheta], from[kPhi], cmd[kPhi]);
    if (measured.seen[r] != 0) {
      Append(&text, ",%.6f,%.6f", measured.place_mm[r].real(), measured.place_mm[r].imag());
    } else {
      text += ",,";
    }
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const bool pixel = columns[c]->name[1] == '_' && columns[c]->name[2] == 'p';
      const bool blank = columns[c]->may_be_blank && ((measured.blank[r] >> c) & 1u) != 0;
      if (blank || (pixel && measured.seen[r] == 0)) {
        text += ',';
      } else {
        AppendNumber(&text, columns[c]->format, columns[c]->value(campaign, measured, r));
      }
    }
    text += '\n';
  }
  return text;
}

std::string Units(const Campaign& campaign) {
  std::string text =
      "unit_id,base_x_mm,base_y_mm,arm_theta_mm,arm_phi_mm,theta_zero_deg,phi_zero_deg,theta_gear,"
      "phi_gear,theta_min_deg,theta_max_deg,phi_min_deg,phi_max_deg,rail_id,rail_slot,bus_id,"
      "bus_slot\n";
  for (const Unit& u : campaign.units) {
    const Geometry& g = u.believed;
    Append(&text, "%d,%.10g,%.10g,%.10g,%.10g,%.10g,%.10g", u.id, g.base_mm.real(),
           g.base_mm.imag(), g.arm_mm[kTheta], g.arm_mm[kPhi], g.zero_deg[kTheta],
           g.zero_deg[kPhi]);
    Append(&text, ",%.17g,%.17g,%.10g,%.10g,%.10g,%.10g,%d,%d,%d,%d\n", u.gear[kTheta],
           u.gear[kPhi], u.min_deg[kTheta], u.max_deg[kTheta], u.min_deg[kPhi], u.max_deg[kPhi],
           u.rail, u.rail_slot, u.bus, u.bus_slot);
  }
  return text;
}

}  // namespace

CampaignText Write(const Spec& spec, const Campaign& campaign, const Measurement& measured) {
  return {Moves(spec, campaign, measured), Units(campaign)};
}

std::vector<std::string> OptionalColumns(const Spec& spec) {
  std::vector<std::string> names;
  for (const ColumnKind& column : kOptional)
    if (Has(spec, column.name)) names.emplace_back(column.name);
  return names;
}

Status Save(const std::string& path, const std::string& text) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) return Fail(ErrorCode::kUnavailable, path + ": cannot be written");
  const std::size_t written = std::fwrite(text.data(), 1, text.size(), file);
  const bool closed = std::fclose(file) == 0;
  if (written != text.size() || !closed)
    return Fail(ErrorCode::kUnavailable, path + ": not written in full");
  return {};
}

}  // namespace focalfleet::hidden
