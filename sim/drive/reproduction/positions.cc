// The end positions of the axis: the paper's turns of 360 degrees there and back, and the use of
// the stored vector.

#include <algorithm>
#include <cmath>
#include <vector>

#include "protocol/base/rng.h"
#include "protocol/base/units.h"
#include "sim/drive/reduced_drive.h"
#include "sim/drive/reproduction/parts.h"
#include "sim/drive/start_study.h"

namespace focalfleet::sim::reproduction {
namespace {

constexpr double kArm_um = 8250;  // assumed: the paper does not print it

// The output errors of turns there and back, in um at the arm, from the drive with play in its
// gear.
std::vector<double> Closures_um(Drive::Setting setting, double play_um, int turns) {
  setting.gearhead.play_rad = play_um / kArm_um * setting.gearhead.ratio;
  const Modulation modulation{.repeat = 108};
  ReducedDrive drive(setting, modulation);
  // A few electrical turns each way cross the play, as 360 degrees do.
  const double cross = setting.gearhead.play_rad / kTurnRad;
  const auto vectors = static_cast<std::int64_t>(cross + 5) * modulation.subdivision;
  drive.Place(0, 0);
  drive.RunVectors(1, vectors);
  std::int64_t field = vectors;
  double before = drive.shaft().output_rad();
  std::vector<double> closures;
  for (int k = 0; k < turns; ++k) {
    const std::int64_t way = (k % 2 == 0 ? -1 : 1) * vectors;
    drive.RunVectors(way > 0 ? field + 1 : field - 1, way);
    field += way;
    const double after = drive.shaft().output_rad();
    // The difference of commanded and travelled is play and lag.
    const double commanded =
        static_cast<double>(way) / modulation.subdivision * kTurnRad / setting.gearhead.ratio;
    closures.push_back(std::abs(commanded - (after - before)) * kArm_um);
    before = after;
  }
  return closures;
}

double MeanClosure_um(const Drive::Setting& setting, double play_um) {
  const auto closures = Closures_um(setting, play_um, 12);
  double sum_um = 0;
  for (const double closure_um : closures) sum_um += closure_um;
  return sum_um / static_cast<double>(closures.size());
}

struct Spread {
  double rms = 0;
  double mode = 0;
};
Spread SpreadOf(const std::vector<double>& errors, double bin) {
  Spread spread;
  std::vector<int> counts;
  for (const double error : errors) {
    spread.rms += error * error;
    const auto at = static_cast<std::size_t>(std::max(0.0, error) / bin);
    if (counts.size() <= at) counts.resize(at + 1);
    ++counts[at];
  }
  spread.rms = std::sqrt(spread.rms / static_cast<double>(errors.size()));
  // Seven bins count together, so that the noise of the draw does not choose among neighbours.
  constexpr std::size_t kWindow = 7;
  counts.resize(counts.size() + kWindow);
  int most = 0;
  for (std::size_t k = 0; k + kWindow <= counts.size(); ++k) {
    int sum = 0;
    for (std::size_t n = 0; n < kWindow; ++n) sum += counts[k + n];
    if (sum <= most) continue;
    most = sum;
    spread.mode = (static_cast<double>(k) + kWindow / 2.0) * bin;
  }
  return spread;
}

double Exponential(Rng* rng) { return -std::log(1 - rng->Uniform()); }

}  // namespace

void AddPositions(const ReproduceOptions& options, Reproduction* out) {
  const auto setting = Ideal(PaperSetting(options, options.wave_set, 1.8));

  // At a reversal the output lacks the play and the change of the rotor's lag. The fit sets the
  // play.
  const double lag_um = MeanClosure_um(setting, 0);
  Rng rng = Rng::Stream(options.seed, "positioning");
  constexpr int kStops = 200'000;
  std::vector<double> errors;
  errors.reserve(kStops);
  const auto add = [&](const char* id, const char* what, std::string conditions,
                       std::string parameters) {
    const Spread spread = SpreadOf(errors, 2);
    Claim claim{.id = id,
                .text = std::string("positioning: RMS 146 um, mode 158 um; ") + what,
                .paper = {146, 158},
                .simulated = {spread.rms, spread.mode},
                .unit = "um: RMS, mode",
                .conditions = std::move(conditions) + ", seed " + std::to_string(options.seed),
                .status = ClaimStatus::kFitted,
                .reason = std::move(parameters)};
    if (Within(claim, 0.03) == ClaimStatus::kDisagrees) claim.status = ClaimStatus::kDisagrees;
    out->claims.push_back(std::move(claim));
  };
  const std::string moves = "turns there and back at 1.8 V, n 108; " +
                            std::to_string(std::lround(lag_um)) +
                            " um of a reversal are the rotor's lag";

  // Some stops come to rest on the wrong flank: two numbers, two parameters.
  constexpr double kPlay_um = 147.4;
  constexpr double kWrongFlank = 0.076;
  const double closure_um = MeanClosure_um(setting, kPlay_um);
  bool wrong = false;
  for (int k = 0; k < kStops; ++k) {
    const bool wrong_now = rng.Uniform() < kWrongFlank;
    errors.push_back(std::abs((wrong == wrong_now ? closure_um : 0) + rng.Normal()));
    wrong = wrong_now;
  }
  add("positioning_flank", "full play, some stops on the wrong flank", moves,
      "parameters: play of 147 um at the arm (1.02 degrees at 8.25 mm, an assumed length), "
      "7.6 % of stops on the wrong flank");

  constexpr double kWidePlay_um = 167.4;
  constexpr double kTakeUp = 0.095;
  const double wide_um = MeanClosure_um(setting, kWidePlay_um);
  errors.clear();
  for (int k = 0; k < kStops; ++k) {
    // Each of the two ends of a closure has taken up some of the play.
    const double left = 1 - kTakeUp * (Exponential(&rng) + Exponential(&rng));
    errors.push_back(std::max(0.0, wide_um * left));
  }
  add("positioning_take_up", "play that is partly taken up at each stop", moves,
      "parameters: play of 167 um at the arm, 9.5 % of it taken up at a stop on average");

  // A bias of 140 um with noise that gives 146 um RMS.
  errors.clear();
  for (int k = 0; k < kStops; ++k)
    errors.push_back(std::hypot(140 + 29.3 * rng.Normal(), 29.3 * rng.Normal()));
  add("positioning_noise", "from a bias and noise", "bias 140 um, isotropic noise 29.3 um",
      "noise about a bias makes RMS the greater one; a tail towards zero is needed, as play gives "
      "that is not always closed");

  // Starts with the stored vector and with others show where the rotor goes when power comes back.
  ClaimCurve curve{.figure = "what a wrong stored vector costs",
                   .name = "position error after power-on",
                   .x = {},
                   .y = {}};
  double worst_um = 0;
  const Modulation modulation{};
  const double um_per_rad = kArm_um / setting.gearhead.ratio;
  for (int off = -96; off <= 96; off += 4) {
    ReducedDrive drive(setting, modulation);
    drive.Place(0, 0);
    // Vector `off` is held for a second in place of the one that the rotor stands at.
    drive.RunVectors(off, 1, 1 / modulation.carrier_s());
    const double error_um = drive.shaft().angle_rad() * um_per_rad;
    const double turn = static_cast<double>(off) / modulation.subdivision;
    curve.x.push_back(360 * turn);
    // The error is the firmware's position less the true one.
    curve.y.push_back(turn * kTurnRad * um_per_rad - error_um);
    worst_um = std::max(worst_um, std::abs(curve.y.back()));
  }
  out->curves.push_back(curve);
  out->claims.push_back(
      {.id = "stored_vector",
       .text = "the vector stored at the end of a move is applied first at the next power-on",
       .simulated = {kTurnRad * um_per_rad, worst_um},
       .unit = "um: one lost motor turn, worst error of a vector lost",
       .conditions = "any vector of a turn applied to a rotor at rest; arm of 8.25 mm (assumed)",
       .status = ClaimStatus::kNotTestable,
       .reason = "the paper gives no number. A vector that is wrong by less than half a turn makes "
                 "the rotor jump to it and costs nothing more; beyond that it locks a turn away"});
}

}  // namespace focalfleet::sim::reproduction
