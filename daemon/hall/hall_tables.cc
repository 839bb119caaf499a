#include "daemon/hall/hall_tables.h"

#include <cmath>
#include <utility>

#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

using sim::kRadPerDeg;

constexpr double kFieldMax_T = 10;
constexpr double kVoltageMax_V = 1000;
constexpr double kAngleMax_deg = 3600;
constexpr double kLengthTolerance = 0.01;
constexpr double kGainMax = 100;
constexpr double kOffsetMax_V = 100;

std::string VoltageColumn(std::size_t sensor) { return "v" + std::to_string(sensor + 1) + "_V"; }

Status RequireVoltages(const CsvTable& table, std::size_t sensors) {
  for (std::size_t k = 0; k < sensors; ++k)
    FOCALFLEET_TRY(table.Require({std::string_view(VoltageColumn(k))}));
  return {};
}

// A cell in degrees, converted to radians.
double Angle_rad(CsvRow* row, std::string_view column) {
  const double angle_deg = row->Number(column);
  if (std::abs(angle_deg) > kAngleMax_deg)
    row->Reject(column, row->Text(column) + " deg is ten turns or more");
  return angle_deg * kRadPerDeg;
}

sim::VoltageRow ReadRow(CsvRow* row, std::size_t sensors) {
  sim::VoltageRow out;
  for (std::size_t k = 0; k < sensors; ++k) {
    const std::string column = VoltageColumn(k);
    const auto voltage_V = row->NumberIfAny(column);
    if (voltage_V && std::abs(*voltage_V) > kVoltageMax_V)
      row->Reject(column, row->Text(column) + " V is no voltage of a Hall sensor");
    out.voltages_V.push_back(voltage_V.value_or(std::numeric_limits<double>::quiet_NaN()));
  }
  if (const auto temperature_C = row->NumberIfAny("temp_C")) {
    if (*temperature_C < -273.15 || *temperature_C > 1000)
      row->Reject("temp_C", row->Text("temp_C") + " is not between -273.15 and 1000 deg C");
    out.temperature_C = *temperature_C;
  }
  return out;
}

Status NotEmpty(const CsvTable& table) {
  if (table.size() > 0) return {};
  return Fail(ErrorCode::kInvalid, table.file() + ": there are no rows below the header");
}

void ReadGainAndOffset(CsvRow* row, sim::HallSensor* sensor) {
  sensor->gain = row->NumberIfAny("gain").value_or(1);
  if (sensor->gain == 0 || std::abs(sensor->gain) > kGainMax)
    row->Reject("gain", row->Text("gain") + " is no gain of a sensor: 1 is nominal");
  sensor->offset_V = row->NumberIfAny("offset_V").value_or(0);
  if (std::abs(sensor->offset_V) > kOffsetMax_V)
    row->Reject("offset_V", row->Text("offset_V") + " V is no offset from half of the supply");
}

}  // namespace

Result<sim::FieldMap> ReadFieldMap(std::string_view text, std::string file) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"theta_deg", "phi_deg", "b_T"}));
  FOCALFLEET_TRY(NotEmpty(table));
  sim::FieldMap map;
  map.reserve(table.size());
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    sim::FieldPoint point;
    point.theta_rad = Angle_rad(&row, "theta_deg");
    if (point.theta_rad < -1e-9 || point.theta_rad > 180 * kRadPerDeg + 1e-9)
      row.Reject("theta_deg", row.Text("theta_deg") + " is not between 0 and 180 deg");
    point.phi_rad = Angle_rad(&row, "phi_deg");
    point.b_T = row.Number("b_T");
    if (std::abs(point.b_T) > kFieldMax_T)
      row.Reject("b_T", row.Text("b_T") + " T is beyond 10 T: in tesla?");
    if (const auto radius_mm = row.NumberIfAny("r_mm")) {
      point.radius_mm = *radius_mm;
      if (!(*radius_mm > 0 && *radius_mm < 1e4))
        row.Reject("r_mm", row.Text("r_mm") + " is not between 0 and 10000 mm");
    }
    map.push_back(point);
  }));
  return map;
}

