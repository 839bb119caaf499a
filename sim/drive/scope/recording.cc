#include "sim/drive/scope/recording.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/check.h"
#include "protocol/base/units.h"
#include "sim/drive/reduced_drive.h"
#include "sim/drive/scope/spectrum.h"
#include "sim/drive/torque_ripple.h"

namespace focalfleet::sim {
namespace {

constexpr double kSamplesWanted = 600'000;

// The quantities of a drive that grow with time, read at one instant.
struct Meter {
  double t_s = 0;
  DriveEnergy energy;
  double square_A2s = 0;
  std::uint64_t edges = 0;
};
Meter Read(const Drive& drive) {
  return {drive.t_s(), drive.energy(), drive.square_A2s(), drive.edges()};
}

DriveEnergy Difference(const DriveEnergy& after, const DriveEnergy& before) {
  return {.supply_J = after.supply_J - before.supply_J,
          .copper_J = after.copper_J - before.copper_J,
          .switching_J = after.switching_J - before.switching_J,
          .load_J = after.load_J - before.load_J,
          .viscous_J = after.viscous_J - before.viscous_J,
          .stored_J = after.stored_J - before.stored_J};
}

// The stages that are shown: from rest a ramp up, then full speed until the rotor's fate is clear.
// The field does not slow down again.
std::vector<Stage> StagesOf(const Modulation& modulation, const RecordingPlan& plan) {
  const auto vectors = [&](int turns) {
    return static_cast<std::int64_t>(turns) * modulation.subdivision;
  };
  if (!plan.from_rest) return {{vectors(plan.turns), modulation.repeat}};
  constexpr std::int64_t kLong = std::int64_t{1} << 50;
  std::vector<Stage> stages = MakeProfile(kLong, modulation, plan.ramp);
  stages.resize(stages.size() / 2 + 1);
  stages.back().vectors = vectors(std::max(plan.turns, plan.turns_to_judge));
  return stages;
}

// A drive that is about to show vector `first`.
struct Begun {
  Drive drive;
  std::int64_t first = 0;
  bool can_turn = true;
};

Begun BeginInStep(Drive::Setting setting, const Modulation& modulation) {
  setting.motor.load_variation = 0;
  const auto state = FindSteadyState(setting, modulation, setting.motor.load_Nm);
  // Where no lag holds the load, the rotor begins with the most torque there is, and falls behind.
  const SteadyState begun = state.value_or(
      SteadyState{.lag_rad = kTurnRad / 4, .speed_rad_per_s = kTurnRad * modulation.field_Hz()});
  return {InSteadyRotation(setting, modulation, begun), 0, state.has_value()};
}

Begun BeginFromRest(const Drive::Setting& setting, const Modulation& modulation) {
  Drive drive(setting);
  drive.Place(0, 0);
  const double share = drive.shaft().LoadTorque() / ReducedDrive(setting, modulation).stall_Nm();
  drive.Place(-std::asin(std::min(1.0, share)), 0);
  // At rest vector 0 is shown.
  return {std::move(drive), 1, share < 1};
}

// The recorder runs the begun drive and keeps the samples.
class Recorder {
 public:
  Recorder(const Modulation& modulation, const RecordingPlan& plan, Begun begun)
      : modulation_(modulation),
        begun_(std::move(begun)),
        stages_(StagesOf(modulation, plan)),
        table_(VectorTable(modulation)),
        sampled_(static_cast<std::int64_t>(plan.turns) * modulation.subdivision),
        ripple_(modulation.carrier_s()) {
    recording_.sample_s = plan.sample_s > 0 ? plan.sample_s : SampleTime(modulation, plan.turns);
  }

  Recording Run() {
    Drive& drive = begun_.drive;
    drive.Probe(recording_.sample_s,
                [this](const DriveSample& sample) { recording_.samples.push_back(sample); });
    drive.Listen([this](const DriveInterval& interval) {
      vector_impulse_ += interval.impulse_Nms;
      if (in_last_turn_) ripple_.Hear(interval);
    });
    begin_ = Read(drive);
    std::int64_t shown = 0;
    for (const Stage& stage : stages_)
      for (std::int64_t k = 0; k < stage.vectors; ++k) ShowVector(shown++, stage.repeat);
    Judge(shown);
    if (!recording_.in_step) {
      // Over a mean that may be zero the ripple has no meaning.
      recording_.figures.torque_ripple_rms = std::nan("");
      recording_.figures.torque_ripple_peak_to_peak = std::nan("");
    }
    return std::move(recording_);
  }

