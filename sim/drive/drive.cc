#include "sim/drive/drive.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace focalfleet::sim {
namespace {

using Complex = std::complex<double>;
constexpr double kRoot3Half = 0.86602540378443864676;
constexpr std::array<Complex, kLegCount> kPhase = {
    {{1, 0}, {-0.5, kRoot3Half}, {-0.5, -kRoot3Half}}};

// Every interval is at most this long. The bound limits the turn of the rotor and the change of its
// speed within an interval.
constexpr double kCircuitStepMax_s = 1e-6;
// The search for the instant at which a current dies out advances by at least this much.
constexpr double kCrossingMin_s = 1e-14;

double Project(Complex vector, std::size_t leg) {
  return vector.real() * kPhase[leg].real() + vector.imag() * kPhase[leg].imag();
}

// A switching edge of one carrier period.
struct SwitchingEdge {
  double at_s;
  std::size_t leg;
  bool high;
};

// The edges of one carrier period in order of time.
struct CarrierEdges {
  CarrierEdges(const Pattern& pattern, const Modulation& modulation) {
    for (std::size_t k = 0; k < kLegCount; ++k) {
      if (pattern[k].none()) {
        in_order[count++] = {0, k, false};
        continue;
      }
      if (pattern[k].on > 0) in_order[count++] = {0, k, false};
      in_order[count++] = {pattern[k].on / modulation.clock_Hz, k, true};
      if (pattern[k].off < modulation.counter1)
        in_order[count++] = {pattern[k].off / modulation.clock_Hz, k, false};
    }
    std::sort(in_order.begin(), in_order.begin() + static_cast<std::ptrdiff_t>(count),
              [](const SwitchingEdge& a, const SwitchingEdge& b) { return a.at_s < b.at_s; });
  }

  std::array<SwitchingEdge, 3 * kLegCount> in_order{};
  std::size_t count = 0;
};

}  // namespace

Complex Drive::Course::At(double t) const {
  return c[0] + t * (c[1] + t * (c[2] + t * c[3])) + h * std::exp(-t * rate);
}

Drive::Drive(const Setting& setting) : setting_(setting), shaft_(setting.motor, setting.gearhead) {}

double Drive::torque_Nm() const {
  const Complex direction = std::polar(1.0, shaft_.angle_rad());
  return 1.5 * setting_.motor.flux_linkage_Wb * (current_ * std::conj(direction)).imag();
}

DriveEnergy Drive::energy() const {
  const MotorParameters& motor = setting_.motor;
  return {.supply_J = supply_J_,
          .copper_J = 1.5 * motor.resistance_ohm * square_A2s_,
          .switching_J = switching_J_,
          .load_J = shaft_.load_J(),
          .viscous_J = shaft_.viscous_J(),
          .stored_J = 0.75 * motor.inductance_H * std::norm(current_) + shaft_.kinetic_J()};
}

void Drive::Probe(double period_s, Sink sink) {
  probe_period_s_ = period_s;
  next_probe_s_ = 0;
  sink_ = std::move(sink);
}

void Drive::Command(Leg* leg, bool high, double now_s, double phase_A) {
  if (leg->commanded_high == high) return;
  ++edges_;
  leg->commanded_high = high;
  if (setting_.bridge.dead_time_s <= 0) {
    leg->path = high ? Leg::Path::kUpper : Leg::Path::kLower;
    leg->FollowPath(setting_.bridge, now_s);
    return;
  }
  leg->closes_at_s = now_s + setting_.bridge.dead_time_s;
  leg->gate_rises = false;
  if (leg->open()) return;
  leg->path = phase_A > 0   ? Leg::Path::kLowerDiode
              : phase_A < 0 ? Leg::Path::kUpperDiode
                            : Leg::Path::kFloats;
  leg->FollowPath(setting_.bridge, now_s);
}

