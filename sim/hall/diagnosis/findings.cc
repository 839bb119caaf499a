#include "sim/hall/diagnosis/findings.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "sim/hall/diagnosis/calibration.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// All accepted hypotheses of one cause, merged.
struct Merged {
  HallHypothesis all;
  std::vector<HallCause> rivals;
};

bool ShapesThePole(const HallHypothesis& one, const ParameterLayout& layout) {
  return one.cause == HallCause::kFieldHarmonics &&
         layout.terms[one.parameters.front() - layout.term(0)].order == 4;
}

// A pole that no width fits has another shape, and the change of the width belongs to that shape.
std::vector<Merged> Merge(const Selected& selected, const ParameterLayout& layout) {
  const bool other_shape =
      std::any_of(selected.on.begin(), selected.on.end(),
                  [&](const HallHypothesis& one) { return ShapesThePole(one, layout); });
  std::vector<Merged> merged;
  for (std::size_t k = 0; k < selected.on.size(); ++k) {
    const HallHypothesis& one = selected.on[k];
    if (one.cause == HallCause::kOutside) continue;
    const HallCause cause =
        one.cause == HallCause::kFieldWidth && other_shape ? HallCause::kFieldHarmonics : one.cause;
    auto same = std::find_if(merged.begin(), merged.end(),
                             [&](const Merged& other) { return other.all.cause == cause; });
    if (same == merged.end()) {
      merged.push_back({{cause, {}, {}, 0}, {}});
      same = merged.end() - 1;
    }
    const auto add = [](const auto& from, auto* to) {
      for (const auto& item : from)
        if (std::find(to->begin(), to->end(), item) == to->end()) to->push_back(item);
    };
    add(one.parameters, &same->all.parameters);
    add(one.sensors, &same->all.sensors);
    add(selected.rivals[k], &same->rivals);
  }
  for (Merged& one : merged) {
    std::sort(one.all.sensors.begin(), one.all.sensors.end());
    std::erase_if(one.rivals, [&](HallCause rival) {
      return rival == one.all.cause || rival == HallCause::kOutside;
    });
  }
  return merged;
}

std::string TermText(const FieldTerm& term) {
  std::string text = (term.sine ? "sin " : "cos ") + std::to_string(term.order) + " phi";
  if (term.order == 0) text = "the same all around";
  if (term.degree > 0) text += " times latitude^" + std::to_string(term.degree);
  return text;
}

struct Size {
  double amplitude = 0;
  double sd = 0;
  std::string unit;
  std::string text;
};

// The length of a vector, and its uncertainty along itself.
Size LengthOf(std::span<const std::size_t> parts, const HallDiagnosis& found) {
  double squares = 0, variance = 0;
  for (const std::size_t part : parts) squares += std::pow(found.parameters[At(part)], 2);
  const double whole = std::sqrt(squares);
  for (const std::size_t part : parts)
    if (whole > 0) variance += std::pow(found.parameters[At(part)] / whole * found.sd[At(part)], 2);
  return {whole, std::sqrt(variance), "", ""};
}

std::size_t LargestOf(const HallHypothesis& one, const HallDiagnosis& found, std::size_t from) {
  std::size_t largest = one.parameters.front();
  double most = -1;
  for (const std::size_t parameter : one.parameters)
    if (const double size = std::abs(found.parameters[At(parameter)]);
        parameter >= from && size > most) {
      most = size;
      largest = parameter;
    }
  return largest;
}

Size OfTerms(const HallHypothesis& one, const HallDiagnosis& found) {
  const std::size_t first = found.layout.term(0);
  const std::size_t largest = LargestOf(one, found, first);
  if (largest < first) return {0, 0, "of the peak", "the pole's shape along theta"};
  Size size{found.parameters[At(largest)], found.sd[At(largest)], "of the peak",
            TermText(found.layout.terms[largest - first])};
  for (const std::size_t parameter : one.parameters)
    if (parameter != largest && parameter >= first &&
        std::abs(found.parameters[At(parameter)]) > 3 * found.sd[At(parameter)])
      size.text += "; " + TermText(found.layout.terms[parameter - first]);
  return size;
}

std::string SensorsText(const HallHypothesis& one) {
  std::string text;
  for (const std::size_t sensor : one.sensors)
    text += (text.empty() ? "v" : ", v") + std::to_string(sensor + 1);
  return text;
}

