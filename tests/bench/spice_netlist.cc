#include "tests/bench/spice_netlist.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <string_view>

namespace focalfleet::bench {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
// Delay of the comparators' answer; the carrier leads by it.
constexpr double kAnswer_s = 0.5e-9;
// Duration of the sawtooth's fall, just before a period's end.
constexpr double kFall_s = 0.1e-9;
// Ramp of a switch's control, which changes in the middle.
constexpr double kRamp_s = 0.4e-9;
// Volts of the sawtooth a count: ngspice's switches find their threshold to 0.05 V.
constexpr double kVoltsPerCount = 2;

[[gnu::format(printf, 2, 3)]] void Append(std::string* text, const char* format, ...) {
  char line[1024];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  *text += line;
}

CompareValues Centred(double width, double period) {
  const double whole = std::round(width);
  const double on = std::floor((period - whole) / 2);
  return {on, on + whole};
}

// The threshold at the comparators: a compare value of 0 is always passed, one at the top never.
double Threshold_V(const SpiceCase& setting, const CompareValues& values, double counts) {
  if (values.on >= values.off || counts >= setting.counter1) counts = 2 * setting.counter1;
  if (counts <= 0) counts = -setting.counter1;
  return counts * kVoltsPerCount;
}

// Appends `pattern`, in which a # stands for the leg's number.
void AppendLeg(std::string* text, std::string_view pattern, std::size_t leg) {
  for (const char c : pattern) *text += c == '#' ? static_cast<char>('0' + leg) : c;
}

constexpr std::string_view kLeg =
    "Son# one x# saw on# comparator\n"
    "Soff# x# h# off# saw comparator\n"
    "Rh# h# 0 1k\n"
    "Aad# [h#] [d#] adc\n"
    "Aup# d# du# upper\n"
    "Alow# d# dl# lower\n"
    "Agu# [du#] [gu#] gate\n"
    "Agl# [dl#] [gl#] gate\n"
    "Sup# bus leg# gu# 0 power\n"
    "Slow# leg# 0 gl# 0 power\n"
    "Dup# leg# bus diode\n"
    "Dlow# 0 leg# diode\n"
    "Vi# leg# m# 0\n"
    "R# m# n# {r}\n"
    "L# n# e# {l} ic=0\n"
    "Be# e# star v=time>={begin} ? -v(w)*{flux}*sin(v(theta)-#*{third}) : 0\n";

}  // namespace

std::array<CompareValues, 3> CompareValuesOf(const SpiceCase& setting, int vector) {
  std::array<double, 3> wanted;
  for (std::size_t x = 0; x < 3; ++x)
    wanted[x] =
        std::cos(kTurn * vector / setting.subdivision - kTurn * static_cast<double>(x) / 3) /
        std::numbers::sqrt3;
  const auto [lowest, highest] = std::minmax_element(wanted.begin(), wanted.end());
  const double period = setting.counter1;
  const double rest = period * (1 - (*highest - *lowest));
  std::array<CompareValues, 3> values;
  for (std::size_t x = 0; x < 3; ++x) {
    const double width = period * (wanted[x] - *lowest);
    switch (setting.mode) {
      case WaveMode::kAsymmetric:
        values[x] = {&wanted[x] == highest ? std::round(rest) : period - std::round(width), period};
        break;
      case WaveMode::kFiveSegment:
        values[x] = Centred(width, period);
        break;
      case WaveMode::kSevenSegment:
        values[x] = Centred(width + rest / 2, period);
        break;
    }
  }
  return values;
}

std::string References(const SpiceCase& setting) {
  const double vector_s = setting.repeat * setting.counter1 / setting.clock_Hz;
  const double begin_s = setting.sample_s - kAnswer_s;
  std::string text;
  for (int k = 0; k * vector_s < setting.duration_s + vector_s; ++k) {
    // The values change as the sawtooth falls, and not at once: ngspice searches for the crossing.
    for (const double at_s : {k * vector_s, (k + 1) * vector_s - kFall_s}) {
      Append(&text, "%.15e", at_s == 0 ? 0 : begin_s + at_s);
      for (const CompareValues& leg : CompareValuesOf(setting, k % setting.subdivision))
        Append(&text, " %.6e %.6e", Threshold_V(setting, leg, leg.on),
               Threshold_V(setting, leg, leg.off));
      text += "\n";
    }
  }
  return text;
}

