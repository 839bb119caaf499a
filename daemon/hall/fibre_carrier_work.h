// From the sensor readings of units to where they are: what the measuring thread does for the units
// that measure themselves. Each reading by itself gives an orientation by least squares; the tip of
// its fibre carrier is the fibre. Five numbers a reading check each other: where they contradict
// (chi^2), no place is told, and the unit's last dozen readings are asked which sensor lies
// (sim/hall/estimate.h).
//
// A joint does not know its branch: other orientations may explain a reading as well. The one that
// is near to where the unit is believed is taken if no other is near, too.
//
// Cost: 0.1 ms a unit; 0.5 s for each of up to kDoubtsExamined units that are not believed.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "daemon/hall/field_model_file.h"
#include "fleet/coordinator.h"
#include "sim/hall/estimate.h"

namespace focalfleet {

class FibreCarrierWorker {
 public:
  struct Options {
    double noise_T = 3e-5;  // of a sensor's reading, with what model and calibration leave
    double tilt_max_deg = 45;
  };
  /// The model serves all units of the layout that have sensors. `layout` outlives the worker.
  /// Errors: kInvalid: neither 6 nor 8 sensors, or the model knows one that is not there.
  static Result<std::unique_ptr<FibreCarrierWorker>> Create(const Layout& layout,
                                                            const HallModelFile& model,
                                                            const Options& options);

  /// A measurement of each unit with a reading, in the order of the layout.
  std::vector<Measurement> Measure(const ExposureJob& job, std::span<const UnitDrive> drives);

  static constexpr int kDoubtsExamined = 20;  // of a job

 private:
  FibreCarrierWorker(const Layout& layout, const Options& options)
      : layout_(layout), options_(options) {}
  struct Looked;
  [[nodiscard]] Looked Look(PositionerIndex i, const sim::VoltageRow& row, PointFp believed_fp);
  void Examine(PositionerIndex i, FibreCarrierReading* carrier, int* examined);
  [[nodiscard]] Measurement MeasurementOf(PositionerIndex i, const ExposureJob& job,
                                          const UnitDrive& drive, int* examined);

  const Layout& layout_;
  Options options_;
  std::shared_ptr<const sim::FieldModel> field_;
  std::map<std::size_t, std::unique_ptr<sim::OrientationSolver>> solvers_;  // by sensors
  std::map<std::uint32_t, std::deque<sim::VoltageRow>> history_;            // by index of the unit
};

}  // namespace focalfleet
