#include "sim/hall/diagnosis/parameters.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

// Hermite polynomials belong to exp(-x^2): x^2 and x^4 are taken without their lower ones.
double Hermite(int degree, double x) {
  switch (degree) {
    case 0:
      return 1;
    case 1:
      return x;
    case 2:
      return x * x - 0.5;
    case 3:
      return x * (x * x - 1.5);
    case 4:
      return x * x * (x * x - 3) + 0.75;
    default:
      return x * x * (x * x * (x * x - 7.5) + 11.25) - 1.875;
  }
}

// Peak and width of a field from its own values on the sphere.
void Measure(const FieldModel& field, double* peak_T, double* width_rad) {
  double best_rad = 0;
  for (int k = 0; k < 720; ++k) {
    const double phi_rad = k * 0.5 * kRadPerDeg;
    const double b_T = std::abs(field.Radial_T({std::cos(phi_rad), std::sin(phi_rad), 0}));
    if (b_T > *peak_T) {
      *peak_T = b_T;
      best_rad = phi_rad;
    }
  }
  // The second moment along the meridian of the highest pole: exp(-(x/c)^2) has c^2 / 2.
  double sum = 0, moment = 0;
  for (int k = -60; k <= 60; ++k) {
    const double latitude_rad = k * kRadPerDeg;
    const double b_T = std::abs(
        field.Radial_T({std::cos(latitude_rad) * std::cos(best_rad),
                        std::cos(latitude_rad) * std::sin(best_rad), std::sin(latitude_rad)}));
    sum += b_T;
    moment += b_T * latitude_rad * latitude_rad;
  }
  *width_rad = sum > 0 ? std::sqrt(2 * moment / sum) : 21 * kRadPerDeg;
}

}  // namespace

const char* Name(HallCause cause) {
  switch (cause) {
    case HallCause::kFieldHarmonics:
      return "field_harmonics";
    case HallCause::kFieldWidth:
      return "field_width";
    case HallCause::kSensorGain:
      return "sensor_gain";
    case HallCause::kSensorOffset:
      return "sensor_offset";
    case HallCause::kSensorPosition:
      return "sensor_position";
    case HallCause::kCentreOffset:
      return "centre_offset";
    case HallCause::kTemperatureCoefficient:
      return "temperature_coefficient";
    case HallCause::kOutside:
      return "outside";
  }
  return "";
}

ParameterLayout LayoutOf(std::size_t sensors) {
  ParameterLayout layout{.sensors = sensors};
  const auto add = [&](int order, int degree) {
    layout.terms.push_back({order, degree, false});
    if (order > 0) layout.terms.push_back({order, degree, true});
  };
  // Orders along phi: unlike poles (all but 4), edges of poles (12, 20).
  for (const int order : {12, 20, 8, 16, 0, 1, 2, 3, 5, 6, 7}) add(order, 0);
  // Degrees along theta: the shape of a pole; degree 0 of order 4 is amplitude and phase.
  for (const int degree : {4, 5, 1, 3}) add(4, degree);
  add(12, 2);
  return layout;
}

HallForward::HallForward(const HallCampaign& campaign, const HallRig& rig, const FieldModel& field,
                         std::vector<OutsideEffect> effects)
    : campaign_(campaign), rig_(rig), field_(field), layout_(LayoutOf(rig.sensors.size())) {
  layout_.effects = std::move(effects);
  for (const Orientation& pose : campaign.poses) rotations_.emplace_back(pose);
  Measure(field, &peak_T_, &width_rad_);
  effects_of_.resize(layout_.sensors);
  for (std::size_t k = 0; k < layout_.effects.size(); ++k) {
    const OutsideEffect& effect = layout_.effects[k];
    if (effect.kind == OutsideKind::kPose) pose_effects_.push_back(k);
    for (std::size_t s = 0; s < layout_.sensors; ++s)
      if (effect.kind != OutsideKind::kPose && (effect.sensor < 0 || effect.sensor == int(s)))
        effects_of_[s].push_back(k);
  }
}

double HallForward::One(const Eigen::VectorXd& p, const Reading& reading) const {
  const std::size_t s = reading.sensor;
  const double rest_V = rig_.electronics.zero_V() + rig_.sensors[s].offset_V +
                        p[static_cast<Eigen::Index>(layout_.offset(s))];
  if (layout_.effects.empty()) return rest_V + Signal_V(p, reading, rotations_[reading.row]);
  const bool misread = std::any_of(pose_effects_.begin(), pose_effects_.end(), [&](std::size_t k) {
    return p[static_cast<Eigen::Index>(layout_.effect(k))] != 0;
  });
  const Rotation rotation = misread ? Rotation(Misread(p, reading.row)) : rotations_[reading.row];
  const double signal_V = Signal_V(p, reading, rotation);
  return rest_V + signal_V + Outside_V(p, reading, rotation, signal_V);
}

