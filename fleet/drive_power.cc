#include "fleet/drive_power.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "protocol/base/check.h"

namespace focalfleet {
namespace {

using Complex = std::complex<double>;
constexpr double kNeverS = std::numeric_limits<double>::infinity();
constexpr double kPi = std::numbers::pi;
constexpr int kLegs = 3;

const std::array<Complex, kLegs>& LegAxes() {
  static const std::array<Complex, kLegs> kAxes = {Complex{1, 0}, Complex{-0.5, std::sqrt(0.75)},
                                                   Complex{-0.5, -std::sqrt(0.75)}};
  return kAxes;
}

// The real part of a product is all that is needed.
double Along(Complex value, Complex axis) {
  return value.real() * axis.real() + value.imag() * axis.imag();
}

// ---- commands of the timer

// A leg in one carrier: high from the start or not, and from `rise_s` to `fall_s`.
struct LegPulse {
  bool high_at_start = false;
  double rise_s = kNeverS;
  double fall_s = kNeverS;
};
using Pulses = std::array<LegPulse, kLegs>;

LegPulse PulseOf(double high_counts, double counter1, WaveMode mode) {
  if (high_counts <= 0) return {};
  if (high_counts >= counter1) return {.high_at_start = true};
  const bool centred = mode != WaveMode::kAsymmetric;
  const double low_counts = counter1 - high_counts;
  const double rise = centred ? low_counts / 2 : low_counts;
  // The pulse lasts up to the end of the carrier: the next one begins low.
  const double fall = centred ? rise + high_counts : kNeverS;
  return {false, rise / kTimerHz, fall / kTimerHz};
}

Pulses PulsesOf(std::uint32_t vector, const AxisDrive& drive, WaveMode mode) {
  // Whole numbers: a vector on the border of a sector must not be counted in the one before.
  const std::uint32_t sixths = 6 * (vector % drive.subdivision);
  const std::uint32_t sector = sixths / drive.subdivision;
  const double a = kPi / 3 * (sixths % drive.subdivision) / drive.subdivision;
  const double counter1 = drive.counter1;
  // A half is rounded up: in the middle of a sector, T1 = T2 = counter1 / 2, and sin(30 deg) is
  // slightly too small.
  const auto counts = [&](double angle) {
    return std::floor(counter1 * std::sin(angle) + 0.5 + 1e-9);
  };
  const double t1 = counts(kPi / 3 - a);
  const double t2 = std::min(counts(a), counter1 - t1);
  // T1 belongs to the vector at the lower angle, which raises one leg in even sectors and two in
  // odd ones. A single leg is in both.
  const bool even = sector % 2 == 0;
  const std::size_t both = (even ? sector / 2 : (sector + 1) / 2) % kLegs;
  const std::size_t second = (even ? sector / 2 + 1 : (sector - 1) / 2) % kLegs;
  const double two_legs = even ? t2 : t1;
  const double all_legs = mode == WaveMode::kSevenSegment ? (counter1 - t1 - t2) / 2 : 0;
  std::array<double, kLegs> high{all_legs, all_legs, all_legs};
  high[both] += t1 + t2;
  high[second] += two_legs;
  Pulses pulses;
  for (std::size_t k = 0; k < kLegs; ++k) pulses[k] = PulseOf(high[k], counter1, mode);
  return pulses;
}

// ---- voltages and currents of bridge and winding

struct CurrentLeg {
  double level = 0;  // of the output, in bus voltages
  bool target = false;
  bool by_diode = false;     // both switches are open
  bool floats = false;       // and no diode conducts
  double flip_s = kNeverS;   // the diode has taken over
  double close_s = kNeverS;  // the switch of the target holds the leg
  std::size_t next = 0;      // command of this carrier
};

// Runs through carriers and sums energies with a weight.
class Bridge {
 public:
  Bridge(const MotorModel& motor, const Feed& feed, bool rotor_stands)
      : motor_(motor),
        v_bus_V_(feed.v_bus_V),
        carrier_s_(feed.drive.counter1 / kTimerHz),
        speed_(SpeedRadPerS(feed.drive)),
        rate_(motor.phase_resistance_ohm / motor.phase_inductance_H),
        emf_V_(0, rotor_stands ? 0 : speed_ * motor.flux_linkage_Wb),
        own_A_(-emf_V_ / Complex(motor.phase_resistance_ohm, speed_ * motor.phase_inductance_H)),
        cross_(1.0 / Complex(rate_, speed_)) {}