// At the end of a dead time the gate begins to rise. A leg that the other diode still holds begins
// its ramp, which lies around the middle of the gate's. Any other leg waits until that middle. Its
// own diode holds it at the rail already, or its current has died out (or is about to) and it
// floats.
void Drive::CloseSwitches(double now_s) {
  for (std::size_t k = 0; k < kLegCount; ++k) {
    Leg& leg = legs_[k];
    if (leg.closes_at_s > now_s) continue;
    const bool high = leg.commanded_high;
    const double half_s = (high ? setting_.bridge.rise_s : setting_.bridge.fall_s) / 2;
    if (!leg.gate_rises && half_s > 0) {
      const auto other = high ? Leg::Path::kLowerDiode : Leg::Path::kUpperDiode;
      const double sign = high ? 1 : -1;
      const bool held = leg.path == other && sign * Project(CourseOf(speed_).At(half_s), k) > 0;
      if (!held) {
        leg.gate_rises = true;
        leg.closes_at_s = now_s + half_s;
        continue;
      }
    }
    const bool died_out = leg.gate_rises && leg.path == Leg::Path::kFloats;
    leg.gate_rises = false;
    leg.closes_at_s = Leg::kNever;
    leg.path = high ? Leg::Path::kUpper : Leg::Path::kLower;
    if (died_out) leg.voltage_V = high ? setting_.bridge.v_bus_V : 0;
    leg.FollowPath(setting_.bridge, now_s);
  }
}

// A leg without current takes its voltage from the others: that of the star plus its back-EMF.
double Drive::FloatingVoltage(std::size_t leg) const {
  const Complex back_emf_V = kJ * (speed_ * setting_.motor.flux_linkage_Wb) * direction_;
  double tied_V = 0;
  double tied_emf_V = 0;
  int tied = 0;
  for (std::size_t other = 0; other < kLegCount; ++other) {
    if (other == leg || legs_[other].path == Leg::Path::kFloats) continue;
    tied_V += legs_[other].voltage_V;
    tied_emf_V += Project(back_emf_V, other);
    ++tied;
  }
  if (tied == 0) return setting_.bridge.v_bus_V / 2;
  return (tied_V - tied_emf_V) / tied + Project(back_emf_V, leg);
}

// A leg floats only while its voltage stays between the rails; beyond them a diode carries the
// current.
void Drive::SettleDiodes(double now_s) {
  for (std::size_t k = 0; k < kLegCount; ++k) {
    Leg& leg = legs_[k];
    if (leg.path != Leg::Path::kFloats) continue;
    leg.voltage_V = FloatingVoltage(k);
    if (leg.voltage_V >= 0 && leg.voltage_V <= setting_.bridge.v_bus_V) continue;
    const bool below = leg.voltage_V < 0;
    leg.path = below ? Leg::Path::kLowerDiode : Leg::Path::kUpperDiode;
    leg.voltage_V = below ? 0 : setting_.bridge.v_bus_V;
    leg.FollowPath(setting_.bridge, now_s);
  }
}

Drive::Course Drive::CourseOf(double speed) const {
  const MotorParameters& motor = setting_.motor;
  const double r = motor.resistance_ohm;
  const double l = motor.inductance_H;
  Complex voltage;
  Complex slope;
  std::size_t floating = 0;
  std::size_t last_floating = 0;
  for (std::size_t k = 0; k < kLegCount; ++k) {
    if (legs_[k].path == Leg::Path::kFloats) {
      ++floating;
      last_floating = k;
      continue;
    }
    voltage += legs_[k].voltage_V * kPhase[k];
    slope += legs_[k].slope_V_per_s * kPhase[k];
  }
  voltage *= 2.0 / 3;
  slope *= 2.0 / 3;
  Course course;
  course.rate = r / l;
  if (floating >= 2) {
    course.c = {};
    course.h = 0;
    return course;
  }
  // Particular solution of the back-EMF: a phasor that turns with the rotor.
  const Complex emf = -kJ * (speed * motor.flux_linkage_Wb) / Complex(r, speed * l) * direction_;
  const Complex turn = kJ * speed;
  const Complex c1 = slope / r;
  const Complex emf1 = emf * turn;
  const Complex emf2 = emf1 * turn * 0.5;
  course.c = {(voltage - l * c1) / r + emf, c1 + emf1, emf2, emf2 * turn * (1.0 / 3)};
  if (floating == 1) {
    // Two legs are in series: only the direction across the floating phase is left.
    const Complex across = kJ * kPhase[last_floating];
    // A floating leg's voltage lies along its own phase, so leaving it out above changes nothing.
    for (Complex& c : course.c) c = across * (c * std::conj(across)).real();
  }
  course.h = current_ - course.c[0];
  return course;
}

