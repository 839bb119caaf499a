#include "daemon/campaign/verdict_sentence.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "daemon/campaign/cause_words.h"
#include "daemon/campaign/diagnosis_files.h"
#include "sim/campaigns/diagnosis/decide/decide.h"

namespace focalfleet {
namespace {

constexpr std::size_t kCausesSaid = 3;  // more is a list, and stands below
constexpr std::size_t kUnitsNamed = 4;

/// The units that have the cause, as the subject of a sentence.
std::string SubjectOf(const sim::CauseFound& cause, const sim::Diagnosis& diagnosis) {
  if (cause.all_units) return diagnosis.units == 1 ? "The unit" : "All units";
  const std::size_t count = cause.units.size();
  if (count == 1) return fmt::format("Unit {}", cause.units.front());
  if (count > 0 && count <= kUnitsNamed) {
    std::string text = "Units ";
    for (std::size_t k = 0; k < count; ++k)
      text += (k == 0 ? "" : k + 1 == count ? " and " : ", ") + std::to_string(cause.units[k]);
    return text;
  }
  if (count == 0) return "Some units";
  return fmt::format("{} of {} units", count, diagnosis.units);
}

std::string AxisOf(const sim::CauseFound& cause) {
  if (cause.axis == "both") return " of both axes";
  return cause.axis == "theta" || cause.axis == "phi" ? " of " + cause.axis : "";
}

std::string Percent(double share) {
  if (share > 0.99) return "over 99 %";
  return share < 0.01 ? "below 1 %" : fmt::format("{:.0f} %", 100 * share);
}

/// The name with its axis, and the rivals, with the probability of each where any is in doubt.
std::string NamesOf(const sim::CauseFound& cause) {
  std::string text = std::string(WordsFor(cause.cause).name) + AxisOf(cause);
  if (cause.candidates.size() < 2 && cause.doubt == 0) return text;
  const std::vector<double> posterior = sim::PosteriorOf(cause);
  text += " (" + Percent(posterior.front()) + ")";
  constexpr std::size_t kRivalsSaid = 2;
  for (std::size_t k = 1; k < cause.candidates.size() && k <= kRivalsSaid; ++k)
    text += fmt::format(" or {} ({})", WordsFor(cause.candidates[k]).name, Percent(posterior[k]));
  if (cause.candidates.size() > kRivalsSaid + 1)
    text += fmt::format(" or one of {} others", cause.candidates.size() - kRivalsSaid - 1);
  return text;
}

std::string SentenceOf(const sim::CauseFound& cause, const sim::Diagnosis& diagnosis) {
  const CauseWords words = WordsFor(cause.cause);
  const bool one = cause.all_units ? diagnosis.units == 1 : cause.units.size() == 1;
  const std::string does = Spoken(words.does, one, cause.amplitude,
                                  SpokenAmplitude(cause.amplitude, cause.amplitude_unit));
  return fmt::format("{}{}: {}.", words.is_of_units ? SubjectOf(cause, diagnosis) + " " : "", does,
                     NamesOf(cause));
}

/// The misfits beside the named causes.
std::string RestOf(const sim::Diagnosis& diagnosis) {
  if (diagnosis.unknown.empty())
    return diagnosis.causes.empty() ? "No cause has a name." : "Nothing else is wrong.";
  const sim::UnknownFound& found = diagnosis.unknown.front();
  std::string text = fmt::format("{} is wrong by {} um that no known cause explains: see {}.",
                                 diagnosis.causes.empty() ? "Something" : "Something else",
                                 Decimals(found.size_um, 1), found.covariate);
  const auto patches = std::ranges::count_if(
      diagnosis.unknown, [](const sim::UnknownFound& one) { return one.patched.has_value(); });
  if (patches > 0)
    text +=
        fmt::format(" {} of {} such structures are patched by empirical terms, which name nothing.",
                    patches, diagnosis.unknown.size());
  return text;
}

/// Whole numbers from 10 um on.
std::string Micrometres(double um) { return Decimals(um, std::abs(um) < 9.95 ? 1 : 0); }

std::string GainOf(const sim::Diagnosis& diagnosis) {
  const sim::HeldOutGain& gain = diagnosis.gain;
  if (!std::isfinite(gain.rms_before_um) || !std::isfinite(gain.rms_after_um)) return "";
  return fmt::format(
      "With {} in the model fibres end {} um from their predicted places instead of {}.",
      diagnosis.causes.size() == 1 ? "it" : "them", Micrometres(gain.rms_after_um),
      Micrometres(gain.rms_before_um));
}

std::string NumbersOf(const sim::Diagnosis& diagnosis) {
  const sim::HeldOutGain& gain = diagnosis.gain;
  std::string text;
  for (const sim::CauseFound& cause : diagnosis.causes)
    text += fmt::format("{}{}{} {} um", text.empty() ? "" : ", ", WordsFor(cause.cause).name,
                        AxisOf(cause), Decimals(cause.size_um, 1));
  if (!text.empty()) text = "Sizes at the fibre: " + text + ". ";
  if (!std::isfinite(gain.rms_after_um)) return text;
  return text + fmt::format("Held-out rms {} um before, {} um after; noise {} um.",
                            Decimals(gain.rms_before_um, 1), Decimals(gain.rms_after_um, 1),
                            Decimals(gain.noise_floor_um, 1));
}

}  // namespace

std::string VerdictText::says() const { return fmt::format("{}", fmt::join(lines, " ")); }

VerdictText TextOf(const sim::Diagnosis& diagnosis) {
  if (diagnosis.verdict == sim::Verdict::kInsufficient)
    return {{"These data are not enough for a verdict: " + diagnosis.insufficient + "."}, ""};
  if (diagnosis.verdict == sim::Verdict::kConsistent)
    return {
        {fmt::format("Nothing is wrong: fibres end {} um from their predicted places, which is {}.",
                     Micrometres(diagnosis.gain.rms_after_um),
                     diagnosis.steps_limit ? "the steps that places come in" : "their noise")},
        NumbersOf(diagnosis)};
  VerdictText text{.lines = {}, .numbers = NumbersOf(diagnosis)};
  for (std::size_t k = 0; k < diagnosis.causes.size() && k < kCausesSaid; ++k)
    text.lines.push_back(SentenceOf(diagnosis.causes[k], diagnosis));
  if (diagnosis.causes.size() > kCausesSaid)
    text.lines.push_back(
        fmt::format("{} more causes are smaller.", diagnosis.causes.size() - kCausesSaid));
  text.lines.push_back(RestOf(diagnosis));
  if (const std::string gain = GainOf(diagnosis); !gain.empty() && !diagnosis.causes.empty())
    text.lines.back() += " " + gain;
  return text;
}

std::string VerdictSentence(const sim::Diagnosis& diagnosis) {
  const VerdictText text = TextOf(diagnosis);
  return text.numbers.empty() ? text.says() : text.says() + " " + text.numbers;
}

}  // namespace focalfleet