  // `rotor_rad`: the angle of the flux at the begin of the carrier.
  void RunCarrier(const Pulses& pulses, double rotor_rad, double weight) {
    rotor_ = std::polar(1.0, rotor_rad);
    weight_ = weight;
    now_s_ = 0;
    for (CurrentLeg& leg : legs_) leg.next = 0;
    for (;;) {
      double next_s = Due(pulses);
      SetVoltage();
      if (now_s_ >= carrier_s_) break;
      next_s = std::min(next_s, carrier_s_);
      Advance(next_s);
    }
    for (CurrentLeg& leg : legs_) {
      leg.flip_s -= carrier_s_;
      leg.close_s -= carrier_s_;
    }
  }

  void Forget() {
    sum_ = {};
    weighed_s_ = 0;
  }
  [[nodiscard]] TurnMeans Means() const {
    TurnMeans means;
    means.winding_W = 1.5 * motor_.phase_resistance_ohm * sum_.square_A2s / weighed_s_;
    means.torque_Nm = 1.5 * motor_.flux_linkage_Wb * sum_.iq_As / weighed_s_;
    means.mechanical_W = emf_V_ == 0.0 ? 0 : means.torque_Nm * speed_;
    means.switching_W = sum_.switching_J / weighed_s_;
    means.supply_W = sum_.input_J / weighed_s_ + means.switching_W;
    return means;
  }

 private:
  [[nodiscard]] Complex Current() const { return driven_A_ + own_A_ * rotor_; }

  // Carries out all that is due now. Returns when the next event is due.
  double Due(const Pulses& pulses) {
    double next_s = kNeverS;
    for (std::size_t k = 0; k < kLegs; ++k) {
      CurrentLeg& leg = legs_[k];
      if (leg.flip_s <= now_s_) {
        leg.level = leg.level < 0.5 ? 1 : 0;
        leg.flip_s = kNeverS;
      }
      if (leg.close_s <= now_s_) Close(k);
      for (; leg.next < 3 && CommandTime(pulses[k], leg.next) <= now_s_; ++leg.next) {
        Command(k, leg.next == 0 ? pulses[k].high_at_start : leg.next == 1);
      }
      next_s = std::min({next_s, leg.flip_s, leg.close_s});
      if (leg.next < 3) next_s = std::min(next_s, CommandTime(pulses[k], leg.next));
    }
    return next_s;
  }

  static double CommandTime(const LegPulse& pulse, std::size_t n) {
    return n == 0 ? 0 : n == 1 ? pulse.rise_s : pulse.fall_s;
  }

  [[nodiscard]] double RampOf(bool up) const {
    return up ? motor_.switch_rise_s : motor_.switch_fall_s;
  }

  void Command(std::size_t k, bool target) {
    CurrentLeg& leg = legs_[k];
    if (leg.target == target) return;
    leg.target = target;
    leg.by_diode = true;
    const bool diode = Along(Current(), LegAxes()[k]) <= 0;  // which diode takes the current
    leg.close_s = now_s_ + motor_.dead_time_s + (diode == target ? 0 : RampOf(target) / 2);
    leg.flip_s = kNeverS;
    if (leg.floats || diode == (leg.level > 0.5)) return;
    leg.flip_s = now_s_ + RampOf(diode) / 2;
    leg.close_s = std::max(leg.close_s, leg.flip_s);
  }

  void Close(std::size_t k) {
    CurrentLeg& leg = legs_[k];
    const double level = leg.target ? 1 : 0;
    const double step = std::abs(level - leg.level);
    const double current_A = std::abs(Along(Current(), LegAxes()[k]));
    sum_.switching_J += weight_ * 0.5 * v_bus_V_ * step * current_A * RampOf(leg.target);
    leg.level = level;
    leg.by_diode = leg.floats = false;
    leg.close_s = leg.flip_s = kNeverS;
  }

