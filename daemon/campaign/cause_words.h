// CauseWords are the words for a cause that an operator would use. The sentence of a verdict is
// made of them (verdict_sentence.h).
#pragma once

#include <string>
#include <string_view>

namespace focalfleet {

struct CauseWords {
  std::string_view cause;  // id of docs/diagnosis.md
  std::string_view name;
  /// The deed of units that have it, in the form "[end|ends] {} <late|early>": the words for
  /// several units and for one, the amplitude, the words for a positive amplitude and a negative
  /// one.
  std::string_view does;
  bool is_of_units = true;  // false: `does` is a whole sentence, whose subject is not the units
};

/// The words; a cause that has none goes by its id.
CauseWords WordsFor(std::string_view cause);

/// `does` with the choices made. Errors are impossible: an open bracket ends with the text.
std::string Spoken(std::string_view does, bool one_unit, double amplitude,
                   std::string_view amplitude_text);

/// The size of an amplitude as a person says it: 0.002 deg/deg is 0.2 %.
std::string SpokenAmplitude(double amplitude, std::string_view unit);

}  // namespace focalfleet