std::string Netlist(const SpiceCase& s) {
  const double period_s = s.counter1 / s.clock_Hz;
  const double volts = s.counter1 * kVoltsPerCount;
  const double begin_s = s.sample_s - kAnswer_s;
  std::string text = "* motor on its bridge\n";
  Append(&text, "Vbus bus 0 %.15e\nVone one 0 1\n", s.v_bus_V);
  Append(&text, "Vsaw saw 0 PULSE(0 %.15e %.15e %.15e %.15e 1e-15 %.15e)\n",
         volts * (1 - kFall_s / period_s), begin_s, period_s - kFall_s, kFall_s - 1e-15, period_s);
  // ngspice ignores the corners of a pulse without a top. (A repeated PWL is evaluated from time 0
  // at every query.)
  Append(&text, "Vclock clock 0 PULSE(0 1 %.15e %g %g %.15e %.15e)\n", begin_s - kFall_s, kFall_s,
         kFall_s, period_s / 2, period_s);
  Append(&text, ".param r=%.15e l=%.15e flux=%.15e begin=%.15e third=%.15e\n", s.resistance_ohm,
         s.inductance_H, s.flux_Wb, s.sample_s, kTurn / 3);
  for (std::size_t leg = 0; leg < 3; ++leg) AppendLeg(&text, kLeg, leg);
  text +=
      "Aref %v([on0 off0 on1 off1 on2 off2]) references\n"
      ".model references filesource(file=\"references.txt\" amploffset=[0 0 0 0 0 0]\n"
      "+ amplscale=[1 1 1 1 1 1] timeoffset=0 timescale=1 timerelative=false amplstep=false)\n";
  Append(&text, ".model comparator sw(vt=0 vh=0 ron=1 roff=1g)\n");
  // On its way down the sawtooth passes between `off` and `on` once more. A gate swallows a pulse
  // that is shorter than the difference of its slow rise and fast fall. The next gate compensates
  // for that difference.
  const double gate_s = (s.rise_s - kRamp_s) / 2;
  Append(&text, ".model adc adc_bridge(in_low=0.5 in_high=0.5 rise_delay=%g fall_delay=%g)\n",
         2 * kAnswer_s, kAnswer_s);
  Append(&text, ".model upper d_buffer(rise_delay=%.15e fall_delay=%.15e)\n",
         s.dead_time_s + gate_s - kAnswer_s, gate_s);
  Append(&text, ".model lower d_inverter(rise_delay=%.15e fall_delay=%.15e)\n",
         s.dead_time_s + gate_s, gate_s - kAnswer_s);
  Append(&text, ".model gate dac_bridge(out_low=-0.125 out_high=0.125 t_rise=%g t_fall=%g)\n",
         kRamp_s, kRamp_s);
  Append(&text, ".model power sw(vt=0 vh=0 ron=0.1m roff=10meg)\n");
  // With a steeper diode a step counts as solved while a diode has yet to change its state.
  Append(&text, ".model diode d(is=1e-7 n=0.005)\n");
  Append(&text,
         "Bw 0 w i=time>={begin} ? ({flux}*(-i(Vi0)*sin(v(theta))-i(Vi1)*sin(v(theta)-{third})"
         "-i(Vi2)*sin(v(theta)-2*{third}))-%.15e*v(w)-%.15e)/%.15e : 0\n",
         s.viscous_Nms, s.load_Nm, s.inertia_kg_m2);
  Append(&text, "Cw w 0 1 ic=%.15e\n", s.speed_rad_per_s);
  Append(&text, "Btheta 0 theta i=time>={begin} ? v(w) : 0\nCtheta theta 0 1 ic=%.15e\n",
         s.angle_rad);
  Append(&text, ".options interp method=gear maxord=2 reltol=1e-6 abstol=1e-9 vntol=1e-7\n");
  Append(&text, ".save i(Vi0) i(Vi1) i(Vi2) v(theta) v(w)\n");
  Append(&text, ".tran %.15e %.15e 0 %.15e uic\n", s.sample_s, s.duration_s + s.sample_s,
         s.step_max_s);
  // The tolerance is for the diodes; steps may be longer than it demands. The option `-r` is not
  // used: with `interp` it spoils the file.
  text +=
      ".control\n"
      "set filetype=binary\n"
      "set xtrtol=10\n"
      "run\n"
      "write motor.raw i(Vi0) i(Vi1) i(Vi2) v(theta) v(w)\n"
      "quit\n"
      ".endc\n"
      ".end\n";
  return text;
}

std::vector<SpiceRow> ReadRaw(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string line;
  int variables = 0;
  bool binary = false;
  while (!binary && std::getline(in, line)) {
    if (line.rfind("No. Variables:", 0) == 0) variables = std::stoi(line.substr(14));
    binary = line == "Binary:";
  }
  std::vector<SpiceRow> rows;
  if (!binary || variables != 6) return rows;
  std::array<double, 6> row;
  while (in.read(reinterpret_cast<char*>(row.data()), sizeof row))
    rows.push_back({row[0], {row[1], row[2], row[3]}, row[4], row[5]});
  return rows;
}

}  // namespace focalfleet::bench