// The instant within the interval at which the current of a conducting diode dies out; `step_s`
// where none does.
double Drive::Crossing(const Course& course, double step_s, std::size_t* crossed) const {
  double first = step_s;
  *crossed = kLegCount;
  for (std::size_t k = 0; k < kLegCount; ++k) {
    const Leg::Path path = legs_[k].path;
    if (path != Leg::Path::kUpperDiode && path != Leg::Path::kLowerDiode) continue;
    const double sign = path == Leg::Path::kLowerDiode ? 1 : -1;
    if (sign * Project(course.At(first), k) >= 0) continue;
    double low = 0;
    double high = first;
    for (int i = 0; i < 60 && high - low > 1e-18; ++i) {
      const double middle = (low + high) / 2;
      (sign * Project(course.At(middle), k) >= 0 ? low : high) = middle;
    }
    first = high;
    *crossed = k;
  }
  return first;
}

void Drive::Emit(const Course& course, double now_s, double step_s, double speed) {
  while (next_probe_s_ < now_s + step_s) {
    const double t = std::max(0.0, next_probe_s_ - now_s);
    const Complex current = course.At(t);
    const Complex direction = direction_ * std::polar(1.0, speed * t);
    DriveSample sample;
    sample.t_s = elapsed_s_ + next_probe_s_;
    for (std::size_t k = 0; k < kLegCount; ++k) {
      sample.current_A[k] = Project(current, k);
      sample.voltage_V[k] = legs_[k].voltage_V + legs_[k].slope_V_per_s * t;
    }
    sample.torque_Nm =
        1.5 * setting_.motor.flux_linkage_Wb * (current * std::conj(direction)).imag();
    sample.angle_rad = shaft_.angle_rad() + speed * t;
    sink_(sample);
    next_probe_s_ += probe_period_s_;
  }
}

// Integrals over the interval: |i|^2, the energy from the supply, the energy that the switches
// take, and the torque.
void Drive::Account(const Course& course, double now_s, double step_s, double decay) {
  const double tau = 1 / course.rate;
  // Integrals of t^k e^(-t/tau) and of t^k.
  std::array<double, 4> fading;
  fading[0] = tau * (1 - decay);
  double power = 1;
  for (std::size_t k = 1; k < 4; ++k) {
    power *= step_s;
    fading[k] = tau * (static_cast<double>(k) * fading[k - 1] - power * decay);
  }
  std::array<double, 7> flat;
  power = 1;
  for (std::size_t k = 0; k < flat.size(); ++k) {
    power *= step_s;
    flat[k] = power / static_cast<double>(k + 1);
  }

  double square = std::norm(course.h) * tau / 2 * (1 - decay * decay);
  std::array<Complex, 4> moments;
  for (std::size_t k = 0; k < 4; ++k) {
    moments[k] = course.h * fading[k];
    for (std::size_t a = 0; a < 4; ++a) moments[k] += course.c[a] * flat[a + k];
    square += (std::conj(course.c[k]) * (moments[k] + course.h * fading[k])).real();
  }
  square_A2s_ += square;

  for (std::size_t k = 0; k < kLegCount; ++k) {
    const Leg& leg = legs_[k];
    if (leg.path == Leg::Path::kFloats) continue;
    const double charge = Project(moments[0], k);
    if (leg.open()) diode_C_ += std::abs(charge);
    const double out_J = leg.voltage_V * charge + leg.slope_V_per_s * Project(moments[1], k);
    if (leg.slope_V_per_s == 0) {
      if (leg.voltage_V > 0) supply_J_ += out_J;
      continue;
    }
    // On a ramp the upper switch carries what flows out, the lower one what flows in.
    const double given_J = charge > 0 ? setting_.bridge.v_bus_V * charge : 0;
    supply_J_ += given_J;
    switching_J_ += given_J - out_J;
  }

  // The torque's current is i seen from the rotor, whose turn is expanded as in the course.
  const Complex turn = -kJ * speed_;
  const Complex rotor =
      moments[0] + turn * (moments[1] + turn * (0.5 * moments[2] + turn / 6.0 * moments[3]));
  const auto torque_of = [&](Complex current) {
    return 1.5 * setting_.motor.flux_linkage_Wb * (current * std::conj(direction_)).imag();
  };
  const double impulse_Nms = torque_of(rotor);
  shaft_.Step(impulse_Nms, step_s);
  if (!listener_) return;
  const double moment_Nms2 = torque_of(moments[1] + turn * (moments[2] + 0.5 * turn * moments[3]));
  listener_({elapsed_s_ + now_s, step_s, moments, impulse_Nms, moment_Nms2});
}

