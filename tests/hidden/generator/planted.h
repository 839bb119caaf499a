// A spec gives a finished campaign and its key. Both are functions of the spec alone. The key can
// be written from the seed long after the campaign was handed out, and is then the key of exactly
// that campaign.
#pragma once

#include <string>

#include "tests/hidden/generator/files.h"
#include "tests/hidden/generator/judge_effects.h"

namespace focalfleet::hidden {

struct Planted {
  Spec spec;
  Campaign campaign;
  Truth truth;
  std::vector<Effect> effects;
  Measurement measured;
};

Planted Plant(const Spec& spec);

struct Key {
  std::string json;
  // unit_id, move_id, cause, dx_um, dy_um: contribution of each effect.
  std::string contribution_csv;
};

Key MakeKey(const Planted& planted);

}  // namespace focalfleet::hidden
