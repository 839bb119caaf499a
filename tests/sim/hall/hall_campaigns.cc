// Campaigns with planted causes or none, drawn by an independent plant. They are diagnosed from the
// content of their file, with the quality figures of every diagnosis (docs/hall.md). Lambda is
// drawn from 15 to 4000. Lambda is the chi^2 of the planted cause after the unknown amplitude and
// phase of the field are projected out. The program ends with 1 where a figure is missed by more
// than its few campaigns allow. The figures: nulls named 1 % (dirty 2 %), exact at lambda >= 100 97
// %, wrong and sure 0.5 %.
//   hall_campaigns [--per 6] [--nulls 20] [--dirty 10] [--pairs 6] [--outside 6] [--unforeseen 0]
//                  [--magnets 0] [--seed 1]
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "sim/hall/diagnosis/hall_diagnosis.h"
#include "sim/hall/field_fit.h"
#include "tests/bench/options.h"
#include "tests/sim/hall/planted_rig.h"

namespace focalfleet {
namespace {

using test::CampaignPlan;
using test::FieldLaw;
using test::Planted;
using test::PlantedCampaign;
using test::Vec;

constexpr double kAmplitude_T = 0.08;
constexpr const char* kCauses[] = {
    "field_width",   "field_harmonics",        "sensor_gain", "sensor_offset", "sensor_position",
    "centre_offset", "temperature_coefficient"};

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
    // The cause is another wave along phi, or a pole of another shape along theta.
    const double shape = planted.variant == 4 ? x * x * x * x : 1;
    return law(place, axis) + planted.size * kAmplitude_T * shape * std::exp(-x * x) *
                                  std::cos(kOrders[planted.variant] * phi + 0.3 * planted.variant);
  };
}

struct Plant {
  FieldLaw law;
  std::unique_ptr<sim::FieldModel> model;
};

Plant OfMagnets(const test::DipoleRotor& rotor) {
  const FieldLaw law = test::OfRotor(rotor);
  sim::FieldMap map;
  for (int theta = 0; theta <= 180; theta += 5)
    for (int phi = 0; phi < 360; phi += 5) {
      const sim::Vector3 u = sim::DirectionAt(theta * sim::kRadPerDeg, phi * sim::kRadPerDeg);
      map.push_back({theta * sim::kRadPerDeg, phi * sim::kRadPerDeg,
                     law({59 * u.x, 59 * u.y, 59 * u.z}, {u.x, u.y, u.z})});
    }
  return {law, sim::MakeField(sim::FitField(map, sim::FieldKind::kSpherical)->parameters)};
}

struct Drawn {
  PlantedCampaign campaign;
  std::vector<std::string> causes;
};

Planted Some(const char* cause, Rng* rng) {
  Planted planted{.cause = cause};
  planted.sensor = rng->Below(8);
  planted.variant = static_cast<int>(rng->Below(5));
  const double sign = rng->Uniform() < 0.5 ? -1 : 1;
  planted.size = (planted.cause == "temperature_coefficient" ? 0.001 : 0.01) * sign;
  return planted;
}

// The cause with the size at which it is worth `wanted` by itself.
Planted Sized(const Plant& plant, const CampaignPlan& plan, Planted planted, double wanted) {
  for (int pass = 0; pass < 2; ++pass) {  // not quite linear
    const auto made = test::MakeCampaign(plan, plant.law, Wrong(plant.law, planted), planted);
    planted.size *= std::sqrt(wanted / std::max(made.lambda_free, 1e-9));
  }
  return planted;
}

Drawn Draw(const Plant& plant, const std::vector<const char*>& causes, double lambda_min, Rng rng,
           bool dirty) {
  CampaignPlan plan{.seed = rng.Bits()};
  plan.rows = 80 + rng.Below(120);
  plan.dirty = dirty;
  Drawn drawn;
  std::vector<Planted> planted;
  FieldLaw law = plant.law;
  for (const char* cause : causes) {
    drawn.causes.emplace_back(cause);
    const double wanted = std::exp(rng.Uniform(std::log(lambda_min), std::log(4000)));
    planted.push_back(Sized(plant, plan, Some(cause, &rng), wanted));
    law = Wrong(law, planted.back());
  }
  if (planted.empty()) planted.emplace_back();
  plan.also.assign(planted.begin() + 1, planted.end());
  drawn.campaign = test::MakeCampaign(plan, plant.law, law, planted.front());
  return drawn;
}

struct Outcome {
  std::string said;
  std::vector<std::string> first;  // the first name of each cause found
  std::vector<std::string> all;    // with its candidates
  bool sure = false;               // explained, each cause with a single name
  bool flagged = false;            // reports an unknown
  double gain = 0;                 // share of an oracle's gain, in variance
};

