#include "tests/sim/hall/planted_rig.h"

#include <cmath>
#include <cstdio>

#include "protocol/base/rng.h"

namespace focalfleet::testing {
namespace {

constexpr double kDeg = 3.14159265358979323846 / 180;

Mat Times(const Mat& a, const Mat& b) {
  Mat c{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) c[i][j] += a[i][k] * b[k][j];
  return c;
}

double Inner(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double Norm(const Vec& a) { return std::sqrt(Inner(a, a)); }

}  // namespace

Mat RotationMatrix(double alpha_rad, double beta_rad, double gamma_rad) {
  const double ca = std::cos(alpha_rad), sa = std::sin(alpha_rad);
  const double cb = std::cos(beta_rad), sb = std::sin(beta_rad);
  const double cg = std::cos(gamma_rad), sg = std::sin(gamma_rad);
  const Mat x = {{{1, 0, 0}, {0, ca, -sa}, {0, sa, ca}}};
  const Mat y = {{{cb, 0, sb}, {0, 1, 0}, {-sb, 0, cb}}};
  const Mat z = {{{cg, -sg, 0}, {sg, cg, 0}, {0, 0, 1}}};
  return Times(Times(x, y), z);
}

Vec BackTurned(const Mat& m, const Vec& v) {
  Vec out{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) out[i] += m[j][i] * v[j];
  return out;
}

DipoleRotor::DipoleRotor(const std::vector<Shell>& shells, int cuts) {
  for (const Shell& shell : shells)
    for (int pole = 0; pole < 8; ++pole)
      for (int a = 0; a < cuts; ++a)
        for (int b = 0; b < cuts; ++b)
          for (int c = 0; c < cuts; ++c) {
            const double share = 1.0 / cuts;
            const double r = shell.inner_mm + (shell.outer_mm - shell.inner_mm) * (a + 0.5) * share;
            const double latitude = shell.half_height_deg * kDeg * (2 * (b + 0.5) * share - 1);
            const double width = 0.9 * 45 * kDeg;
            const double longitude = pole * 45 * kDeg + width * ((c + 0.5) * share - 0.5);
            const double volume = (shell.outer_mm - shell.inner_mm) * share * r *
                                  (2 * shell.half_height_deg * kDeg * share) * r *
                                  std::cos(latitude) * width * share;
            const Vec out = {std::cos(latitude) * std::cos(longitude),
                             std::cos(latitude) * std::sin(longitude), std::sin(latitude)};
            const double moment = (pole % 2 == 0 ? 1.0 : -1.0) *
                                  shell.strength[static_cast<std::size_t>(pole)] * 1.2 * volume;
            dipoles_.push_back({r * out[0], r * out[1], r * out[2], moment * out[0],
                                moment * out[1], moment * out[2]});
          }
}

Vec DipoleRotor::Field(const Vec& place_mm) const {
  Vec sum{};
  for (const auto& dipole : dipoles_) {
    const Vec r = {place_mm[0] - dipole[0], place_mm[1] - dipole[1], place_mm[2] - dipole[2]};
    const Vec m = {dipole[3], dipole[4], dipole[5]};
    const double square = Inner(r, r), cube = square * std::sqrt(square);
    const double along = 3 * Inner(m, r) / square;
    for (std::size_t k = 0; k < 3; ++k)
      sum[k] += (along * r[k] - m[k]) / (4 * 3.14159265358979323846 * cube);
  }
  return sum;
}

std::vector<Shell> PlantedOneShell() { return {{34, 44, 20.09}}; }
std::vector<Shell> PlantedTwoShells() { return {{34, 44, 20.09}, {85, 92.7, 11}}; }

std::vector<Vec> PlantedSensors() {
  const double a = 11.25 * kDeg, b = 75 * kDeg, c = 15 * kDeg;
  return {{std::cos(a), std::sin(a), 0},
          {std::cos(a), -std::sin(a), 0},
          {std::sin(b), 0, std::cos(b)},
          {std::sin(b), 0, -std::cos(b)},
          {0, std::cos(c), std::sin(c)},
          {0, std::cos(c), -std::sin(c)},
          {1, 0, 0},
          {0, 1, 0}};
}

FieldLaw OfRotor(const DipoleRotor& rotor) {
  return [&rotor](const Vec& place, const Vec& axis) { return Inner(rotor.Field(place), axis); };
}

FieldLaw OfSurface(double amplitude_T, double width_deg) {
  return [=](const Vec& place, const Vec&) {
    const double latitude = std::asin(place[2] / Norm(place)) / kDeg;
    return amplitude_T * std::exp(-latitude * latitude / (width_deg * width_deg)) *
           std::cos(4 * std::atan2(place[1], place[0]));
  };
}

PlantedCampaign MakeCampaign(const CampaignPlan& plan, const FieldLaw& law, const FieldLaw& wrong,
                             const Planted& planted) {
  PlantedCampaign campaign;
  campaign.planted = planted;
  Rng rng = Rng::Stream(plan.seed, "planted rig");
  const std::vector<Vec> nominal = PlantedSensors();
  std::vector<Vec> sensors = nominal;
  const double turn = rng.Uniform(0, 6.283185307179586);
  Vec centre{};
  if (planted.cause == "sensor_position") {
    // Size in degrees along the sphere, in a direction by chance.
    Vec& s = sensors[planted.sensor];
    const Vec other = std::abs(s[2]) < 0.9 ? Vec{0, 0, 1} : Vec{1, 0, 0};
    Vec east = {other[1] * s[2] - other[2] * s[1], other[2] * s[0] - other[0] * s[2],
                other[0] * s[1] - other[1] * s[0]};
    const double length = Norm(east);
    for (double& part : east) part /= length;
    const Vec north = {s[1] * east[2] - s[2] * east[1], s[2] * east[0] - s[0] * east[2],
                       s[0] * east[1] - s[1] * east[0]};
    const double way = std::tan(planted.size * kDeg);
    for (std::size_t k = 0; k < 3; ++k)
      s[k] += way * (std::cos(turn) * east[k] + std::sin(turn) * north[k]);
    const double stretched = Norm(s);
    for (double& part : s) part /= stretched;
  }
  if (planted.cause == "centre_offset") {
    const double z = rng.Uniform(-1, 1), flat = std::sqrt(1 - z * z);
    centre = {planted.size * flat * std::cos(turn), planted.size * flat * std::sin(turn),
              planted.size * z};
  }
  for (std::size_t row = 0; row < plan.rows; ++row) {
    PlantedPose pose;
    pose.alpha_deg = rng.Uniform(-plan.tilt_deg, plan.tilt_deg);
    pose.beta_deg = rng.Uniform(-plan.tilt_deg, plan.tilt_deg);
    pose.gamma_deg = rng.Uniform(-45, 45);
    pose.temp_C = rng.Uniform(5, 25);
    const Mat m =
        RotationMatrix(pose.alpha_deg * kDeg, pose.beta_deg * kDeg, pose.gamma_deg * kDeg);
    for (std::size_t k = 0; k < sensors.size(); ++k) {
      const auto read = [&](const FieldLaw& field, const Vec& direction, const Vec& shift) {
        const Vec place = {59 * direction[0] - shift[0], 59 * direction[1] - shift[1],
                           59 * direction[2] - shift[2]};
        return field(BackTurned(m, place), BackTurned(m, direction));
      };
      const double clean_T = read(law, nominal[k], Vec{});
      double volts = 2.5 + 25 * read(wrong, sensors[k], centre);
      if (planted.cause == "sensor_gain" && k == planted.sensor)
        volts = 2.5 + (1 + planted.size) * (volts - 2.5);
      if (planted.cause == "sensor_offset" && k == planted.sensor) volts += planted.size;
      if (planted.cause == "temperature_coefficient")
        volts = 2.5 + (1 + planted.size * (pose.temp_C - 20)) * (volts - 2.5);
      const double change = (volts - 2.5 - 25 * clean_T) / (25 * plan.noise_T);
      campaign.lambda += change * change;
      pose.volts.push_back(volts + 25 * plan.noise_T * rng.Normal());
    }
    campaign.poses.push_back(pose);
  }
  return campaign;
}

std::string CampaignText(const PlantedCampaign& campaign, bool temperatures) {
  std::string text = "alpha_deg,beta_deg,gamma_deg";
  for (int k = 1; k <= 8; ++k) text += ",v" + std::to_string(k) + "_V";
  text += temperatures ? ",temp_C\n" : "\n";
  char cell[64];
  for (const PlantedPose& pose : campaign.poses) {
    std::snprintf(cell, sizeof cell, "%.9g,%.9g,%.9g", pose.alpha_deg, pose.beta_deg,
                  pose.gamma_deg);
    text += cell;
    for (const double volts : pose.volts) {
      std::snprintf(cell, sizeof cell, ",%.9g", volts);
      text += cell;
    }
    if (temperatures) {
      std::snprintf(cell, sizeof cell, ",%.6g", pose.temp_C);
      text += cell;
    }
    text += "\n";
  }
  return text;
}

}  // namespace focalfleet::testing
