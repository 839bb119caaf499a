// `focalfleet-sim soak`: nights of the whole system with faults, by seed.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

namespace focalfleet::soak {

/// The options as CLI11 fills them in.
struct SoakOptions {
  std::string seeds;
  std::string json_folder;
  std::string merge_folder;
  double minutes = 0;
  std::uint32_t units = 0;
  std::uint32_t week = 0;
  bool twice = false;
  bool replay = false;
  bool tell = false;
};

/// The subcommand stands in the tree and fills in `options`, which outlives it.
CLI::App* AddSoak(CLI::App* app, SoakOptions* options);
/// Returns the exit code.
int RunSoak(const SoakOptions& options);

}  // namespace focalfleet::soak
