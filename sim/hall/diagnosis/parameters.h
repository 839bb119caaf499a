// All deviations of a Hall rig from its model, as one list of numbers, and the forward model that
// takes them. The diagnosis switches these parameters on and fits them. Zero means "as the model
// says" for each.
//
// The field's shape has two kinds of parameter. The latitude is stretched (width). Terms peak *
// He_k(latitude / c) exp(-(latitude / c)^2) cos or sin(m phi) are added, which together can form
// any field. The amplitude and the phase of the model are free, because the paper gives neither.
//
// Units: gains and terms relative, offsets V, shifts and phases rad, centre mm, temperature 1/K.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "sim/hall/diagnosis/outside.h"
#include "sim/hall/estimate.h"
#include "sim/hall/field_model.h"

namespace focalfleet::sim {

/// The root mean square; 0 of no values.
inline double Rms(const Eigen::VectorXd& values) {
  return values.size() == 0 ? 0
                            : std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}
/// Eigen counts with a sign.
inline Eigen::Index At(std::size_t k) { return static_cast<Eigen::Index>(k); }

enum class HallCause {
  kFieldHarmonics,
  kFieldWidth,
  kSensorGain,
  kSensorOffset,
  kSensorPosition,
  kCentreOffset,
  kTemperatureCoefficient,
  kOutside,  // none of the causes: an effect of outside.h
};
inline constexpr HallCause kHallCauses[] = {
    HallCause::kFieldHarmonics,        HallCause::kFieldWidth,     HallCause::kSensorGain,
    HallCause::kSensorOffset,          HallCause::kSensorPosition, HallCause::kCentreOffset,
    HallCause::kTemperatureCoefficient};
/// The id in reports.
const char* Name(HallCause cause);

struct FieldTerm {
  int order = 4;   // m
  int degree = 0;  // k of He_k
  bool sine = false;
};

/// The index at which each kind of parameter begins in the list.
struct ParameterLayout {
  std::size_t sensors = 8;
  std::vector<FieldTerm> terms;
  std::vector<OutsideEffect> effects;  // empty where only causes are fitted

  static constexpr std::size_t kAmplitude = 0;
  static constexpr std::size_t kPhase = 1;
  static constexpr std::size_t kWidth = 2;  // of the logarithm
  static constexpr std::size_t kTemperature = 3;
  static constexpr std::size_t kCentre = 4;  // three numbers
  static constexpr std::size_t kDecay = 7;   // times the offset: visible only where that is not 0
  static constexpr std::size_t kFirstSensor = 8;

  [[nodiscard]] std::size_t gain(std::size_t sensor) const { return kFirstSensor + sensor; }
  [[nodiscard]] std::size_t offset(std::size_t sensor) const {
    return kFirstSensor + sensors + sensor;
  }
  [[nodiscard]] std::size_t shift(std::size_t sensor) const {  // east, north
    return kFirstSensor + 2 * sensors + 2 * sensor;
  }
  [[nodiscard]] std::size_t term(std::size_t k) const { return kFirstSensor + 4 * sensors + k; }
  [[nodiscard]] std::size_t effect(std::size_t k) const { return term(terms.size()) + k; }
  /// The number of parameters of the causes alone.
  [[nodiscard]] std::size_t library() const { return effect(0); }
  [[nodiscard]] std::size_t size() const { return effect(effects.size()); }
};

ParameterLayout LayoutOf(std::size_t sensors);

struct HallCampaign {
  std::vector<Orientation> poses;
  std::vector<VoltageRow> rows;  // as many
  bool has_temperature = false;
  double temperature_mean_C = 20;
};

/// A judged reading: its row and sensor.
struct Reading {
  std::size_t row = 0;
  std::size_t sensor = 0;
};

class HallForward {
 public:
  /// Lifetime: keeps all three. `effects`: effects beyond the causes that the model can take.
  HallForward(const HallCampaign& campaign, const HallRig& rig, const FieldModel& field,
              std::vector<OutsideEffect> effects = {});

  /// The same rig in other poses. Lifetime: keeps `campaign`.
  [[nodiscard]] HallForward At(const HallCampaign& campaign) const {
    return HallForward(campaign, rig_, field_, layout_.effects);
  }

  [[nodiscard]] double zero_V() const { return rig_.electronics.zero_V(); }
  [[nodiscard]] const ParameterLayout& layout() const { return layout_; }

  /// The voltages of the readings. Shape: as many as readings.
  void Predict(const Eigen::VectorXd& parameters, const std::vector<Reading>& readings,
               Eigen::VectorXd* voltages_V) const;
  /// Their derivatives by central differences. Shape: (readings, chosen). Cost: two predictions a
  /// parameter; for a sensor's own parameters only of its readings.
  [[nodiscard]] Eigen::MatrixXd Slopes(const Eigen::VectorXd& parameters,
                                       const std::vector<Reading>& readings,
                                       const std::vector<std::size_t>& chosen) const;

  /// The derivatives by all effects, which are linear in their sizes. Shape: (readings, effects).
  /// Cost: six predictions, and a product a number.
  [[nodiscard]] Eigen::MatrixXd EffectSlopes(const Eigen::VectorXd& parameters,
                                             const std::vector<Reading>& readings) const;

 private:
  [[nodiscard]] double One(const Eigen::VectorXd& parameters, const Reading& reading) const;
  // The voltage without offsets.
  [[nodiscard]] double Signal_V(const Eigen::VectorXd& parameters, const Reading& reading,
                                const Rotation& rotation) const;
  [[nodiscard]] OutsideMoment MomentOf(const Reading& reading, double signal_V) const;
  [[nodiscard]] double Outside_V(const Eigen::VectorXd& parameters, const Reading& reading,
                                 const Rotation& rotation, double signal_V) const;
  [[nodiscard]] Orientation Misread(const Eigen::VectorXd& parameters, std::size_t row) const;
  [[nodiscard]] double Step(std::size_t parameter) const;
  // -1: the parameter belongs to all sensors.
  [[nodiscard]] int SensorOf(std::size_t parameter) const;

  const HallCampaign& campaign_;
  const HallRig& rig_;
  const FieldModel& field_;
  ParameterLayout layout_;
  std::vector<Rotation> rotations_;
  std::vector<std::size_t> pose_effects_;
  std::vector<std::vector<std::size_t>> effects_of_;  // of each sensor; common effects are in all
  double peak_T_ = 0;
  double width_rad_ = 0;
};

}  // namespace focalfleet::sim