Result<std::vector<sim::HallSensor>> ReadSensors(std::string_view text, std::string file) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"sensor", "x", "y", "z"}));
  FOCALFLEET_TRY(NotEmpty(table));
  if (table.size() > sim::kSensorsMax)
    return Fail(ErrorCode::kInvalid, table.file() + ": " + std::to_string(table.size()) +
                                         " sensors, " + std::to_string(sim::kSensorsMax) +
                                         " is the most");
  std::vector<sim::HallSensor> sensors(table.size());
  std::vector<int> line_of(table.size(), 0);
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const std::int64_t number = row.Integer("sensor", {1, static_cast<std::int64_t>(table.size())});
    const sim::Vector3 direction{row.Number("x"), row.Number("y"), row.Number("z")};
    if (row.error()) return;
    const auto index = static_cast<std::size_t>(number - 1);
    if (line_of[index] != 0)
      row.Reject("sensor", "sensor " + std::to_string(number) + " is there twice, first in line " +
                               std::to_string(line_of[index]));
    const double length = Length(direction);
    if (std::abs(length - 1) > kLengthTolerance)
      row.Reject("x", "x, y, z have length " + NumberText(length) + ", a unit vector is expected");
    ReadGainAndOffset(&row, &sensors[index]);
    if (row.error()) return;
    line_of[index] = row.line();
    sensors[index].direction = Unit(direction);
  }));
  return sensors;
}

std::string WriteCalibration(const std::vector<sim::SensorFit>& sensors) {
  CsvWriter csv({"sensor", "x", "y", "z", "gain", "offset_V", "sd_gain", "sd_offset_V",
                 "sd_east_deg", "sd_north_deg", "readings", "rms_V", "status"});
  for (std::size_t k = 0; k < sensors.size(); ++k) {
    const sim::SensorFit& fit = sensors[k];
    const sim::HallSensor& sensor = fit.sensor;
    csv.Integer(static_cast<std::int64_t>(k + 1));
    for (const double value :
         {sensor.direction.x, sensor.direction.y, sensor.direction.z, sensor.gain, sensor.offset_V})
      csv.Number(value);
    for (const double sd : {fit.sd_gain, fit.sd_offset_V, fit.sd_east_rad / kRadPerDeg,
                            fit.sd_north_rad / kRadPerDeg}) {
      if (fit.status == sim::CalibrationStatus::kOk)
        csv.Number(sd);
      else
        csv.Missing();
    }
    csv.Integer(static_cast<std::int64_t>(fit.readings));
    csv.Number(fit.rms_after_V).Text(sim::Name(fit.status)).EndRow();
  }
  return csv.Take();
}

Result<std::vector<sim::VoltageRow>> ReadVoltages(std::string_view text, std::string file,
                                                  std::size_t sensors) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(RequireVoltages(table, sensors));
  FOCALFLEET_TRY(NotEmpty(table));
  std::vector<sim::VoltageRow> rows;
  rows.reserve(table.size());
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) { rows.push_back(ReadRow(&row, sensors)); }));
  return rows;
}

Result<PoseTable> ReadPoses(std::string_view text, std::string file, std::size_t sensors) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"alpha_deg", "beta_deg", "gamma_deg"}));
  FOCALFLEET_TRY(RequireVoltages(table, sensors));
  FOCALFLEET_TRY(NotEmpty(table));
  PoseTable poses;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    poses.poses.push_back(
        {Angle_rad(&row, "alpha_deg"), Angle_rad(&row, "beta_deg"), Angle_rad(&row, "gamma_deg")});
    poses.rows.push_back(ReadRow(&row, sensors));
    poses.has_temperature = poses.has_temperature || row.Has("temp_C");
  }));
  for (const std::string& column : table.Others({"alpha_deg", "beta_deg", "gamma_deg", "temp_C"})) {
    bool voltage = false;
    for (std::size_t k = 0; k < sensors; ++k) voltage = voltage || column == VoltageColumn(k);
    if (!voltage) poses.passed_over.push_back(column);
  }
  return poses;
}

std::string WriteEstimates(const sim::Estimates& estimates) {
  CsvWriter csv({"alpha_deg", "beta_deg", "gamma_deg", "sd_alpha_deg", "sd_beta_deg",
                 "sd_gamma_deg", "status"});
  for (const sim::RowEstimate& row : estimates.rows) {
    if (row.solved) {
      csv.Number(row.orientation.alpha_rad / kRadPerDeg)
          .Number(row.orientation.beta_rad / kRadPerDeg)
          .Number(row.orientation.gamma_rad / kRadPerDeg);
      for (const double sd_rad : row.sd_rad) csv.Number(sd_rad / kRadPerDeg);
    } else {
      for (int k = 0; k < 6; ++k) csv.Missing();
    }
    csv.Text(row.status).EndRow();
  }
  return csv.Take();
}

}  // namespace focalfleet