 private:
  void ShowVector(std::int64_t shown, int repeat) {
    Drive& drive = begun_.drive;
    const std::int64_t turn_begins = sampled_ - modulation_.subdivision;
    if (shown == turn_begins) last_turn_ = Read(drive);
    in_last_turn_ = shown >= turn_begins && shown < sampled_;
    const std::int64_t field = begun_.first + shown;
    const auto index = static_cast<std::size_t>(field % modulation_.subdivision);
    vector_impulse_ = 0;
    for (int n = 0; n < repeat; ++n) {
      drive.ResetPeak();
      drive.RunCarrier(table_[index], modulation_);
      if (shown < sampled_) peak_A_ = std::max(peak_A_, drive.peak_A());
      if (in_last_turn_) recording_.carrier_peak_A.push_back(drive.peak_A());
    }
    const double middle = (static_cast<double>(field) + 0.5) * kTurnRad / modulation_.subdivision;
    recording_.vectors.push_back({drive.t_s(), middle - drive.shaft().angle_rad(),
                                  vector_impulse_ / (repeat * modulation_.carrier_s())});
    if (shown + 1 == sampled_) EndSampling();
  }

  void EndSampling() {
    Drive& drive = begun_.drive;
    drive.Probe(recording_.sample_s, {});
    const Meter end = Read(drive);
    // Rounding may leave a sample on the border; it belongs to the next turn.
    while (!recording_.samples.empty() &&
           recording_.samples.back().t_s > end.t_s - recording_.sample_s / 2)
      recording_.samples.pop_back();
    recording_.spent = Difference(end.energy, begin_.energy);
    MeasurePower(end);
    MeasureTorque();
    MeasureHarmonics(end);
  }

  void MeasurePower(const Meter& end) {
    const double time_s = end.t_s - begin_.t_s;
    const DriveEnergy& spent = recording_.spent;
    WaveFigures& figures = recording_.figures;
    figures.peak_A = peak_A_;
    figures.rms_A = std::sqrt((end.square_A2s - begin_.square_A2s) / time_s / 2);
    figures.power = {.supply_W = spent.supply_J / time_s,
                     .copper_W = spent.copper_J / time_s,
                     .switching_W = spent.switching_J / time_s,
                     .mechanical_W = (spent.load_J + spent.viscous_J) / time_s};
    figures.edges_per_carrier =
        static_cast<double>(end.edges - begin_.edges) / (time_s / modulation_.carrier_s());
  }

  void MeasureTorque() {
    const TorqueRipple::Figures torque = ripple_.Judge();
    recording_.figures.torque_mean_Nm = torque.mean_Nm;
    recording_.figures.torque_ripple_peak_to_peak = torque.peak_to_peak;
    recording_.figures.torque_ripple_rms = torque.rms;
  }

  // The last turn's samples at instants whose number is a power of two. Where they do not stand
  // there already, they are interpolated linearly.
  [[nodiscard]] std::vector<std::complex<double>> Resampled(const Meter& end) const {
    const std::vector<DriveSample>& samples = recording_.samples;
    const double turn_s = end.t_s - last_turn_.t_s;
    std::size_t size = 64;
    while (static_cast<double>(size) * recording_.sample_s < 0.999 * turn_s) size *= 2;
    std::vector<std::complex<double>> currents;
    currents.reserve(size);
    for (std::size_t k = 0; k < size; ++k) {
      const double at = (last_turn_.t_s - begin_.t_s +
                         static_cast<double>(k) * turn_s / static_cast<double>(size)) /
                        recording_.sample_s;
      const auto before = std::min(static_cast<std::size_t>(at), samples.size() - 1);
      const auto after = std::min(before + 1, samples.size() - 1);
      const double share = at - static_cast<double>(before);
      const auto plane = [&](std::size_t i) {
        const auto& phase = samples[i].current_A;
        return std::complex<double>(phase[0], (phase[1] - phase[2]) / std::numbers::sqrt3);
      };
      currents.push_back(plane(before) + share * (plane(after) - plane(before)));
    }
    return currents;
  }

