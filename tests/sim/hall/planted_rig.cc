#include "tests/sim/hall/planted_rig.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "protocol/base/rng.h"

namespace focalfleet::test {
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

namespace {

// The chi^2 of a change after two free directions are projected out (Gram and Schmidt).
class FreeDirections {
 public:
  void Add(double change, double amplitude, double phase) {
    const double row[3] = {amplitude, phase, change};
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) product_[i][j] += row[i] * row[j];
  }
  [[nodiscard]] double Left() const {
    double p[3][3];
    std::copy(&product_[0][0], &product_[0][0] + 9, &p[0][0]);
    for (std::size_t i = 0; i < 2; ++i) {
      if (p[i][i] <= 0) continue;
      for (std::size_t j = i + 1; j < 3; ++j) {
        const double share = p[i][j] / p[i][i];
        for (std::size_t k = 0; k < 3; ++k) p[j][k] -= share * p[i][k];
      }
    }
    return p[2][2];
  }

 private:
  double product_[3][3] = {};
};

struct AsMade {
  std::vector<Vec> sensors = PlantedSensors();
  Vec centre{};
};

void Displace(const Planted& planted, Rng* rng, AsMade* made) {
  const double turn = rng->Uniform(0, 6.283185307179586);
  if (planted.cause == "sensor_position") {
    // The size is in degrees along the sphere, in a random direction.
    Vec& s = made->sensors[planted.sensor];
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
    const double z = rng->Uniform(-1, 1), flat = std::sqrt(1 - z * z);
    made->centre = {planted.size * flat * std::cos(turn), planted.size * flat * std::sin(turn),
                    planted.size * z};
  }
}

struct Moment {
  std::size_t sensor;
  double temp_C;
  double share;        // of the campaign that has passed
  double neighbour_V;  // of the next sensor, from half of the supply
  double alpha_rad;
};
double Spoiled(double volts, const Planted& planted, const Moment& at) {
  const bool own = at.sensor == planted.sensor;
  if (planted.cause == "sensor_gain" && own) return 2.5 + (1 + planted.size) * (volts - 2.5);
  if (planted.cause == "sensor_offset" && own) return volts + planted.size;
  if (planted.cause == "temperature_coefficient")
    return 2.5 + (1 + planted.size * (at.temp_C - 20)) * (volts - 2.5);
  if (planted.cause == "drift" && own) return volts + planted.size * (at.share - 0.5);
  if (planted.cause == "crosstalk" && own) return volts + planted.size * at.neighbour_V;
  if (planted.cause == "iron" && own)
    return 2.5 + (1 + planted.size * at.alpha_rad) * (volts - 2.5);
  return volts;
}

double Dirt(double volts, double noise_V, Rng* rng) {
  const double draw = rng->Uniform();
  if (draw < 0.01) return std::nan("");
  if (draw < 0.02) return rng->Uniform(0, 5);
  if (draw < 0.07) return volts + 4 * noise_V * rng->Normal();
  return volts;
}

struct Angles {
  double alpha_deg, beta_deg, gamma_deg;
};
// The true orientation of the rotor for a reported one.
Angles Truly(const PlantedPose& reported, double alpha_before_deg,
             const std::vector<Planted>& causes) {
  Angles truly{reported.alpha_deg, reported.beta_deg, reported.gamma_deg};
  for (const Planted& planted : causes) {
    if (planted.cause == "pose_scale") truly.alpha_deg += planted.size * reported.alpha_deg;
    if (planted.cause == "play")
      truly.alpha_deg +=
          reported.alpha_deg > alpha_before_deg ? planted.size / 2 : -planted.size / 2;
    if (planted.cause == "cogging")
      truly.gamma_deg += planted.size * std::cos(8 * reported.gamma_deg * kDeg);
  }
  return truly;
}

}  // namespace

PlantedCampaign MakeCampaign(const CampaignPlan& plan, const FieldLaw& law, const FieldLaw& wrong,
                             const Planted& planted) {
  PlantedCampaign campaign;
  campaign.planted = planted;
  Rng rng = Rng::Stream(plan.seed, "planted rig");
  const std::vector<Vec> nominal = PlantedSensors();
  AsMade made;
  std::vector<Planted> causes = plan.also;
  causes.insert(causes.begin(), planted);
  for (const Planted& cause : causes) Displace(cause, &rng, &made);
  const double noise_V = 25 * plan.noise_T;
  double alpha_before_deg = 0;
  FreeDirections free;
  for (std::size_t row = 0; row < plan.rows; ++row) {
    PlantedPose pose;
    pose.alpha_deg = rng.Uniform(-plan.tilt_deg, plan.tilt_deg);
    pose.beta_deg = rng.Uniform(-plan.tilt_deg, plan.tilt_deg);
    pose.gamma_deg = rng.Uniform(-45, 45);
    pose.temp_C = rng.Uniform(5, 25);
    const auto turned = [](const Angles& at) {
      return RotationMatrix(at.alpha_deg * kDeg, at.beta_deg * kDeg, at.gamma_deg * kDeg);
    };
    const Mat reported = turned({pose.alpha_deg, pose.beta_deg, pose.gamma_deg});
    const Mat truly = turned(Truly(pose, alpha_before_deg, causes));
    const Mat beside = turned({pose.alpha_deg, pose.beta_deg, pose.gamma_deg + 0.01});
    alpha_before_deg = pose.alpha_deg;
    const auto read = [](const Mat& m, const FieldLaw& field, const Vec& direction,
                         const Vec& shift) {
      const Vec place = {59 * direction[0] - shift[0], 59 * direction[1] - shift[1],
                         59 * direction[2] - shift[2]};
      return 25 * field(BackTurned(m, place), BackTurned(m, direction));
    };
    for (std::size_t k = 0; k < nominal.size(); ++k) {
      const double clean_V = read(reported, law, nominal[k], Vec{});
      const std::size_t next = (k + 1) % nominal.size();
      const Moment at{k, pose.temp_C, static_cast<double>(row) / static_cast<double>(plan.rows),
                      read(truly, wrong, made.sensors[next], made.centre), pose.alpha_deg * kDeg};
      double volts = 2.5 + read(truly, wrong, made.sensors[k], made.centre);
      for (const Planted& cause : causes) volts = Spoiled(volts, cause, at);
      const double change = (volts - 2.5 - clean_V) / noise_V;
      campaign.lambda += change * change;
      free.Add(change, clean_V / noise_V,
               (read(beside, law, nominal[k], Vec{}) - clean_V) / noise_V);
      volts += noise_V * rng.Normal();
      pose.volts.push_back(plan.dirty ? Dirt(volts, noise_V, &rng) : volts);
    }
    campaign.poses.push_back(pose);
  }
  campaign.lambda_free = free.Left();
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

}  // namespace focalfleet::test
