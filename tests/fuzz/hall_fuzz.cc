// The input is any bytes as a file of a Hall rig (field map, sensors, voltages, poses, model) or as
// the counts of a unit's sensors. The first byte picks the kind. They must give values that obey
// all rules or an error that names the file, never more. A model that was read is usable, and
// writing it gives a model again.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/hall/field_model_file.h"
#include "daemon/hall/hall_tables.h"
#include "protocol/base/check.h"
#include "sim/hall/fibre_carrier.h"
#include "sim/hall/orient.h"

namespace focalfleet {
namespace {

constexpr std::size_t kSensors = 8;

template <class T>
bool Named(const Result<T>& read) {
  if (read) return true;
  FOCALFLEET_CHECK(read.error().text.find("fuzz.file") == 0);
  return false;
}

void TryFieldMap(std::string_view text) {
  const auto map = ReadFieldMap(text, "fuzz.file");
  if (!Named(map)) return;
  for (const sim::FieldPoint& point : *map)
    FOCALFLEET_CHECK(std::isfinite(point.b_T) && std::isfinite(point.phi_rad) &&
                     point.theta_rad >= 0 && point.radius_mm > 0);
}

void TrySensors(std::string_view text) {
  const auto sensors = ReadSensors(text, "fuzz.file");
  if (!Named(sensors)) return;
  FOCALFLEET_CHECK(sensors->size() <= sim::kSensorsMax);
  for (const sim::HallSensor& sensor : *sensors)
    FOCALFLEET_CHECK(std::abs(sim::Length(sensor.direction) - 1) < 1e-2);
}

void TryVoltages(std::string_view text) {
  const auto rows = ReadVoltages(text, "fuzz.file", kSensors);
  if (!Named(rows)) return;
  for (const sim::VoltageRow& row : *rows) FOCALFLEET_CHECK(row.voltages_V.size() == kSensors);
}

void TryPoses(std::string_view text) {
  const auto table = ReadPoses(text, "fuzz.file", kSensors);
  if (Named(table)) FOCALFLEET_CHECK(table->poses.size() == table->rows.size());
}

void TryModel(std::string_view text) {
  const auto model = ReadHallModel(text, "fuzz.file");
  if (!Named(model)) return;
  const auto field = sim::MakeField(model->field);
  FOCALFLEET_CHECK(std::isfinite(field->Radial_T({0.6, 0, 0.8})));
  FOCALFLEET_CHECK(ReadHallModel(WriteHallModel(*model), "again").has_value());
}

void TryCounts(std::string_view bytes) {
  static const sim::OrientationSolver solver(
      sim::FibreCarrierRig(kSensors), sim::MakeField(sim::SurfaceParameters{.amplitude_T = 0.08}));
  std::array<std::uint16_t, kSensors> counts{};
  std::memcpy(counts.data(), bytes.data(), std::min(bytes.size(), sizeof counts));
  const sim::HallReading reading =
      sim::ReadingOf(solver.rig(), sim::VoltagesOf(counts, solver.rig().electronics));
  for (const sim::OrientationFit& fit : solver.Solve(reading)) {
    const sim::TipEstimate tip = sim::TipOf(fit.orientation, fit.unit_covariance, 30);
    FOCALFLEET_CHECK(std::hypot(tip.x_mm, tip.y_mm) <= 30 + 1e-9);
    FOCALFLEET_CHECK(tip.var_x_mm2 >= 0 && tip.var_y_mm2 >= 0);
  }
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view rest(static_cast<const char*>(static_cast<const void*>(data + 1)),
                              size - 1);
  constexpr void (*kReaders[])(std::string_view) = {focalfleet::TryFieldMap, focalfleet::TrySensors,
                                                    focalfleet::TryVoltages, focalfleet::TryPoses,
                                                    focalfleet::TryModel,    focalfleet::TryCounts};
  kReaders[data[0] % std::size(kReaders)](rest);
  return 0;
}
