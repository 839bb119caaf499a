// FibreCarrierWorker turns the sensor readings of units into positions. The measuring thread uses
// it for the units that measure themselves. Each reading by itself gives an orientation by least
// squares; the tip of the unit's fibre carrier is the fibre.
//
// The sensors outnumber the three angles (by five in a set of 8), so a reading checks itself. Where
// its numbers contradict each other (chi^2), no position is given. The worker then tests the unit's
// last dozen readings for the sensor that is wrong (sim/hall/estimate.h).
//
// The branch of a joint is not known from one reading: other orientations may explain it as well.
// The orientation near the believed position is taken if no other is near, too.
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
    double noise_T = 3e-5;  // of a sensor's reading, including what model and calibration leave
    double tilt_max_deg = 45;
  };
  /// A worker whose model serves all units of the layout that have sensors. `layout` outlives the
  /// worker.
  /// Errors: kInvalid: neither 6 nor 8 sensors, or the model has a sensor that the units lack.
  static Result<std::unique_ptr<FibreCarrierWorker>> Create(const Layout& layout,
                                                            const HallModelFile& model,
                                                            const Options& options);

  /// A measurement of each unit with a reading, in the order of the layout.
  std::vector<Measurement> Measure(const ExposureJob& job, std::span<const UnitDrive> drives);

  static constexpr int kDoubtsExamined = 20;  // in one job

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
  std::map<std::size_t, std::unique_ptr<sim::OrientationSolver>> solvers_;  // by number of sensors
  std::map<std::uint32_t, std::deque<sim::VoltageRow>> history_;            // by index of the unit
};

}  // namespace focalfleet