void Drive::Advance(double now_s, double step_s) {
  const double torque =
      1.5 * setting_.motor.flux_linkage_Wb * (current_ * std::conj(direction_)).imag();
  speed_ = shaft_.MiddleSpeed(torque, step_s);
  const Course course = CourseOf(speed_);
  if (sink_) Emit(course, now_s, step_s, speed_);
  const double decay = std::exp(-step_s * course.rate);
  const double angle_before = shaft_.angle_rad();
  Account(course, now_s, step_s, decay);
  current_ = course.c[0] + step_s * (course.c[1] + step_s * (course.c[2] + step_s * course.c[3])) +
             course.h * decay;
  const double turned = shaft_.angle_rad() - angle_before;
  // e^(j turned) for a small turn is exact to 1e-15 of the step. Every carrier period computes the
  // direction anew.
  const double half = turned * turned / 2;
  direction_ *= Complex(1 - half + half * half / 6, turned * (1 - half / 3 + half * half / 30));
  for (std::size_t k = 0; k < kLegCount; ++k) {
    legs_[k].voltage_V += legs_[k].slope_V_per_s * step_s;
    peak_A_ = std::max(peak_A_, std::abs(Project(current_, k)));
  }
}

void Drive::RunCarrier(const Pattern& pattern, const Modulation& modulation) {
  const double period_s = modulation.carrier_s();
  direction_ = std::polar(1.0, shaft_.angle_rad());

  const CarrierEdges edges(pattern, modulation);
  double now_s = 0;
  std::size_t next = 0;
  while (true) {
    while (next < edges.count && edges.in_order[next].at_s <= now_s) {
      // The switch opens in the middle of its gate's ramp; the current of that instant chooses the
      // diode.
      const SwitchingEdge& edge = edges.in_order[next];
      const double half_s = (edge.high ? setting_.bridge.rise_s : setting_.bridge.fall_s) / 2;
      Command(&legs_[edge.leg], edge.high, now_s, Project(CourseOf(speed_).At(half_s), edge.leg));
      ++next;
    }
    CloseSwitches(now_s);
    for (Leg& leg : legs_)
      if (leg.ramp_ends_at_s <= now_s) {
        leg.slope_V_per_s = 0;
        leg.ramp_ends_at_s = Leg::kNever;
        const bool upper = leg.path == Leg::Path::kUpper || leg.path == Leg::Path::kUpperDiode;
        leg.voltage_V = upper ? setting_.bridge.v_bus_V : 0;
      }
    SettleDiodes(now_s);
    if (now_s >= period_s) break;

    double until_s = std::min(period_s, now_s + kCircuitStepMax_s);
    if (next < edges.count) until_s = std::min(until_s, edges.in_order[next].at_s);
    bool diode = false;
    for (const Leg& leg : legs_) {
      until_s = std::min({until_s, leg.closes_at_s, leg.ramp_ends_at_s});
      diode |= leg.path == Leg::Path::kUpperDiode || leg.path == Leg::Path::kLowerDiode;
    }
    std::size_t crossed = kLegCount;
    if (diode) {
      speed_ = shaft_.MiddleSpeed(
          1.5 * setting_.motor.flux_linkage_Wb * (current_ * std::conj(direction_)).imag(),
          until_s - now_s);
      const double step_s = Crossing(CourseOf(speed_), until_s - now_s, &crossed);
      until_s = now_s + std::max(step_s, kCrossingMin_s);
    }
    Advance(now_s, until_s - now_s);
    now_s = until_s;
    if (crossed < kLegCount) {
      Leg& leg = legs_[crossed];
      leg.path = Leg::Path::kFloats;
      leg.FollowPath(setting_.bridge, now_s);
      current_ -= Project(current_, crossed) * kPhase[crossed];
    }
  }
  for (Leg& leg : legs_) {
    leg.closes_at_s -= period_s;
    leg.ramp_ends_at_s -= period_s;
  }
  next_probe_s_ -= period_s;
  elapsed_s_ += period_s;
}

}  // namespace focalfleet::sim