  void MeasureHarmonics(const Meter& end) {
    WaveFigures& figures = recording_.figures;
    recording_.harmonics_A = PhaseHarmonics(Components(Resampled(end)));
    const std::vector<double>& harmonics = recording_.harmonics_A;
    const double square_A2 =
        (end.square_A2s - last_turn_.square_A2s) / (end.t_s - last_turn_.t_s) / 2;
    const auto power = [&](std::size_t m) { return harmonics[m] * harmonics[m] / 2; };
    double first_six_A2 = 0;
    for (std::size_t m = 1; m <= 6; ++m) first_six_A2 += power(m);
    figures.fundamental_A = harmonics[1];
    figures.snr_dB = 10 * std::log10(power(1) / (square_A2 - first_six_A2));
    figures.thd = std::sqrt(std::max(0.0, square_A2 - power(0) - power(1)) / power(1));
  }

  void Judge(std::int64_t shown) {
    const std::vector<VectorRecord>& vectors = recording_.vectors;
    recording_.in_step = begun_.can_turn && std::abs(vectors.back().lag_rad) < kTurnRad / 2;
    const auto turn = static_cast<std::size_t>(modulation_.subdivision);
    const std::size_t from = static_cast<std::size_t>(shown) - turn;
    for (std::size_t k = from; k < vectors.size(); ++k)
      recording_.lag_rad += vectors[k].lag_rad / static_cast<double>(turn);
    // The field turned once between the first and the last lag, which are a turn apart.
    const std::size_t start = from > 0 ? from - 1 : 0;
    const double field = static_cast<double>(vectors.size() - 1 - start) * kTurnRad /
                         static_cast<double>(modulation_.subdivision);
    recording_.speed_rad_per_s = (field - (vectors.back().lag_rad - vectors[start].lag_rad)) /
                                 (vectors.back().t_s - vectors[start].t_s);
  }

  Modulation modulation_;
  Begun begun_;
  std::vector<Stage> stages_;
  std::vector<Pattern> table_;
  std::int64_t sampled_ = 0;  // vectors
  Recording recording_;
  Meter begin_;
  Meter last_turn_;  // as the last turn that is sampled begins
  bool in_last_turn_ = false;
  TorqueRipple ripple_;  // of that turn
  double vector_impulse_ = 0;
  double peak_A_ = 0;
};

}  // namespace

double SampleTime(const Modulation& modulation, int turns) {
  const double carriers = static_cast<double>(modulation.subdivision) * modulation.repeat;
  double a_turn = std::exp2(std::ceil(std::log2(32 * carriers)));
  while (turns * a_turn > kSamplesWanted && a_turn / 2 >= 8 * carriers) a_turn /= 2;
  return 1 / (modulation.field_Hz() * a_turn);
}

RecordingSize SizeOf(const Modulation& modulation, const RecordingPlan& plan) {
  const double sample_s = plan.sample_s > 0 ? plan.sample_s : SampleTime(modulation, plan.turns);
  RecordingSize size;
  std::int64_t left = static_cast<std::int64_t>(plan.turns) * modulation.subdivision;
  for (const Stage& stage : StagesOf(modulation, plan)) {
    const std::int64_t sampled = std::min(left, stage.vectors);
    left -= sampled;
    size.samples += static_cast<double>(sampled) * stage.repeat * modulation.carrier_s() / sample_s;
    size.carriers += static_cast<double>(stage.vectors) * stage.repeat;
  }
  return size;
}

Recording Record(const Drive::Setting& setting, const Modulation& modulation,
                 const RecordingPlan& plan) {
  FOCALFLEET_CHECK(plan.turns > 0 && modulation.repeat > 0);
  Recorder recorder(
      modulation, plan,
      plan.from_rest ? BeginFromRest(setting, modulation) : BeginInStep(setting, modulation));
  Recording recording = recorder.Run();
  recording.figures.supply_A = recording.figures.power.supply_W / setting.bridge.v_bus_V;
  return recording;
}

}  // namespace focalfleet::sim
