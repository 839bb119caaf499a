// The verdict of a diagnosis as an operator would say it to the next one, and the numbers after it:
//
//   All units end 0.4 deg late whenever they reverse: backlash of both axes (97 %). Nothing else is
//   wrong. With it in the model fibres end 6 um from their predicted places instead of 54.
#pragma once

#include <string>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"

namespace focalfleet {

struct VerdictText {
  std::vector<std::string> lines;  // a sentence each cause, then what follows from all of them
  std::string numbers;             // for experts; empty where there are none

  [[nodiscard]] std::string says() const;  // all lines in one
};

VerdictText TextOf(const sim::Diagnosis& diagnosis);

/// Both in one line, for the command line.
std::string VerdictSentence(const sim::Diagnosis& diagnosis);

}  // namespace focalfleet