Size OfShifts(const HallHypothesis& one, const HallDiagnosis& found) {
  Size largest;
  for (std::size_t k = 0; k + 1 < one.parameters.size(); k += 2)
    if (const Size own = LengthOf({&one.parameters[k], 2}, found);
        own.amplitude >= largest.amplitude)
      largest = own;
  return {largest.amplitude / kRadPerDeg, largest.sd / kRadPerDeg, "deg along the sphere",
          SensorsText(one)};
}

// The largest of the cause's parameters, or the length of a vector.
Size SizeOf(const HallHypothesis& one, const HallDiagnosis& found) {
  const std::size_t largest = LargestOf(one, found, 0);
  const double value = found.parameters[At(largest)], sd = found.sd[At(largest)];
  switch (one.cause) {
    case HallCause::kFieldHarmonics:
      return OfTerms(one, found);
    case HallCause::kFieldWidth:
      return {std::exp(value) - 1, sd * std::exp(value), "of the width",
              "the field falls off with latitude as if its width were this much greater"};
    case HallCause::kSensorGain:
      return {value, sd, "of the gain", SensorsText(one)};
    case HallCause::kSensorOffset:
      return {value, sd, "V", SensorsText(one)};
    case HallCause::kSensorPosition:
      return OfShifts(one, found);
    case HallCause::kCentreOffset: {
      const std::size_t parts[] = {ParameterLayout::kCentre, ParameterLayout::kCentre + 1,
                                   ParameterLayout::kCentre + 2};
      const Size size = LengthOf(parts, found);
      return {size.amplitude, size.sd, "mm", "the rotor's centre is off the sensors'"};
    }
    case HallCause::kTemperatureCoefficient:
      return {value, sd, "1/K", "the field changes with temp_C"};
    case HallCause::kOutside:
      break;
  }
  return {};
}

double MedianSize(const VectorXd& values) {
  std::vector<double> sizes(values.data(), values.data() + values.size());
  for (double& size : sizes) size = std::abs(size);
  if (sizes.empty()) return 0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

// Each fifth pose is predicted by fits to the others.
HallGain GainOf(const HallForward& forward, const HallCampaign& campaign, const HallSearch& search,
                const Selected& selected, double noise_V) {
  HallGain gain{.held_out =
                    "five folds by pose: each fifth pose is predicted by fits to the others"};
  std::vector<double> before, after;
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    std::vector<Reading> train, test;
    for (const Reading& reading : search.readings())
      (reading.row % kFolds == fold ? test : train).push_back(reading);
    if (test.empty() || train.empty()) continue;
    HallSearch part(forward, campaign, train);
    const HallFit simple = part.Free();
    HallFit full = part.Fit(selected.on, selected.fit.parameters);
    // Effects outside of the library do not help to predict.
    full.parameters.tail(full.parameters.size() - At(forward.layout().library())).setZero();
    part.set_readings(test);
    part.TakeMeasured();
    VectorXd predicted;
    forward.Predict(simple.parameters, test, &predicted);
    VectorXd miss = part.measured_V() - predicted;
    before.insert(before.end(), miss.data(), miss.data() + miss.size());
    forward.Predict(full.parameters, test, &predicted);
    miss = part.measured_V() - predicted;
    after.insert(after.end(), miss.data(), miss.data() + miss.size());
  }
  const VectorXd b = Eigen::Map<VectorXd>(before.data(), At(before.size()));
  const VectorXd a = Eigen::Map<VectorXd>(after.data(), At(after.size()));
  gain.rms_before_V = Rms(b);
  gain.rms_after_V = Rms(a);
  gain.mad_before_V = MedianSize(b);
  gain.mad_after_V = MedianSize(a);
  const double wrong = gain.rms_before_V * gain.rms_before_V - noise_V * noise_V;
  const double gone = gain.rms_before_V * gain.rms_before_V - gain.rms_after_V * gain.rms_after_V;
  // Where there is nothing to explain, nothing is explained.
  gain.explained = selected.on.empty() || wrong <= 0 ? 0 : std::clamp(gone / wrong, -1.0, 1.0);
  return gain;
}

// The change of a voltage by a tilt of the rotor.
double Sensitivity(const HallForward& forward, const HallCampaign& campaign,
                   const HallSearch& search, const Selected& selected) {
  constexpr double kStep_rad = 1e-4;
  HallCampaign tilted = campaign;
  double squares = 0;
  VectorXd here, there;
  forward.Predict(selected.fit.parameters, search.readings(), &here);
  for (const bool alpha : {true, false}) {
    for (Orientation& pose : tilted.poses) (alpha ? pose.alpha_rad : pose.beta_rad) += kStep_rad;
    const HallForward moved = forward.At(tilted);
    moved.Predict(selected.fit.parameters, search.readings(), &there);
    squares += (there - here).squaredNorm() / (kStep_rad * kStep_rad);
    tilted = campaign;
  }
  return std::sqrt(squares / (2 * static_cast<double>(std::max<Index>(1, here.size()))));
}

