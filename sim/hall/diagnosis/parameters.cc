#include "sim/hall/diagnosis/parameters.h"

#include <algorithm>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

// Hermite polynomials that belong to exp(-x^2): x^2 and x^4 without what lower ones already are.
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

// Peak and width of a field as its own values on the sphere tell them.
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
  // Second moment along the meridian of the highest pole: exp(-(x/c)^2) has c^2 / 2.
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
  }
  return "";
}

ParameterLayout LayoutOf(std::size_t sensors) {
  ParameterLayout layout{.sensors = sensors};
  const auto add = [&](int order, int degree) {
    layout.terms.push_back({order, degree, false});
    if (order > 0) layout.terms.push_back({order, degree, true});
  };
  // Along phi: unlike poles (all but 4), edges of poles (12, 20).
  for (const int order : {12, 20, 8, 16, 0, 1, 2, 3, 5, 6, 7}) add(order, 0);
  // Along theta: the shape of a pole; 0 of order 4 is amplitude and phase.
  for (const int degree : {4, 5, 1, 3}) add(4, degree);
  add(12, 2);
  return layout;
}

HallForward::HallForward(const HallCampaign& campaign, const HallRig& rig, const FieldModel& field)
    : campaign_(campaign), rig_(rig), field_(field), layout_(LayoutOf(rig.sensors.size())) {
  for (const Orientation& pose : campaign.poses) rotations_.emplace_back(pose);
  Measure(field, &peak_T_, &width_rad_);
}

double HallForward::One(const Eigen::VectorXd& p, const Reading& reading) const {
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
  Vector3 local = rotations_[reading.row].ToRotor(direction);
  const double phase_rad = at(ParameterLayout::kPhase);
  const double c = std::cos(phase_rad), sn = std::sin(phase_rad);
  local = {c * local.x + sn * local.y, c * local.y - sn * local.x, local.z};

  const double flat = std::max(1e-12, std::sqrt(local.x * local.x + local.y * local.y));
  const double latitude_rad = std::atan2(local.z, flat);
  // The wider field at this latitude is the model's nearer to the equator.
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
  return rig_.electronics.zero_V() + sensor.offset_V + at(layout_.offset(s)) +
         rig_.electronics.sensitivity_V_per_T * sensor.gain * (1 + at(layout_.gain(s))) * factor *
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

}  // namespace focalfleet::sim
