// The man page focalfleet.toml(5), out of the list of keys that the reader has.
#pragma once

#include <string>
#include <vector>

#include "daemon/usage/manual.h"

namespace focalfleet {

struct ConfigKey {
  std::string name;     // "fleet.units"
  std::string kind;     // "path", "number from 0 to 1000", "true or false" ...
  std::string initial;  // the default, as TOML has it
  std::string meaning;
};

struct ConfigSection {
  std::string name;
  std::string meaning;
  std::vector<ConfigKey> keys;
};

/// All sections and keys, in the order of the file.
std::vector<ConfigSection> DescribeConfig();

usage::ManualPage ConfigManual();

}  // namespace focalfleet
