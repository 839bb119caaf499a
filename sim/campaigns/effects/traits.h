// Traits say what a cause is like, so that a diagnosis can treat causes by their kind and knows
// none of them by its name. Each effect declares its own traits in its own file. Causes that show
// in other ways than by a signature are listed in other_causes.h.
#pragma once

#include <cstdint>

namespace focalfleet::sim {

/// A motion of the image that a cause makes as one of its own.
enum class MotionOfImage : std::uint8_t { kNone, kGrows, kBends, kAlongALine };

struct Traits {
  MotionOfImage image_motion = MotionOfImage::kNone;
  bool by_direction = false;    // turns its sign with the move, by a column or evenly
  bool acts_on_others = false;  // between neighbours
  bool is_static = false;       // a constant of the geometry
  bool is_of_camera = false;    // the camera's own motion, free in each exposure
};

}  // namespace focalfleet::sim