  void SetVoltage() {
    for (std::size_t k = 0; k < kLegs; ++k) {
      CurrentLeg& leg = legs_[k];
      if (!leg.floats) continue;
      // No current along the leg's axis: its voltage there is the back EMF; the star point is the
      // mean of all three.
      const double others = legs_[(k + 1) % kLegs].level + legs_[(k + 2) % kLegs].level;
      const double emf_V = Along(emf_V_ * rotor_, LegAxes()[k]);
      leg.level = std::clamp(1.5 * emf_V / v_bus_V_ + others / 2, 0.0, 1.0);
    }
    voltage_V_ = 0;
    for (std::size_t k = 0; k < kLegs; ++k) voltage_V_ += legs_[k].level * LegAxes()[k];
    voltage_V_ *= 2.0 / 3 * v_bus_V_;
  }

  // The first instant up to `until_s` at which a diode's current comes to zero; its leg floats
  // then. An interval with open switches is no longer than the dead time, so a straight line is
  // good enough.
  double FirstZero(double until_s, Complex end_A) {
    double first_s = until_s;
    std::optional<std::size_t> which;
    for (std::size_t k = 0; k < kLegs; ++k) {
      const CurrentLeg& leg = legs_[k];
      if (!leg.by_diode || leg.floats || leg.flip_s < kNeverS) continue;
      const double sign = leg.level > 0.5 ? -1 : 1;
      const double end = sign * Along(end_A, LegAxes()[k]);
      if (end >= 0) continue;
      const double begin = std::max(0.0, sign * Along(Current(), LegAxes()[k]));
      const double zero_s = now_s_ + (until_s - now_s_) * begin / (begin - end);
      if (which && zero_s >= first_s) continue;
      first_s = zero_s;
      which = k;
    }
    if (which) legs_[*which].floats = true;
    return first_s;
  }

  void Advance(double until_s) {
    const bool any_diode = legs_[0].by_diode || legs_[1].by_diode || legs_[2].by_diode;
    const Complex final_A = voltage_V_ / motor_.phase_resistance_ohm;
    if (any_diode) {
      const double dt_s = until_s - now_s_;
      const Complex end_A = final_A + (driven_A_ - final_A) * std::exp(-dt_s * rate_) +
                            own_A_ * rotor_ * Complex(1, speed_ * dt_s);
      until_s = FirstZero(until_s, end_A);
    }
    const double dt_s = until_s - now_s_;
    const Complex off_A = driven_A_ - final_A;
    const double gone = -std::expm1(-dt_s * rate_);  // 1 - E
    const double left = 1 - gone;
    const Complex turn = std::polar(1.0, speed_ * dt_s);
    const Complex turn_s = TurnIntegral(speed_ * dt_s) * dt_s;
    // The integral of i_v exp(-j theta) gives both the torque and the product of i_v with i_e.
    const Complex mixed_As = std::conj(rotor_) * (final_A * std::conj(turn_s) +
                                                  off_A * (1.0 - left * std::conj(turn)) * cross_);
    const Complex charge_As = final_A * dt_s + off_A * (gone / rate_) + own_A_ * rotor_ * turn_s;
    const double square_A2s =
        (std::norm(final_A) + std::norm(own_A_)) * dt_s + 2 * Along(final_A, off_A) * gone / rate_ +
        std::norm(off_A) * gone * (1 + left) / (2 * rate_) + 2 * Along(mixed_As, own_A_);
    sum_.square_A2s += weight_ * square_A2s;
    sum_.iq_As += weight_ * (mixed_As.imag() + own_A_.imag() * dt_s);
    sum_.input_J += weight_ * 1.5 * Along(charge_As, voltage_V_);
    weighed_s_ += weight_ * dt_s;
    driven_A_ = final_A + off_A * left;
    rotor_ *= turn;
    now_s_ = until_s;
  }

  // (exp(jx) - 1) / (jx)
  static Complex TurnIntegral(double x) {
    if (std::abs(x) < 0.02) {
      const double x2 = x * x;
      return {1 - x2 / 6 * (1 - x2 / 20 * (1 - x2 / 42)), x / 2 * (1 - x2 / 12 * (1 - x2 / 30))};
    }
    return {std::sin(x) / x, (1 - std::cos(x)) / x};
  }