Orientation HallForward::Misread(const Eigen::VectorXd& p, std::size_t row) const {
  const Orientation& reported = campaign_.poses[row];
  Orientation truly = reported;
  double* angles[] = {&truly.alpha_rad, &truly.beta_rad, &truly.gamma_rad};
  for (const std::size_t k : pose_effects_)
    *angles[layout_.effects[k].angle] += p[static_cast<Eigen::Index>(layout_.effect(k))] *
                                         PoseFunction(layout_.effects[k].function, reported);
  return truly;
}

OutsideMoment HallForward::MomentOf(const Reading& reading, double signal_V) const {
  OutsideMoment at{.signal_V = signal_V};
  at.share = static_cast<double>(reading.row) / static_cast<double>(campaign_.rows.size()) - 0.5;
  const double temperature_C = campaign_.rows[reading.row].temperature_C;
  if (std::isfinite(temperature_C)) at.warm_K = temperature_C - campaign_.temperature_mean_C;
  return at;
}

double HallForward::Outside_V(const Eigen::VectorXd& p, const Reading& reading,
                              const Rotation& rotation, double signal_V) const {
  double volts = 0;
  for (const std::size_t k : effects_of_[reading.sensor]) {
    const double size = p[static_cast<Eigen::Index>(layout_.effect(k))];
    if (size == 0) continue;
    const OutsideEffect& effect = layout_.effects[k];
    OutsideMoment at = MomentOf(reading, signal_V);
    if (effect.kind == OutsideKind::kHears)
      at.other_V = Signal_V(p, {reading.row, effect.other}, rotation);
    if (effect.kind == OutsideKind::kLag && reading.row > 0)
      at.other_V = Signal_V(p, {reading.row - 1, reading.sensor}, rotations_[reading.row - 1]);
    volts += size * OutsideSlope(effect.kind, at);
  }
  return volts;
}

double HallForward::Signal_V(const Eigen::VectorXd& p, const Reading& reading,
                             const Rotation& rotation) const {
  const auto at = [&](std::size_t k) { return p[static_cast<Eigen::Index>(k)]; };
  const std::size_t s = reading.sensor;
  HallSensor sensor = rig_.sensors[s];
  sensor.direction = Shifted(sensor.direction, {at(layout_.shift(s)), at(layout_.shift(s) + 1)});
  const Vector3 away =
      (1 / rig_.radius_mm) *
      (rig_.centre_mm + Vector3{at(ParameterLayout::kCentre), at(ParameterLayout::kCentre + 1),
                                at(ParameterLayout::kCentre + 2)});
  double factor = 1;
  Vector3 direction = sensor.direction;
  if (Dot(away, away) > 0) {
    const double decay = rig_.decay + at(ParameterLayout::kDecay);
    direction = Unit(direction - (1 + TangentialShare(decay)) * away);
    factor = std::pow(Length(sensor.direction - away), -decay);
  }
  Vector3 local = rotation.ToRotor(direction);
  const double phase_rad = at(ParameterLayout::kPhase);
  const double c = std::cos(phase_rad), sn = std::sin(phase_rad);
  local = {c * local.x + sn * local.y, c * local.y - sn * local.x, local.z};

  const double flat = std::max(1e-12, std::sqrt(local.x * local.x + local.y * local.y));
  const double latitude_rad = std::atan2(local.z, flat);
  // The wider field at this latitude is the model's field nearer to the equator.
  const double stretched = latitude_rad * std::exp(-at(ParameterLayout::kWidth));
  const double shrink = std::cos(stretched) / flat;
  double b_T = field_.Radial_T({shrink * local.x, shrink * local.y, std::sin(stretched)});
  const double x = latitude_rad / width_rad_, height = peak_T_ * std::exp(-x * x);
  double phi_rad = 0;
  bool has_phi = false;
  for (std::size_t k = 0; k < layout_.terms.size(); ++k) {
    const double size = at(layout_.term(k));
    if (size == 0) continue;
    if (!has_phi) phi_rad = std::atan2(local.y, local.x);
    has_phi = true;
    const FieldTerm& term = layout_.terms[k];
    const double wave = term.sine ? std::sin(term.order * phi_rad) : std::cos(term.order * phi_rad);
    b_T += size * height * Hermite(term.degree, x) * wave;
  }
  const double temperature_C = campaign_.rows[reading.row].temperature_C;
  const double warm =
      std::isfinite(temperature_C) ? temperature_C - campaign_.temperature_mean_C : 0;
  factor *= (1 + at(ParameterLayout::kAmplitude)) * (1 + at(ParameterLayout::kTemperature) * warm);
  if (std::isfinite(temperature_C))
    factor *= 1 + rig_.temperature_per_K * (temperature_C - rig_.temperature_reference_C);
  return rig_.electronics.sensitivity_V_per_T * sensor.gain * (1 + at(layout_.gain(s))) * factor *
         b_T;
}