Outcome Diagnose(const Plant& plant, const Drawn& drawn) {
  const auto diagnosis = sim::DiagnoseHall(Read(drawn.campaign), {}, *plant.model);
  Outcome outcome;
  outcome.said = Name(diagnosis.verdict);
  for (const auto& found : diagnosis.causes) {
    outcome.said += " ";
    outcome.first.emplace_back(Name(found.candidates.front()));
    for (const auto candidate : found.candidates) {
      outcome.said +=
          std::string(candidate == found.candidates.front() ? "" : "|") + Name(candidate);
      outcome.all.emplace_back(Name(candidate));
    }
  }
  for (const auto& unknown : diagnosis.unknown) outcome.said += " ?" + unknown.covariate;
  outcome.sure = diagnosis.verdict == sim::HallVerdict::kExplained;
  outcome.flagged = diagnosis.verdict == sim::HallVerdict::kUnknown || !diagnosis.unknown.empty();
  const auto square = [](double value) { return value * value; };
  const double noise2_V2 = square(25 * CampaignPlan{}.noise_T);
  outcome.gain = (square(diagnosis.gain.rms_before_V) - square(diagnosis.gain.rms_after_V)) /
                 (square(diagnosis.gain.rms_before_V) - noise2_V2);
  return outcome;
}

bool Has(const std::vector<std::string>& list, const std::string& what) {
  return std::find(list.begin(), list.end(), what) != list.end();
}

// The 95 % interval of a share, after Wilson.
void Line(const char* what, int count, int of, const char* wanted) {
  if (of == 0) return;
  const double n = of, p = count / n, z2 = 1.96 * 1.96;
  const double middle = (p + z2 / (2 * n)) / (1 + z2 / n);
  const double half = 1.96 * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n);
  std::printf("%-62s %4d of %4d  %5.1f..%5.1f %%  %s\n", what, count, of,
              100 * std::max(0.0, middle - half), 100 * std::min(1.0, middle + half), wanted);
}

class Suite {
 public:
  Suite(const Plant* plant, std::uint64_t seed) : plant_(*plant), seed_(seed) {}

  /// The number of null campaigns in which a cause was named.
  int Nulls(int count, bool dirty) {
    int named = 0;
    for (int k = 0; k < count; ++k) {
      const Outcome outcome = Take({}, 1, dirty ? "dirty" : "none", k, dirty);
      named += outcome.first.empty() ? 0 : 1;
    }
    Line(dirty ? "nothing planted, dirty: a cause is named" : "nothing planted: a cause is named",
         named, count, dirty ? "<= 2 %" : "<= 1 %");
    return named;
  }

  struct Singles {
    int strong = 0, exact = 0, campaigns = 0, wrong_and_sure = 0;
  };
  Singles Single(int per) {
    constexpr double kBins[] = {15, 30, 50, 100, 1e9};
    std::array<int, 4> detected{}, of{};
    Singles singles;
    int covered = 0, to_cover = 0;
    std::vector<double> gains;
    for (const char* cause : kCauses)
      for (int k = 0; k < per; ++k) {
        const Outcome outcome = Take({cause}, 15, cause, k, false);
        std::size_t bin = 0;
        while (bin < 3 && lambda_ >= kBins[bin + 1]) ++bin;
        ++of[bin];
        detected[bin] += outcome.first.empty() && !outcome.flagged ? 0 : 1;
        ++singles.campaigns;
        const bool exact =
            outcome.sure && outcome.first.size() == 1 && outcome.first.front() == cause;
        singles.wrong_and_sure += outcome.sure && !exact ? 1 : 0;
        to_cover += lambda_ >= 50 ? 1 : 0;
        covered += lambda_ >= 50 && Has(outcome.all, cause) ? 1 : 0;
        if (lambda_ < 100) continue;
        ++singles.strong;
        singles.exact += exact ? 1 : 0;
        gains.push_back(outcome.gain);
      }
    for (std::size_t bin = 0; bin < 4; ++bin) {
      char what[64];
      std::snprintf(what, sizeof what, "detected, lambda from %.0f%s", kBins[bin],
                    bin == 3 ? " on" : "");
      Line(what, detected[bin], of[bin], bin == 3 ? ">= 99 %" : "");
    }
    Line("one cause, lambda >= 100: named exactly", singles.exact, singles.strong, ">= 97 %");
    Line("one cause: wrong and sure", singles.wrong_and_sure, singles.campaigns, "<= 0.5 %");
    Line("one cause, lambda >= 50: among the candidates", covered, to_cover, ">= 99 %");
    Gain("one cause", std::move(gains), ">= 0.95");
    return singles;
  }