  struct Sums {
    double square_A2s = 0;
    double iq_As = 0;
    double input_J = 0;
    double switching_J = 0;
  };

  MotorModel motor_;
  double v_bus_V_;
  double carrier_s_;
  double speed_;
  double rate_;       // 1/s, r / L
  Complex emf_V_;     // at the rotor angle 0
  Complex own_A_;     // i_e at the rotor angle 0
  Complex cross_;     // s, 1 / (rate + j w)
  Complex driven_A_;  // i_v
  Complex rotor_;
  Complex voltage_V_;
  std::array<CurrentLeg, kLegs> legs_;
  double now_s_ = 0;  // since the carrier began
  double weight_ = 0;
  Sums sum_;
  double weighed_s_ = 0;
};

// A carrier of a vector that is computed, and how many carriers it stands for.
struct Sample {
  double carrier = 0;  // place in the vector; a half for one between two
  double weight = 0;
};

std::vector<Sample> SamplesOf(const MotorModel& motor, const AxisDrive& drive, bool all) {
  constexpr double kTurnOfSampleDeg = 2;
  constexpr double kDecayMax = 1e-4;
  const double time_constants =
      drive.counter1 / kTimerHz * motor.phase_resistance_ohm / motor.phase_inductance_H;
  const double settling = std::ceil(-std::log(kDecayMax) / time_constants) + 1;
  const double blocks = std::max(2.0, std::ceil(360.0 / drive.subdivision / kTurnOfSampleDeg));
  const int repeat = drive.repeat;
  std::vector<Sample> samples;
  if (all || settling + blocks >= repeat) {
    for (int k = 0; k < repeat; ++k) samples.push_back({static_cast<double>(k), 1});
    return samples;
  }
  const int first = static_cast<int>(settling);
  const int count = static_cast<int>(blocks);
  for (int k = 0; k < first; ++k) samples.push_back({static_cast<double>(k), 1});
  for (int k = 0; k < count; ++k) {
    const int begin = first + (repeat - first) * k / count;
    const int end = first + (repeat - first) * (k + 1) / count;
    samples.push_back({(begin + end - 1) / 2.0, static_cast<double>(end - begin)});
  }
  return samples;
}

// ---- the lag that pulls the load

struct Balance {
  double lag_rad = 0;
  bool stalled = false;
};

// Torque over lag is nearly amplitude * sin(lag - shift) - drag. Each trial refines amplitude and
// drag, and bisection takes over where that leads out of the bracket.
class LagSearch {
 public:
  LagSearch(const MotorModel& motor, const Feed& feed) : motor_(motor), feed_(feed) {
    const double speed = SpeedRadPerS(feed.drive);
    const Complex z(motor.phase_resistance_ohm, speed * motor.phase_inductance_H);
    shift_ = std::arg(z);
    const double per_A = 1.5 * motor.flux_linkage_Wb;
    amplitude_Nm_ = per_A * feed.v_bus_V / std::numbers::sqrt3 / std::abs(z);
    drag_Nm_ = per_A * speed * motor.flux_linkage_Wb * std::cos(shift_) / std::abs(z);
    load_Nm_ = motor.load_torque_Nm + motor.viscous_Nms * speed;
    tolerance_Nm_ = 1e-4 * amplitude_Nm_;
  }

  Balance Find(TurnMeans* means) {
    double low = shift_ - kPi / 2;
    double high = shift_ + kPi / 2;
    bool pulls_at_high = false;
    double lag = Proposal();
    for (int trial = 0; trial < 40; ++trial) {
      *means = MeansOverTurn(motor_, feed_, {.lag_rad = lag});
      const double off_Nm = means->torque_Nm - load_Nm_;
      if (std::abs(off_Nm) <= tolerance_Nm_) return {lag, false};
      if (off_Nm < 0 && lag >= shift_ + kPi / 2 - 1e-6) return {lag, true};
      (off_Nm < 0 ? low : high) = lag;
      if (off_Nm > 0) pulls_at_high = true;
      Refine(lag, means->torque_Nm);
      lag = Proposal();
      const bool inside = lag > low && (lag < high || (!pulls_at_high && lag <= high));
      if (!inside) lag = (low + high) / 2;
      if (high - low < 1e-9) return {lag, false};
    }
    return {lag, false};
  }

