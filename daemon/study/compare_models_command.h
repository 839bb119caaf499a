// The command diagnose --against compares two models: which one predicts a campaign better, and how
// they differ.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

struct CompareModelsOptions {
  std::string campaign;  // folder
  std::string model_a;   // empty: the ideal kinematics
  std::string model_b;
  std::uint64_t seed = 1;
  int threads = 0;
};

ExitCode RunCompareModels(const Context& context, const CompareModelsOptions& options);

}  // namespace focalfleet::cli
