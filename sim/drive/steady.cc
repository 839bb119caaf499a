#include "sim/drive/steady.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/check.h"
#include "protocol/base/units.h"
#include "sim/drive/torque_ripple.h"

namespace focalfleet::sim {
namespace {

Drive::Setting HeldAtSpeed(Drive::Setting setting) {
  setting.motor.inertia_kg_m2 = 1e9;
  setting.motor.viscous_Nms = 0;
  setting.motor.load_Nm = 0;
  return setting;
}

double FieldSpeed(const Modulation& modulation) { return kTurnRad * modulation.field_Hz(); }

// The first vector is centred on the angle that it is shown for. The field stands still at angle 0
// while a turning rotor passes from half a vector before to half a vector after.
double AngleAtBegin(const Modulation& modulation, double lag_rad) {
  return -lag_rad - std::numbers::pi / modulation.subdivision;
}

// The lag at which a sinusoid of the field's speed pulls most.
double LagOfPullOut(const Drive::Setting& setting, double speed_rad_per_s) {
  return std::numbers::pi / 2 +
         std::atan2(speed_rad_per_s * setting.motor.inductance_H, setting.motor.resistance_ohm);
}

struct Trial {
  double torque_Nm = 0;
  std::complex<double> current_A;
};

// The number of vectors until currents have settled to e^-20.
std::int64_t SettlingVectors(const Drive::Setting& setting, const Modulation& modulation) {
  const double tau_s = setting.motor.inductance_H / setting.motor.resistance_ohm;
  return static_cast<std::int64_t>(std::ceil(20 * tau_s / modulation.vector_s()));
}

// A rotor held at speed starts before vector 0 by as much as the currents need to settle.
void RunIn(Drive* held, const Modulation& modulation, const std::vector<Pattern>& table,
           double lag_rad, std::int64_t vectors) {
  held->Place(AngleAtBegin(modulation, lag_rad) -
                  kTurnRad * static_cast<double>(vectors) / modulation.subdivision,
              FieldSpeed(modulation));
  RunVectors(held, modulation, table, -vectors, vectors);
}

// The mean torque at a lag, over a third of a turn: sectors repeat in pairs.
Trial TorqueAt(const Drive::Setting& held, const Modulation& modulation,
               const std::vector<Pattern>& table, double lag_rad) {
  const double speed = FieldSpeed(modulation);
  Drive drive(held);
  RunIn(&drive, modulation, table, lag_rad, SettlingVectors(held, modulation));
  const Trial settled{0, drive.current_A()};
  const DriveEnergy before = drive.energy();
  const double begin_s = drive.t_s();
  RunVectors(&drive, modulation, table, 0, modulation.subdivision / 3);
  // Mechanical work is the energy that the winding and the switches did not take.
  const DriveEnergy after = drive.energy();
  const auto magnetic = [&](std::complex<double> current) {
    return 0.75 * held.motor.inductance_H * std::norm(current);
  };
  const double work_J = (after.supply_J - before.supply_J) - (after.copper_J - before.copper_J) -
                        (after.switching_J - before.switching_J) -
                        (magnetic(drive.current_A()) - magnetic(settled.current_A));
  return {work_J / (speed * (drive.t_s() - begin_s)), settled.current_A};
}

}  // namespace

void RunVectors(Drive* drive, const Modulation& modulation, const std::vector<Pattern>& table,
                std::int64_t first, std::int64_t count) {
  const std::int64_t subdivision = modulation.subdivision;
  FOCALFLEET_CHECK(static_cast<std::int64_t>(table.size()) == subdivision);
  const std::int64_t step = count < 0 ? -1 : 1;
  for (std::int64_t k = 0; k != count; k += step) {
    const std::int64_t index = (((first + k) % subdivision) + subdivision) % subdivision;
    const Pattern& pattern = table[static_cast<std::size_t>(index)];
    for (int n = 0; n < modulation.repeat; ++n) drive->RunCarrier(pattern, modulation);
  }
}

std::optional<SteadyState> FindSteadyState(const Drive::Setting& setting,
                                           const Modulation& modulation, double load_Nm) {
  const Drive::Setting held = HeldAtSpeed(setting);
  const std::vector<Pattern> table = VectorTable(modulation);
  const double speed = FieldSpeed(modulation);
  const double wanted_Nm = load_Nm + setting.motor.viscous_Nms * speed;
  // Torque over lag is a sine, lowered by the back-EMF and shifted by the winding's phase.
  double low = 0;
  double high = LagOfPullOut(held, speed);
  double at_low = TorqueAt(held, modulation, table, low).torque_Nm - wanted_Nm;
  double at_high = TorqueAt(held, modulation, table, high).torque_Nm - wanted_Nm;
  if (at_high < 0) return std::nullopt;
  for (int extended = 0; at_low > 0 && extended < 4; ++extended) {  // the load drags the rotor
    low -= std::numbers::pi / 8;
    at_low = TorqueAt(held, modulation, table, low).torque_Nm - wanted_Nm;
  }
  SteadyState state{.lag_rad = low, .speed_rad_per_s = speed};
  // Regula falsi by the Illinois rule: the end that stays counts half.
  for (int k = 0; k < 40; ++k) {
    state.lag_rad = low + (high - low) * at_low / (at_low - at_high);
    const Trial trial = TorqueAt(held, modulation, table, state.lag_rad);
    state.torque_Nm = trial.torque_Nm;
    state.current_A = trial.current_A;
    const double off = trial.torque_Nm - wanted_Nm;
    if (std::abs(off) < 1e-9 * (wanted_Nm + 1e-9)) break;
    if (off < 0) {
      low = state.lag_rad;
      at_low = off;
      at_high /= 2;
    } else {
      high = state.lag_rad;
      at_high = off;
      at_low /= 2;
    }
  }
  return state;
}

double PullOutTorque(const Drive::Setting& setting, const Modulation& modulation) {
  const Drive::Setting held = HeldAtSpeed(setting);
  const std::vector<Pattern> table = VectorTable(modulation);
  double best_Nm = 0;
  const double top_rad = LagOfPullOut(held, FieldSpeed(modulation));
  // The top of a sine is flat: values within 3 degrees of it differ by 0.14 %.
  for (int deg = -30; deg <= 12; deg += 6)
    best_Nm = std::max(best_Nm,
                       TorqueAt(held, modulation, table, top_rad + deg * kTurnRad / 360).torque_Nm);
  return best_Nm;
}

Drive InSteadyRotation(const Drive::Setting& setting, const Modulation& modulation,
                       const SteadyState& state) {
  Drive drive(setting);
  drive.Place(AngleAtBegin(modulation, state.lag_rad), state.speed_rad_per_s);
  drive.SetCurrent(state.current_A);
  return drive;
}

WaveFigures MeasureSteadyWave(const Drive::Setting& setting, const Modulation& modulation,
                              const SteadyState& state) {
  const std::vector<Pattern> table = VectorTable(modulation);
  Drive drive(HeldAtSpeed(setting));
  RunIn(&drive, modulation, table, state.lag_rad, SettlingVectors(setting, modulation));
  drive.ResetPeak();

  const DriveEnergy before = drive.energy();
  const double square_before = drive.square_A2s();
  const double begin_s = drive.t_s();
  const std::uint64_t edges_before = drive.edges();
  const double diode_before_C = drive.diode_C();
  const double turn_s = 1 / modulation.field_Hz();

  // Components e^(j m w t) of the current in the plane, m = -6..6; a phase cannot distinguish m and
  // -m.
  constexpr int kHarmonics = 6;
  std::array<std::complex<double>, 2 * kHarmonics + 1> components{};
  TorqueRipple ripple(modulation.carrier_s());
  drive.Listen([&](const DriveInterval& interval) {
    for (int m = -kHarmonics; m <= kHarmonics; ++m) {
      // e^(-j m w t) about the interval's begin, to third order.
      const std::complex<double> rate(0, -kTurnRad * m / turn_s);
      const std::complex<double> around =
          interval.moments[0] +
          rate * (interval.moments[1] +
                  rate * (0.5 * interval.moments[2] + rate / 6.0 * interval.moments[3]));
      components[static_cast<std::size_t>(kHarmonics + m)] +=
          around * std::polar(1.0, -kTurnRad * m * (interval.t_s - begin_s) / turn_s);
    }
    ripple.Hear(interval);
  });
  RunVectors(&drive, modulation, table, 0, modulation.subdivision);

  const double time_s = drive.t_s() - begin_s;
  const DriveEnergy after = drive.energy();
  WaveFigures figures;
  const double square_A2 = (drive.square_A2s() - square_before) / time_s / 2;
  figures.peak_A = drive.peak_A();
  figures.rms_A = std::sqrt(square_A2);
  std::array<double, kHarmonics + 1> harmonic_A2{};
  for (int m = 0; m <= kHarmonics; ++m) {
    const auto up = static_cast<std::size_t>(kHarmonics + m);
    const auto down = static_cast<std::size_t>(kHarmonics - m);
    const double both = std::norm(components[up] / time_s) + std::norm(components[down] / time_s);
    harmonic_A2[static_cast<std::size_t>(m)] = m == 0 ? both / 4 : both / 2;
  }
  double first_six_A2 = 0;
  for (std::size_t m = 1; m < harmonic_A2.size(); ++m) first_six_A2 += harmonic_A2[m];
  const double fundamental_A2 = harmonic_A2[1];
  const double alternating_A2 = square_A2 - harmonic_A2[0];
  figures.fundamental_A = std::sqrt(2 * fundamental_A2);
  figures.snr_dB = 10 * std::log10(fundamental_A2 / (square_A2 - first_six_A2));
  figures.thd = std::sqrt(std::max(0.0, alternating_A2 - fundamental_A2) / fundamental_A2);
  const TorqueRipple::Figures torque = ripple.Judge();
  figures.torque_mean_Nm = torque.mean_Nm;
  figures.torque_ripple_peak_to_peak = torque.peak_to_peak;
  figures.torque_ripple_rms = torque.rms;
  figures.power.supply_W = (after.supply_J - before.supply_J) / time_s;
  figures.power.copper_W = (after.copper_J - before.copper_J) / time_s;
  figures.power.switching_W = (after.switching_J - before.switching_J) / time_s;
  figures.power.mechanical_W = state.torque_Nm * state.speed_rad_per_s;
  figures.supply_A = figures.power.supply_W / setting.bridge.v_bus_V;
  figures.diode_A = (drive.diode_C() - diode_before_C) / time_s;
  figures.edges_per_carrier =
      static_cast<double>(drive.edges() - edges_before) / (time_s / modulation.carrier_s());
  return figures;
}

}  // namespace focalfleet::sim
