// Traits say what a cause is like, so that a diagnosis can treat causes by their kind and knows
// none of them by its name. Each effect declares its own traits in its own file. Causes that show
// in other ways than by a signature are listed in other_causes.h.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace focalfleet::sim {

/// Causes of one family have signatures that are near each other: where the true shape of one is
/// known only roughly, its misfit looks like another.
enum class Family : std::uint8_t {
  kMoves,   // depends on the direction and length of moves
  kAngles,  // depends on where the axis stands
  kNight,   // drifts as the night cools and the units run
  kImage,   // moves the whole image
  kRotor,   // turns with the rotor
};

/// A motion of the image that a cause makes as one of its own.
enum class MotionOfImage : std::uint8_t { kNone, kGrows, kBends, kAlongALine };

struct Traits {
  std::vector<Family> families;
  MotionOfImage image_motion = MotionOfImage::kNone;
  bool is_ripple = false;       // a wave of gears, too fast to be the shape of a curve
  bool is_bump = false;         // at one place of the angle, and of one unit: clear there
  bool is_slow_wave = false;    // of the angle: a structure that follows the angle may look like it
  bool by_direction = false;    // turns its sign with the move, by a column
  bool acts_on_others = false;  // between neighbours
  bool is_static = false;       // a constant of the geometry
  bool is_found_exactly = false;  // by places or steps: no shape of another cause leaves it
  bool is_of_air = false;         // moves neighbours alike, anew in each exposure
  bool is_of_camera = false;      // the camera's own motion, free in each exposure

  [[nodiscard]] bool IsOf(Family family) const {
    return std::ranges::find(families, family) != families.end();
  }
};

}  // namespace focalfleet::sim
