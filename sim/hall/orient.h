// The orientation from the voltages of a rig, by least squares over all sensors that can be trusted
// in that reading. The result has a covariance, and lists the other orientations that explain the
// voltages as well.
//
// Refine is the inner loop: Gauss-Newton on three angles with the field's exact slopes, damped
// where it does not descend. From within some degrees it converges quadratically, in three steps.
// Where no start is known, an atlas of predicted readings over all orientations gives the starts.
// The atlas has 13 x 13 x 16 nodes and is compared in one pass of some 10 us. Every local minimum
// of the comparison is refined, and the distinct ends are kept. The angle gamma has the period of
// the field, 90 deg for eight equal poles, and is sought in -45..45 deg. Where only magnitudes are
// known (the paper's V - Vs/2|), a turn by half the period leaves all of them as they are. There
// are then always at least two branches, and both are reported.
//
// Units: T, radians; the fields that the sensors should see at gain 1.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sim/hall/rig.h"

namespace focalfleet::sim {

struct HallReading {
  std::array<double, kSensorsMax> b_T{};
  std::uint32_t used = 0;  // bit k: sensor k may be trusted
};

/// The fields that the voltages of one row stand for. Sensors whose voltage is NaN or at an end of
/// its range are not used. Shape: as many voltages as sensors.
HallReading ReadingOf(const HallRig& rig, std::span<const double> voltages_V, double scale = 1);

struct OrientationFit {
  Orientation orientation;
  /// alpha, beta, gamma; rad^2 for noise of 1 T a sensor: times its variance
  std::array<std::array<double, 3>, 3> unit_covariance{};
  double squares_T2 = 0;  // of the residuals
  int sensors = 0;
  int steps = 0;
  bool converged = false;  // and the sensors determine all angles
};

class OrientationSolver {
 public:
  struct Options {
    bool magnitudes = false;  // readings are |B|
    double tilt_max_rad = 45 * kRadPerDeg;
    /// A step shorter than this is the last one and is not checked again. 1e-3 leaves an error of
    /// some thousandths of a degree at readings with 0.5 mT of noise, whose own effect is tenths.
    /// The value saves a third of the field's evaluations; 0 goes on to the end of the digits.
    double last_step_rad = 0;
  };
  /// Lifetime: keeps `field`. Cost: the atlas, about 3 ms.
  OrientationSolver(HallRig rig, std::shared_ptr<const FieldModel> field, const Options& options);
  OrientationSolver(HallRig rig, std::shared_ptr<const FieldModel> field)
      : OrientationSolver(std::move(rig), std::move(field), Options{}) {}

  /// Refines a start within some degrees. Cost: no allocation; about a field evaluation of all
  /// sensors a step.
  [[nodiscard]] OrientationFit Refine(const HallReading& reading, const Orientation& start) const;

  /// All distinct minima, best first; none where fewer than three sensors may be trusted. Cost:
  /// about 100 us.
  [[nodiscard]] std::vector<OrientationFit> Solve(const HallReading& reading) const;

  [[nodiscard]] const HallRig& rig() const { return rig_; }
  /// The readings of each sensor at an orientation. Shape: as many as sensors.
  void Predict(const Orientation& orientation, std::span<double> b_T) const;
  /// The orientation with gamma within its period, where the field has one of 90 deg.
  [[nodiscard]] Orientation Wrapped(Orientation orientation) const;

 private:
  static constexpr std::size_t kBlocks = kSensorsMax / kLanes;
  [[nodiscard]] std::size_t count() const { return rig_.sensors.size(); }
  struct Linear;
  [[nodiscard]] Linear Linearise(const HallReading& reading, const Orientation& at) const;
  void MakeAtlas();
  [[nodiscard]] std::vector<Orientation> Starts(const HallReading& reading) const;
  [[nodiscard]] Orientation Node(std::size_t index) const;

  HallRig rig_;
  std::shared_ptr<const FieldModel> field_;
  Options options_;
  bool periodic_;  // in -45..45 deg of gamma
  // The direction of each sensor as the rotor's centre sees it; unused lanes repeat the first.
  std::array<DirectionLanes, kBlocks> directions_;
  std::array<Lane, kBlocks> factors_;
  std::vector<float> atlas_;  // Shape: (sensors, nodes): one sensor's nodes lie together
};

}  // namespace focalfleet::sim
