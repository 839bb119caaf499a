// FLASH survives power-off. The motor has no encoder, so the stored vector is applied first at
// power-on: rotor and field then agree. The turns say in which of the gear * range electrical turns
// they do. The mark `moving` is set before the first step and cleared together with the final
// vectors. A power cut in mid-move therefore never looks like rest.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/base/ids.h"
#include "protocol/wire/messages.h"

namespace focalfleet::sim {

struct AxisFlash {
  std::uint16_t vector = 0;  // 0..subdivision-1
  std::int32_t turns = 0;    // whole electrical turns
  std::uint16_t subdivision = 96;
  std::uint16_t counter1 = 500;
  std::uint8_t repeat = 108;
  WaveMode mode = WaveMode::kAsymmetric;
  std::int32_t min_position = 0;   // vectors
  std::int32_t max_position = 0;   // vectors
  std::int32_t home_position = 0;  // vectors

  /// The position from the axis' zero. Units: vectors.
  [[nodiscard]] std::int32_t position() const { return turns * subdivision + vector; }
  void set_position(std::int32_t position) {
    turns = position / subdivision - (position % subdivision < 0 ? 1 : 0);
    vector = static_cast<std::uint16_t>(position - turns * subdivision);
  }
  bool operator==(const AxisFlash&) const = default;
};

struct Flash {
  SerialNumber serial;
  std::array<AxisFlash, kAxisCount> axis;
  std::uint32_t moves_begun = 0;
  MoveId last_begun;    // 0: none yet
  bool moving = false;  // the mark
  // Bit per axis: the axis must be homed or its position set before it may move.
  std::uint8_t lost_axes = 0;
  std::int32_t host_timeout_ms = 5000;
  bool operator==(const Flash&) const = default;
};

}  // namespace focalfleet::sim