// The effects outside of the causes, each with the cost of its absence.
std::vector<HallUnknown> OutsideFound(const HallForward& forward, const HallSearch& search,
                                      const Selected& selected) {
  std::vector<HallUnknown> found;
  for (std::size_t k = 0; k < selected.on.size(); ++k) {
    if (selected.on[k].cause != HallCause::kOutside) continue;
    std::vector<HallHypothesis> rest = selected.on;
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(k));
    const std::size_t parameter = selected.on[k].parameters.front();
    VectorXd start = selected.fit.parameters;
    start[At(parameter)] = 0;
    const double explained = search.Fit(rest, start).squares - selected.fit.squares;
    const auto n = static_cast<double>(search.readings().size());
    found.push_back({Text(forward.layout().effects[parameter - forward.layout().library()]),
                     ChanceOf(explained / selected.variance, 1),
                     std::sqrt(std::max(0.0, explained) / n)});
  }
  return found;
}

// The cost of the cause's absence, with all other parameters fitted anew.
void AddWorth(const HallSearch& search, const Selected& selected, HallCauseFound* cause) {
  std::vector<HallHypothesis> rest;
  VectorXd start = selected.fit.parameters;
  for (const HallHypothesis& one : selected.on) {
    const bool own =
        std::all_of(one.parameters.begin(), one.parameters.end(), [&](std::size_t parameter) {
          return std::find(cause->parameters.begin(), cause->parameters.end(), parameter) !=
                 cause->parameters.end();
        });
    if (!own) rest.push_back(one);
  }
  for (const std::size_t parameter : cause->parameters) start[At(parameter)] = 0;
  const HallFit without = search.Fit(rest, start);
  const auto n = static_cast<double>(search.readings().size());
  const double explained = without.squares - selected.fit.squares;
  cause->chi2 = explained / selected.variance;
  cause->size_V = std::sqrt(std::max(0.0, explained) / n);
  cause->predicted_gain_V = std::sqrt(without.squares / n) - std::sqrt(selected.fit.squares / n);
}

}  // namespace

void AddFindings(const HallForward& forward, const HallCampaign& campaign, const HallSearch& search,
                 const Selected& selected, HallDiagnosis* out) {
  out->layout = forward.layout();
  out->parameters = selected.fit.parameters;
  out->sd = VectorXd::Zero(out->parameters.size());
  for (std::size_t k = 0; k < selected.fit.free.size(); ++k)
    out->sd[At(selected.fit.free[k])] =
        std::sqrt(std::max(0.0, selected.variance * selected.fit.covariance(At(k), At(k))));
  out->sensitivity_V_per_rad = Sensitivity(forward, campaign, search, selected);

  const HallFit simple = search.Free();
  out->before_V.assign(simple.residuals.data(), simple.residuals.data() + simple.residuals.size());
  out->after_V.assign(selected.fit.residuals.data(),
                      selected.fit.residuals.data() + selected.fit.residuals.size());
  for (const Merged& merged : Merge(selected, out->layout)) {
    HallCauseFound cause;
    cause.candidates = {merged.all.cause};
    cause.candidates.insert(cause.candidates.end(), merged.rivals.begin(), merged.rivals.end());
    cause.sensors = merged.all.sensors;
    cause.parameters = merged.all.parameters;
    const Size size = SizeOf(merged.all, *out);
    cause.amplitude = size.amplitude;
    cause.amplitude_unit = size.unit;
    cause.ci95 = {size.amplitude - 1.96 * size.sd, size.amplitude + 1.96 * size.sd};
    cause.text = size.text;
    AddWorth(search, selected, &cause);
    out->causes.push_back(std::move(cause));
  }
  std::sort(out->causes.begin(), out->causes.end(),
            [](const HallCauseFound& a, const HallCauseFound& b) { return a.chi2 > b.chi2; });
  out->unknown = OutsideFound(forward, search, selected);
  for (HallUnknown& more : RemainingStructure(forward, campaign, search, selected))
    out->unknown.push_back(std::move(more));
  out->gain = GainOf(forward, campaign, search, selected, out->noise_V);
}

}  // namespace focalfleet::sim
