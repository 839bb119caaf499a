// The command line of focalfleetd: a tree without commands, from which help and man page are made.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "daemon/usage/manual.h"

namespace focalfleet {

struct DaemonCommandLine {
  CLI::App app;
  std::string config;
  bool check = false;
  std::string replay;
};

std::unique_ptr<DaemonCommandLine> MakeDaemonCommandLine();

/// The man page of focalfleetd.
std::vector<usage::ManualPage> DaemonManual();

}  // namespace focalfleet