  void Pairs(int count) {
    int exact = 0, extra = 0;
    std::vector<double> gains;
    constexpr std::size_t kCount = std::size(kCauses);
    for (int k = 0; k < count; ++k) {
      const auto one = static_cast<std::size_t>(k) % kCount;
      const std::size_t two = (one + 1 + static_cast<std::size_t>(k) / kCount) % kCount;
      if (one == two) continue;
      const Outcome outcome = Take({kCauses[one], kCauses[two]}, 100, "pair", k, false);
      const bool both = Has(outcome.all, kCauses[one]) && Has(outcome.all, kCauses[two]);
      const bool no_other = std::all_of(
          outcome.first.begin(), outcome.first.end(),
          [&](const std::string& name) { return name == kCauses[one] || name == kCauses[two]; });
      exact += both && no_other ? 1 : 0;
      extra += outcome.sure && !no_other ? 1 : 0;
      gains.push_back(outcome.gain);
    }
    Line("two causes, both lambda >= 100: exact by class", exact, count, ">= 95 %");
    Line("two causes: another one named surely", extra, count, "");
    Gain("two causes", std::move(gains), ">= 0.90");
  }

  // Effects outside of the causes: `foreseen` ones are among the diagnosis' rivals, others are not.
  void Outside(int per, bool foreseen) {
    int flagged = 0, misnamed = 0, count = 0;
    const std::array<const char*, 3> effects = foreseen
                                                   ? std::array{"drift", "pose_scale", "crosstalk"}
                                                   : std::array{"play", "cogging", "iron"};
    for (const char* effect : effects)
      for (int k = 0; k < per; ++k) {
        const Outcome outcome = Take({effect}, 250, effect, k, false);
        ++count;
        flagged += outcome.flagged ? 1 : 0;
        misnamed += outcome.sure ? 1 : 0;
      }
    const std::string who = foreseen ? "outside the library" : "unforeseen";
    Line((who + ", lambda >= 250: flagged").c_str(), flagged, count, ">= 90 %");
    Line((who + ": named surely and not flagged").c_str(), misnamed, count, "<= 5 %");
  }

  void Confusions() const {
    for (const auto& [what, verdicts] : verdicts_) {
      std::printf("%s\n", what.c_str());
      for (const auto& [said, count] : verdicts) std::printf("  %5d %s\n", count, said.c_str());
    }
  }

 private:
  Outcome Take(const std::vector<const char*>& causes, double lambda_min, const char* stream,
               int index, bool dirty) {
    const Drawn drawn = Draw(plant_, causes, lambda_min,
                             Rng::Stream(seed_, stream, static_cast<std::uint64_t>(index)), dirty);
    lambda_ = drawn.campaign.lambda_free;
    Outcome outcome = Diagnose(plant_, drawn);
    std::string what = dirty ? "dirty" : "";
    for (const std::string& cause : drawn.causes) what += (what.empty() ? "" : " + ") + cause;
    const std::string strength = causes.size() != 1 ? "" : lambda_ >= 100 ? " >= 100" : " < 100";
    ++verdicts_[what.empty() ? "none" : what + strength][outcome.said];
    return outcome;
  }
  static void Gain(const char* what, std::vector<double> gains, const char* wanted) {
    if (gains.empty()) return;
    std::sort(gains.begin(), gains.end());
    std::printf("%-62s median %.3f, tenth %.3f  %s\n",
                (std::string(what) + ": held-out gain to an oracle's").c_str(),
                gains[gains.size() / 2], gains[gains.size() / 10], wanted);
  }

  const Plant& plant_;
  std::uint64_t seed_;
  double lambda_ = 0;  // of the last campaign
  std::map<std::string, std::map<std::string, int>> verdicts_;
};

int Main(int argc, char** argv) {
  const int per = bench::Option(argc, argv, "--per", 6);
  const int nulls = bench::Option(argc, argv, "--nulls", 20);
  const int dirty = bench::Option(argc, argv, "--dirty", 10);
  const bool magnets = bench::Option(argc, argv, "--magnets", 0) != 0;
  const test::DipoleRotor rotor(test::PlantedOneShell(), 4);
  Plant plant{test::OfSurface(kAmplitude_T, 21),
              sim::MakeField(sim::SurfaceParameters{.amplitude_T = 0.05})};
  if (magnets) plant = OfMagnets(rotor);
  Suite suite(&plant, static_cast<std::uint64_t>(bench::Option(argc, argv, "--seed", 1)));
  const int named = suite.Nulls(nulls, false);
  const int named_dirty = suite.Nulls(dirty, true);
  const Suite::Singles singles = suite.Single(per);
  suite.Pairs(bench::Option(argc, argv, "--pairs", 6));
  suite.Outside(bench::Option(argc, argv, "--outside", 6), true);
  suite.Outside(bench::Option(argc, argv, "--unforeseen", 0), false);
  suite.Confusions();
  const bool good = named <= 0.01 * nulls + (nulls < 100 ? 0 : 1) &&
                    named_dirty <= 0.02 * dirty + 1 && singles.exact >= 0.97 * singles.strong - 1 &&
                    singles.wrong_and_sure <= 0.005 * singles.campaigns + 1;
  return good ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