 private:
  [[nodiscard]] double Proposal() const {
    return shift_ + std::asin(std::clamp((load_Nm_ + drag_Nm_) / amplitude_Nm_, -1.0, 1.0));
  }
  void Refine(double lag, double torque_Nm) {
    const double sine = std::sin(lag - shift_);
    if (last_ && std::abs(sine - last_->first) > 1e-4) {
      const double slope_Nm = (torque_Nm - last_->second) / (sine - last_->first);
      if (slope_Nm > 0.2 * amplitude_Nm_) amplitude_Nm_ = slope_Nm;
    }
    drag_Nm_ = amplitude_Nm_ * sine - torque_Nm;
    last_ = {sine, torque_Nm};
  }

  MotorModel motor_;
  Feed feed_;
  double shift_ = 0;
  double amplitude_Nm_ = 0;
  double drag_Nm_ = 0;
  double load_Nm_ = 0;
  double tolerance_Nm_ = 0;
  std::optional<std::pair<double, double>> last_;
};

}  // namespace

double SpeedRadPerS(const AxisDrive& drive) {
  return 2 * kPi / (drive.subdivision * SecondsPerVector(drive));
}

TurnMeans MeansOverTurn(const MotorModel& motor, const Feed& feed, const TurnOptions& options) {
  const AxisDrive& drive = feed.drive;
  FOCALFLEET_CHECK(feed.v_bus_V > 0 && drive.counter1 > 0 && drive.repeat > 0);
  FOCALFLEET_CHECK(drive.subdivision > 0);
  constexpr double kWarmUpTimeConstants = 30;
  const std::uint32_t vectors =
      drive.subdivision % 3 == 0 ? drive.subdivision / 3 : drive.subdivision;
  const auto samples = SamplesOf(motor, drive, options.every_carrier);
  const double carrier_s = drive.counter1 / kTimerHz;
  const double time_constant_s = motor.phase_inductance_H / motor.phase_resistance_ohm;
  const auto warm_up = static_cast<std::int64_t>(std::ceil(
      kWarmUpTimeConstants * time_constant_s / (static_cast<double>(samples.size()) * carrier_s)));
  const double turn_of_vector = 2 * kPi / drive.subdivision;
  Bridge bridge(motor, feed, options.rotor_stands);
  for (std::int64_t n = -warm_up; n < vectors; ++n) {
    if (n == 0) bridge.Forget();
    // The mean field of a held vector is where the vector is in the middle of the hold.
    const std::int64_t k = options.first_vector + n;
    const std::int64_t wrapped = ((k % drive.subdivision) + drive.subdivision) % drive.subdivision;
    const Pulses pulses = PulsesOf(static_cast<std::uint32_t>(wrapped), drive, feed.mode);
    for (const Sample& sample : samples) {
      const double part = sample.carrier / drive.repeat - 0.5;
      const double rotor_rad =
          turn_of_vector * (static_cast<double>(wrapped) + part) - options.lag_rad;
      bridge.RunCarrier(pulses, rotor_rad, sample.weight);
    }
  }
  return bridge.Means();
}

MotorPower SteadyPower(const MotorModel& motor, const Feed& feed) {
  TurnMeans means;
  const Balance balance = LagSearch(motor, feed).Find(&means);
  if (balance.stalled) means = MeansOverTurn(motor, feed, {.rotor_stands = true});
  return {means.winding_W, means.mechanical_W, means.switching_W, balance.stalled};
}

const MotorPower& DrivePowers::Of(const Feed& feed) {
  const AxisDrive& drive = feed.drive;
  const Key key{drive.counter1, drive.repeat, drive.subdivision, feed.mode, feed.v_bus_V};
  const auto [place, is_new] = known_.try_emplace(key);
  if (is_new) place->second = SteadyPower(motor_, feed);
  return place->second;
}

}  // namespace focalfleet
