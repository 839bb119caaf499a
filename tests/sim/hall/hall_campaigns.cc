// Campaigns with one planted cause or none, drawn by an independent plant and diagnosed from what a
// file would hold. Prints how many were named right, and ends with 1 where a figure is missed: of
// nulls named at most 1 %, of single causes with lambda >= 100 named exactly at least 97 %, wrong
// and sure at most 0.5 % (with few campaigns: at most one of each more).
//   hall_campaigns [--per 6] [--nulls 20] [--magnets 0] [--seed 1]
#include <cmath>
#include <cstdio>
#include <map>
#include <string>

#include "sim/hall/diagnosis/hall_diagnosis.h"
#include "sim/hall/field_fit.h"
#include "tests/bench/options.h"
#include "tests/sim/hall/planted_rig.h"

namespace {

using namespace focalfleet;  // NOLINT(google-build-using-namespace): the whole file is one program
using focalfleet::testing::CampaignPlan;
using focalfleet::testing::FieldLaw;
using focalfleet::testing::Planted;
using focalfleet::testing::PlantedCampaign;
using focalfleet::testing::Vec;

constexpr double kAmplitude_T = 0.08;
constexpr const char* kCauses[] = {
    "none",          "field_width",     "field_harmonics", "sensor_gain",
    "sensor_offset", "sensor_position", "centre_offset",   "temperature_coefficient"};

sim::HallCampaign Read(const PlantedCampaign& campaign) {
  sim::HallCampaign out;
  double sum = 0;
  for (const auto& pose : campaign.poses) {
    out.poses.push_back({pose.alpha_deg * sim::kRadPerDeg, pose.beta_deg * sim::kRadPerDeg,
                         pose.gamma_deg * sim::kRadPerDeg});
    out.rows.push_back({pose.volts, pose.temp_C});
    sum += pose.temp_C;
  }
  out.has_temperature = true;
  out.temperature_mean_C = sum / static_cast<double>(campaign.poses.size());
  return out;
}

double Latitude(const Vec& place) {
  return std::asin(place[2] /
                   std::sqrt(place[0] * place[0] + place[1] * place[1] + place[2] * place[2]));
}

// The law with a field cause in it.
FieldLaw Wrong(const FieldLaw& law, const Planted& planted) {
  if (planted.cause == "field_width")
    return [law, planted](const Vec& place, const Vec& axis) {
      const double length =
          std::sqrt(place[0] * place[0] + place[1] * place[1] + place[2] * place[2]);
      const double latitude = Latitude(place) / (1 + planted.size);
      const double phi = std::atan2(place[1], place[0]);
      const Vec there = {length * std::cos(latitude) * std::cos(phi),
                         length * std::cos(latitude) * std::sin(phi), length * std::sin(latitude)};
      (void)axis;
      return law(there, {there[0] / length, there[1] / length, there[2] / length});
    };
  if (planted.cause != "field_harmonics") return law;
  return [law, planted](const Vec& place, const Vec& axis) {
    constexpr int kOrders[] = {12, 8, 2, 20, 4};
    const double x = Latitude(place) / 0.3665, phi = std::atan2(place[1], place[0]);
    // Another wave along phi; or a pole of another shape along theta.
    const double shape = planted.variant == 4 ? x * x * x * x : 1;
    return law(place, axis) + planted.size * kAmplitude_T * shape * std::exp(-x * x) *
                                  std::cos(kOrders[planted.variant] * phi + 0.3 * planted.variant);
  };
}

struct Plant {
  FieldLaw law;
  std::unique_ptr<sim::FieldModel> model;
};

Plant OfMagnets(const testing::DipoleRotor& rotor) {
  const FieldLaw law = testing::OfRotor(rotor);
  sim::FieldMap map;
  for (int theta = 0; theta <= 180; theta += 5)
    for (int phi = 0; phi < 360; phi += 5) {
      const sim::Vector3 u = sim::DirectionAt(theta * sim::kRadPerDeg, phi * sim::kRadPerDeg);
      map.push_back({theta * sim::kRadPerDeg, phi * sim::kRadPerDeg,
                     law({59 * u.x, 59 * u.y, 59 * u.z}, {u.x, u.y, u.z})});
    }
  return {law, sim::MakeField(sim::FitField(map, sim::FieldKind::kSpherical)->parameters)};
}

PlantedCampaign Draw(const Plant& plant, const char* cause, std::uint64_t seed, int index) {
  Rng rng = Rng::Stream(seed, cause, static_cast<std::uint64_t>(index));
  CampaignPlan plan{.seed = rng.Bits()};
  plan.rows = 80 + rng.Below(120);
  Planted planted{.cause = cause};
  planted.sensor = rng.Below(8);
  planted.variant = static_cast<int>(rng.Below(5));
  const double sign = rng.Uniform() < 0.5 ? -1 : 1;
  // lambda counts before amplitude and phase are projected out: the least is taken larger.
  const double wanted = std::exp(rng.Uniform(std::log(160), std::log(4000)));
  const auto make = [&](double size) {
    planted.size = size;
    return testing::MakeCampaign(plan, plant.law, Wrong(plant.law, planted), planted);
  };
  if (planted.cause == "none") return make(0);
  const double first = (planted.cause == "temperature_coefficient" ? 0.001 : 0.01) * sign;
  return make(first * std::sqrt(wanted / make(first).lambda));
}

struct Count {
  int campaigns = 0, right = 0, wrong = 0, unsure = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const int per = bench::Option(argc, argv, "--per", 6);
  const int nulls = bench::Option(argc, argv, "--nulls", 20);
  const bool magnets = bench::Option(argc, argv, "--magnets", 0) != 0;
  const auto seed = static_cast<std::uint64_t>(bench::Option(argc, argv, "--seed", 1));
  const testing::DipoleRotor rotor(testing::PlantedOneShell(), 4);
  Plant plant{testing::OfSurface(kAmplitude_T, 21),
              sim::MakeField(sim::SurfaceParameters{.amplitude_T = 0.05})};
  if (magnets) plant = OfMagnets(rotor);
  Count singles, empties;
  double held_out = 0, gain = 0;
  for (const char* cause : kCauses) {
    const bool none = std::string(cause) == "none";
    std::map<std::string, int> verdicts;
    for (int k = 0; k < (none ? nulls : per); ++k) {
      const auto diagnosis = sim::DiagnoseHall(Read(Draw(plant, cause, seed, k)), {}, *plant.model);
      std::string said = Name(diagnosis.verdict);
      for (const auto& found : diagnosis.causes) {
        said += " ";
        for (const auto candidate : found.candidates)
          said += std::string(candidate == found.candidates.front() ? "" : "|") + Name(candidate);
      }
      for (const auto& unknown : diagnosis.unknown) said += " ?" + unknown.covariate;
      ++verdicts[said];
      Count& count = none ? empties : singles;
      ++count.campaigns;
      if (said == (none ? std::string("consistent") : "explained " + std::string(cause)))
        ++count.right;
      else if (none ? !diagnosis.causes.empty() : diagnosis.verdict == sim::HallVerdict::kExplained)
        ++count.wrong;
      else
        ++count.unsure;
      if (!none) {
        held_out += diagnosis.gain.rms_after_V / diagnosis.noise_V;
        gain += diagnosis.gain.explained;
      }
    }
    std::printf("%s\n", cause);
    for (const auto& [said, count] : verdicts) std::printf("  %5d %s\n", count, said.c_str());
    std::fflush(stdout);
  }
  std::printf(
      "nulls: %d of %d named; single causes: %d of %d exact, %d wrong and sure, %d unsure; "
      "held out %.3f of the noise, gain %.3f\n",
      empties.wrong, empties.campaigns, singles.right, singles.campaigns, singles.wrong,
      singles.unsure, held_out / std::max(1, singles.campaigns),
      gain / std::max(1, singles.campaigns));
  const bool good = empties.wrong <= 0.01 * empties.campaigns + (empties.campaigns < 100 ? 0 : 1) &&
                    singles.right >= 0.97 * singles.campaigns - 1 &&
                    singles.wrong <= 0.005 * singles.campaigns + 1;
  return good ? 0 : 1;
}