void HallForward::Predict(const Eigen::VectorXd& parameters, const std::vector<Reading>& readings,
                          Eigen::VectorXd* voltages_V) const {
  voltages_V->resize(static_cast<Eigen::Index>(readings.size()));
  for (std::size_t k = 0; k < readings.size(); ++k)
    (*voltages_V)[static_cast<Eigen::Index>(k)] = One(parameters, readings[k]);
}

double HallForward::Step(std::size_t parameter) const {
  if (parameter >= ParameterLayout::kCentre && parameter < ParameterLayout::kCentre + 3)
    return 1e-3;
  return parameter == ParameterLayout::kDecay ? 1e-3 : 1e-5;
}

int HallForward::SensorOf(std::size_t parameter) const {
  if (parameter >= layout_.library()) return layout_.effects[parameter - layout_.library()].sensor;
  if (parameter < ParameterLayout::kFirstSensor || parameter >= layout_.term(0)) return -1;
  const std::size_t k = parameter - ParameterLayout::kFirstSensor;
  if (k < 2 * layout_.sensors) return static_cast<int>(k % layout_.sensors);
  return static_cast<int>((k - 2 * layout_.sensors) / 2);
}

Eigen::MatrixXd HallForward::Slopes(const Eigen::VectorXd& parameters,
                                    const std::vector<Reading>& readings,
                                    const std::vector<std::size_t>& chosen) const {
  const auto rows = static_cast<Eigen::Index>(readings.size());
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(rows, static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t c = 0; c < chosen.size(); ++c) {
    const double step = Step(chosen[c]);
    const int own = SensorOf(chosen[c]);
    Eigen::VectorXd up = parameters, down = parameters;
    up[static_cast<Eigen::Index>(chosen[c])] += step;
    down[static_cast<Eigen::Index>(chosen[c])] -= step;
    for (std::size_t k = 0; k < readings.size(); ++k) {
      if (own >= 0 && readings[k].sensor != static_cast<std::size_t>(own)) continue;
      slopes(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(c)) =
          (One(up, readings[k]) - One(down, readings[k])) / (2 * step);
    }
  }
  return slopes;
}

Eigen::MatrixXd HallForward::EffectSlopes(const Eigen::VectorXd& p,
                                          const std::vector<Reading>& readings) const {
  constexpr double kStep_rad = 1e-5;
  const auto at = [](std::size_t k) { return static_cast<Eigen::Index>(k); };
  // The signals of every sensor in every row, also of readings that are not judged: other sensors
  // pick them up.
  Eigen::MatrixXd signals_V(at(rotations_.size()), at(layout_.sensors));
  std::vector<Orientation> truly;
  for (std::size_t row = 0; row < rotations_.size(); ++row) {
    truly.push_back(Misread(p, row));
    const Rotation rotation(truly.back());
    for (std::size_t s = 0; s < layout_.sensors; ++s)
      signals_V(at(row), at(s)) = Signal_V(p, {row, s}, rotation);
  }
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(at(readings.size()), at(layout_.effects.size()));
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const Reading& reading = readings[k];
    double by_angle_V[3];
    for (int angle = 0; angle < 3; ++angle) {
      const auto turned = [&](double step_rad) {
        Orientation o = truly[reading.row];
        (angle == 0 ? o.alpha_rad : angle == 1 ? o.beta_rad : o.gamma_rad) += step_rad;
        return Signal_V(p, reading, Rotation(o));
      };
      by_angle_V[angle] = (turned(kStep_rad) - turned(-kStep_rad)) / (2 * kStep_rad);
    }
    for (const std::size_t e : pose_effects_)
      slopes(at(k), at(e)) =
          by_angle_V[layout_.effects[e].angle] *
          PoseFunction(layout_.effects[e].function, campaign_.poses[reading.row]);
    OutsideMoment moment = MomentOf(reading, signals_V(at(reading.row), at(reading.sensor)));
    for (const std::size_t e : effects_of_[reading.sensor]) {
      const OutsideEffect& effect = layout_.effects[e];
      const bool lags = effect.kind == OutsideKind::kLag;
      moment.other_V =
          lags ? (reading.row > 0 ? signals_V(at(reading.row - 1), at(reading.sensor)) : 0)
               : signals_V(at(reading.row), at(effect.other));
      slopes(at(k), at(e)) = OutsideSlope(effect.kind, moment);
    }
  }
  return slopes;
}

}  // namespace focalfleet::sim
